"""The robot at one instant, computed by compiled code: what `Robot` gets from Pinocchio, several times faster.

`Robot` stays the specification; a test holds the two equal to 1e-10 on random states.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import pinocchio as pin

from wholebody.reference.compiled import compiled
from wholebody.robot.body_table import body_table
from wholebody.robot.kernels import rigid_body as core


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
        sums: Centre of mass and momentum, laid out as in `rigid_body`.

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


@cache
def dynamics() -> Callable:
    """The compiled `rigid_body.dynamics`."""
    return compiled(core, "dynamics")
