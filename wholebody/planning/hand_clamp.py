"""Hand paths led along the planned palms wherever the body does not reach the targets."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from policy.geometry.rotations import matrix_to_rotvec, rotvec_to_matrix
from policy.geometry.se3 import translated
from wholebody.config import PlannerConfig
from wholebody.planning.attempt import Attempt
from wholebody.planning.trajectory import GRID
from wholebody.reference import HandPath

POINTS_PER_KNOT = 4
"""Points of the trajectory from knot to knot that a clamped path goes through: its quintics between points 1/60 s apart
stay within 1 mm of the planned palm (`test_chunk_planner`)."""


def clamped(
    attempt: Attempt, config: PlannerConfig, palms_at: Callable[[np.ndarray], np.ndarray], offsets: np.ndarray
) -> tuple[tuple[HandPath, HandPath], np.ndarray]:
    """Lead the hands along the plan wherever it does not reach the targets; a small remainder is left to the QP.

    Inside the tolerance the QP is left to close the gap; past it the path becomes the plan's own, whole, from a knot
    before to a knot after: near a straight arm, a target a few millimetres off the planned posture drives the arm far
    away from it, and so does a turn that is over before the next knot.

    Args:
        attempt: The plan.
        config: Tolerances.
        palms_at: Poses of both palms, (n, 2, 4, 4), at configurations (n, nq).
        offsets: Palm points in the axes of the wrists, shape (2, 3), [m].

    Returns:
        The paths, and how far each hand is moved at the knots, (K, 2), [m].
    """
    targets, reached = attempt.targets, attempt.knots.T_palms
    wanted, steps = targets.T_palms, targets.steps
    turn = matrix_to_rotvec(reached[:, :, :3, :3] @ np.swapaxes(wanted[:, :, :3, :3], -1, -2))
    angle = np.linalg.norm(turn, axis=2)
    share = _widened(np.clip(2.0 * attempt.distance / config.clamp_tolerance - 1.0, 0.0, 1.0))
    turn_share = _widened(np.clip(2.0 * angle / config.turn_tolerance - 1.0, 0.0, 1.0))
    if not share.any() and not turn_share.any():
        return targets.paths, np.zeros_like(attempt.distance)
    every = max(1, round((steps[1] - steps[0]) / (POINTS_PER_KNOT * GRID)))
    q = attempt.trajectory.q[: round((steps[-1] - steps[0]) / GRID) + 1 : every]
    s = steps[0] + every * GRID * np.arange(len(q))
    share, turn_share = _between(s, steps, share), _between(s, steps, turn_share)
    led = np.flatnonzero((share > 0.0).any(axis=1) | (turn_share > 0.0).any(axis=1) | (s == s[0]))
    planned = palms_at(q[led])
    # The hands are not quite where the plan begins: that is made up for until the first knot.
    left = _between(s[led], steps[:2], np.array([[1.0], [0.0]]))
    paths = []
    for i, path in enumerate(targets.paths):
        T = path.sample(s).T_world_hand
        R, palm = T[led, :3, :3], translated(T[led], offsets[i])[:, :3, 3]
        turn, way = matrix_to_rotvec(planned[:, i, :3, :3] @ np.swapaxes(R, 1, 2)), planned[:, i, :3, 3] - palm
        R = rotvec_to_matrix(turn_share[led, i, None] * (turn - left * turn[0])) @ R
        palm += share[led, i, None] * (way - left * way[0])
        T[led, :3, :3], T[led, :3, 3] = R, palm - R @ offsets[i]
        paths.append(path.moved(s, T))
    return tuple(paths), attempt.distance * _between(steps, s, share)


def _widened(share: np.ndarray) -> np.ndarray:
    """The largest share (K, 2) of each knot and of its two neighbours."""
    padded = np.pad(share, ((1, 1), (0, 0)))
    return np.maximum(share, np.maximum(padded[:-2], padded[2:]))


def _between(s: np.ndarray, steps: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Shares (K, 2) at ``steps``, smoothly in between: (n, 2) at ``s``."""
    at = np.clip((s - steps[0]) / (steps[1] - steps[0]), 0.0, len(steps) - 1.0)
    low = np.minimum(at.astype(int), len(steps) - 2)
    x = (at - low)[:, None]
    return share[low] + x**3 * (10.0 + x * (6.0 * x - 15.0)) * (share[low + 1] - share[low])
