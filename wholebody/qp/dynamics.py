"""The robot at one instant, computed by compiled code: what `Robot` gets from Pinocchio, several times faster.

`Robot` stays the specification; a test holds the two equal to 1e-10 on random states.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import pinocchio as pin

from wholebody.errors import InputError
from wholebody.qp import dynamics_core as core
from wholebody.reference.compiled import compiled

REVOLUTE = {
    "JointModelRX": (1.0, 0.0, 0.0),
    "JointModelRY": (0.0, 1.0, 0.0),
    "JointModelRZ": (0.0, 0.0, 1.0),
}
"""Joint types whose axis is known by name; others carry it."""


class CompiledDynamics:
    """Kinematics and dynamics on preallocated arrays.

    Args:
        model: Pinocchio model: a free-flyer and revolute joints.

    Attributes:
        q, v: Configuration (nq,) and velocity (nv,) of the last update.
        R: Rotations of the joint frames, body 0 is the base, shape (nb, 3, 3).
        p: Their origins relative to the base, world axes, shape (nb, 3), [m].
        S: Joint axes as twists about the base, shape (nv, 6).
        V, A: Twists and drifts of the bodies about the base, shape (nb, 6).
        M: Mass matrix, shape (nv, nv). nle: Coriolis, centrifugal and gravity forces, shape (nv,).
        F: Force on the whole robot about the base for unit accelerations, shape (nv, 6).
        sums: Centre of mass and momentum, laid out as in `dynamics_core`.

    Raises:
        InputError: If the model has a joint of another kind, or no free-flyer first.
    """

    def __init__(self, model: pin.Model) -> None:
        self.nv, n = model.nv, model.njoints - 1
        self.table, self.parent = body_table(model)
        self.armature = np.array(model.armature)
        self.gravity = np.array(model.gravity.linear)
        self.q, self.v = np.zeros(model.nq), np.zeros(model.nv)
        self.R, self.p = np.zeros((n, 3, 3)), np.zeros((n, 3))
        self.S, self.V, self.A = np.zeros((self.nv, 6)), np.zeros((n, 6)), np.zeros((n, 6))
        self._inertia, self._h, self._force = np.zeros((n, 10)), np.zeros((n, 6)), np.zeros((n, 6))
        self.M, self.F = np.zeros((self.nv, self.nv)), np.zeros((self.nv, 6))
        self.nle, self.sums = np.zeros(self.nv), np.zeros(core.SUMS)
        self._arguments = (
            self.q, self.v, self.table, self.parent, self.armature, self.gravity, self.R, self.p, self.S, self.V,
            self.A, self._inertia, self._h, self._force, self.M, self.F, self.nle, self.sums,
        )  # fmt: skip
        self._compute = dynamics()

    def update(self, q: np.ndarray, v: np.ndarray) -> None:
        """Compute everything at ``q`` (nq,) and ``v`` (nv,), Pinocchio convention."""
        self.q[:], self.v[:] = q, v
        self._compute(*self._arguments)


def body_table(model: pin.Model) -> tuple[np.ndarray, np.ndarray]:
    """Table and parents of the bodies, as in `dynamics_core`.

    Raises:
        InputError: If the model has a joint of another kind, or no free-flyer first.
    """
    n = model.njoints - 1
    if model.joints[1].shortname() != "JointModelFreeFlyer" or model.nv != 5 + n:
        raise InputError("compiled dynamics need a free-flyer base and revolute joints; use `compiled: false`")
    table, parent = np.zeros((n, core.BODY)), np.zeros(n, dtype=np.int64)
    for i in range(n):
        joint, row = model.joints[i + 1], table[i]
        placement, inertia = model.jointPlacements[i + 1], model.inertias[i + 1]
        row[: core.AXIS] = np.concatenate([placement.rotation.ravel(), placement.translation])
        if i > 0:
            row[core.AXIS : core.MASS] = _axis(model, i + 1)
            parent[i] = model.parents[i + 1] - 1
            if joint.idx_v != 5 + i:
                raise InputError(f"joint '{model.names[i + 1]}' is at column {joint.idx_v} of v; {5 + i} is expected")
        row[core.MASS], row[core.LEVER : core.INERTIA] = inertia.mass, inertia.lever
        row[core.INERTIA :] = inertia.inertia[np.triu_indices(3)]
    return table, parent


def _axis(model: pin.Model, joint: int) -> np.ndarray:
    name = model.joints[joint].shortname()
    if name in REVOLUTE:
        return np.array(REVOLUTE[name])
    if name == "JointModelRevoluteUnaligned":
        return np.array(model.joints[joint].extract().axis)
    raise InputError(f"joint '{model.names[joint]}' is a {name}; compiled dynamics know revolute joints only")


@cache
def dynamics() -> Callable:
    """The compiled `dynamics_core.dynamics`."""
    return compiled(core, "dynamics")
