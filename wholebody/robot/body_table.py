"""The bodies of a robot as a flat table, for compiled kinematics and dynamics."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wholebody.errors import InputError
from wholebody.robot.kernels.bodies import AXIS, BODY, MASS, PLACEMENT_P

REVOLUTE = {
    "JointModelRX": (1.0, 0.0, 0.0),
    "JointModelRY": (0.0, 1.0, 0.0),
    "JointModelRZ": (0.0, 0.0, 1.0),
}
"""Axes of the joint types that are known by name [no unit], Pinocchio's definition; others carry theirs."""
_UPPER = np.triu_indices(3)


def body_table(model: pin.Model) -> tuple[np.ndarray, np.ndarray]:
    """Table and parents of the bodies; body 0 is the base, body i > 0 hangs on the joint of velocity ``5 + i``.

    Returns:
        Rows of shape (n, 25): placement of the joint in the parent (rotation row by row, translation), joint axis,
        mass, centre of mass and inertia about it (xx xy xz yy yz zz); and the parents, shape (n,).

    Raises:
        InputError: If the model has a joint that is not revolute, or no free-flyer first.
    """
    n = model.njoints - 1
    if model.joints[1].shortname() != "JointModelFreeFlyer" or model.nv != 5 + n:
        raise InputError(
            f"compiled dynamics need a free-flyer base and revolute joints, {5 + n} velocities for {n - 1} joints; "
            f"the model begins with a {model.joints[1].shortname()} and has {model.nv} velocities. "
            "`models.pinocchio_model.load_pinocchio` adds the free-flyer to a URDF"
        )
    table, parent = np.zeros((n, BODY)), np.zeros(n, dtype=np.int64)
    for i in range(n):
        joint, row = model.joints[i + 1], table[i]
        placement, inertia = model.jointPlacements[i + 1], model.inertias[i + 1]
        row[:PLACEMENT_P], row[PLACEMENT_P:AXIS] = placement.rotation.ravel(), placement.translation
        if i > 0:
            row[AXIS:MASS] = _axis(model, i + 1)
            parent[i] = model.parents[i + 1] - 1
            if joint.idx_v != 5 + i:
                raise InputError(f"joint '{model.names[i + 1]}' is at column {joint.idx_v} of v; {5 + i} is expected")
        row[MASS:] = inertia_row(inertia)
    return table, parent


def inertia_row(inertia: pin.Inertia) -> np.ndarray:
    """Mass, centre of mass and inertia about it, as the columns from `MASS` on have them, shape (10,)."""
    return np.concatenate([[inertia.mass], inertia.lever, inertia.inertia[_UPPER]])


def _axis(model: pin.Model, joint: int) -> np.ndarray:
    name = model.joints[joint].shortname()
    if name in REVOLUTE:
        return np.array(REVOLUTE[name])
    if name == "JointModelRevoluteUnaligned":
        return np.array(model.joints[joint].extract().axis)
    raise InputError(f"joint '{model.names[joint]}' is a {name}; compiled dynamics know revolute joints only")
