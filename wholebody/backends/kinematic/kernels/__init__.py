"""Inverse kinematics of a tick, compiled."""
