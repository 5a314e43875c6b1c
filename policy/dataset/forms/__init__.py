"""Forms in which datasets come: LeRobot's v3.0, v2.1 and v2.0, JSON episodes of xr_teleoperate, HDF5.

Begin with `policy.dataset.forms.v30.read_v30`; the others answer the same `policy.dataset.format.Dataset`.
"""
