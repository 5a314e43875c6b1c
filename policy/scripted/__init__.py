"""Policies that are formulas: reaches, waves, grasps, and hands that touch something.

Begin with `policy.scripted.library`, which has every script; `policy.scripted.policy` says what one is.
"""
