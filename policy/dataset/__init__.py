"""LeRobot datasets: reading, checking, and from joints to wrists.

Begin with `policy.dataset.open.open_dataset`; `policy.dataset.conversion.convert_dataset` makes wrists of joints.
"""
