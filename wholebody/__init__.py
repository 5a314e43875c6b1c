"""Whole-body control of the Unitree G1: from an action chunk to joint commands that keep it standing."""
