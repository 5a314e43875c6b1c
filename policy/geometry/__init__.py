"""Rotations and rigid transforms in numpy.

Begin with `policy.geometry.rotations`, which has the conventions; poses are in `policy.geometry.se3`.
"""
