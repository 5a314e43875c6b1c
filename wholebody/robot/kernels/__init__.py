"""Rigid-body dynamics and frames, compiled."""
