"""Rotations and rigid transforms in numpy."""
