"""A first motion for the optimiser: one inverse-kinematics step a knot, from knot to knot."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wholebody.config import PosturePlanConfig
from wholebody.posture import knots as at
from wholebody.posture import weights
from wholebody.posture.knots import N_BODY, N_FREE, Knots

INERTIA = 30.0
"""Price of moving from one knot to the next [1/m^2, 1/rad^2]."""
STEP_MAX = 0.25
"""[m, rad]"""


def follow(knots: Knots, config: PosturePlanConfig, q: np.ndarray, T_palms: np.ndarray, first: int) -> None:
    """Fill the rows of q (K, 36) from ``first`` on, each from the one before; self-collision does not count."""
    n_sided = at.EDGES.start + knots.n_edges
    r, J, N = np.zeros(at.N_POSITION), np.zeros((at.N_POSITION, N_BODY)), np.zeros((N_BODY, N_FREE))
    bound, J_bound, sign = np.full(n_sided, -1.0), np.zeros((n_sided, N_BODY)), np.ones(n_sided)
    w_bound = weights.sided(n_sided)
    for k in range(first, len(q)):
        now = knots.settle(q[k - 1], N)
        knots.position(now, T_palms[k], r, J)
        knots.bounds(now, J, bound, J_bound, sign)
        w = weights.position(r[None], config)[0]
        B, S = J @ N, J_bound @ N
        H, g = B.T @ (w[:, None] * B) + INERTIA * np.eye(N_FREE), -B.T @ (w * r)
        active = sign * bound > 0.0
        for _ in range(4):
            c = w_bound * active
            z = np.linalg.solve(H + S.T @ (c[:, None] * S), g - S.T @ (c * bound))
            after = sign * (bound + S @ z) > 0.0
            if np.array_equal(after, active):
                break
            active = after
        z *= min(1.0, STEP_MAX / np.abs(z).max())
        q[k] = pin.integrate(knots.model, now, N @ z)
