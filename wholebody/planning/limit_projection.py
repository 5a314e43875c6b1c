"""Steps of a chunk that no hand could follow: the nearest ones that a hand could.

Recordings jump by centimetres within a step, and so do policies that never saw the robot. A reference that has to be
held back from such a jump when it comes is late for everything after it. The chunk is known in advance: the nearest
steps within bounds on speed, acceleration and jerk begin to move before the jump and lose a few millimetres around it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from policy.geometry.rotations import quaternion_to_matrix, rotvec_to_matrix
from policy.geometry.se3 import make_transform
from wholebody.errors import PlanningError
from wholebody.jit.entry import Entry
from wholebody.planning.kernels.nearest_steps import N_BEFORE, N_COLUMNS, nearest_steps
from wholebody.reference import HandLimits, HandMotion, MotionLimits
from wholebody.reference.rotation import continuous_quaternions

DEMAND = (1.0, 1.0, 1.5)
"""Speed, acceleration and jerk of a chunk's steps, per axis, in terms of the limits: for a hand 20 m/s^2, 600 m/s^3;
chosen, no trial is on record."""
JUMP, IMPLAUSIBLE_SHARE = 0.06, 0.25
"""Steps that have to be moved by more than that [m] are implausible: they keep this share of the bounds; chosen, no
trial is on record."""
SOFTNESS = 1e-6
"""Excess over a bound for each unit of the force that keeps it, in terms of its row's square [no unit]; chosen: what
begins past the bounds has a nearest motion, too."""
SQUARES = ((1.0, 2.0, 2.0, 2.0), (1.0, 5.0, 6.0, 6.0), (1.0, 10.0, 19.0, 20.0))
"""Squares of the rows of first, second and third differences, of which the first ones have columns of the past [no
unit]; derived from the binomial coefficients."""
ROUNDS, SMALL = 100, np.array([1e-16, 1e-9])
"""Most rounds of a search, and what counts as small there [no unit]; measured: 14 to 40 rounds, 1e-10 m from what an
active set comes to."""
_nearest_steps = Entry(nearest_steps)


@dataclass(frozen=True)
class ProjectedSteps:
    """The steps of a chunk that are still to come, as a hand could do them.

    Attributes:
        times: Of `N_BEFORE` steps of the motion so far and of the chunk's own, shape (K,), [s].
        T: Poses, shape (K, 4, 4).
        q: Finger joints, shape (K, 7), [rad].
        changed: Whether any of the chunk's own steps is another.
        moved: Distance between the two at each of the chunk's steps, shape (K - `N_BEFORE`,), [m].
    """

    times: np.ndarray
    T: np.ndarray
    q: np.ndarray
    changed: bool
    moved: np.ndarray


def continued(
    times: np.ndarray, T: np.ndarray, q: np.ndarray, limits: HandLimits, motion: HandMotion, s: float
) -> ProjectedSteps:
    """The nearest steps that go on from a motion, with some before them that say where it comes from.

    Args:
        times: Of the chunk's steps, evenly spaced, shape (H,), [s].
        T: Poses, shape (H, 4, 4).
        q: Finger joints, shape (H, n), [rad].
        limits: What the bounds are told in.
        motion: What the hand is commanded to do at ``s``, one row.
        s: Where the chunk is joined [s].

    Raises:
        PlanningError: If no nearest steps were found: numbers far beyond anything that a hand can do.
    """
    step = times[1] - times[0]
    first = min(int(np.searchsorted(times, s - 0.25 * step)), len(times) - 2)
    past = times[first] + step * np.arange(-N_BEFORE, 0.0)
    ago, there = past - s, times[first] - s
    p = T[first, :3, 3] + motion.v * (past - times[first])[:, None] + 0.5 * motion.a * (ago**2 - there**2)[:, None]
    turn = motion.w * (past - times[first])[:, None] + 0.5 * motion.alpha * (ago**2 - there**2)[:, None]
    fingers = q[first] + motion.dq_finger[: q.shape[1]] * (past - times[first])[:, None]
    R = rotvec_to_matrix(turn) @ T[first, :3, :3]
    T = np.concatenate([make_transform(R, p), T[first:]])
    q = np.concatenate([limits.within(fingers), q[first:]])
    quat = continuous_quaternions(T[:, :3, :3])
    near_p, near_quat = _both(T, quat, 1.0 / step, limits)
    moved = np.linalg.norm(near_p - T[:, :3, 3], axis=1)
    if moved.max() > JUMP:
        near_p, near_quat = _both(T, quat, 1.0 / step, limits.scaled(IMPLAUSIBLE_SHARE))
        moved = np.linalg.norm(near_p - T[:, :3, 3], axis=1)
    changed = bool(moved.any()) or not np.array_equal(near_quat, quat)
    if changed:
        T = make_transform(quaternion_to_matrix(near_quat / np.linalg.norm(near_quat, axis=1)[:, None], "xyzw"), near_p)
    return ProjectedSteps(np.concatenate([past, times[first:]]), T, q, changed, moved[N_BEFORE:])


def _both(T: np.ndarray, quat: np.ndarray, fps: float, limits: HandLimits) -> tuple[np.ndarray, np.ndarray]:
    """`nearest` positions and quaternions, whose rates are half of the angular ones."""
    return nearest(T[:, :3, 3], fps, limits.position), nearest(quat, fps, limits.orientation.scaled(0.5))


def nearest(values: np.ndarray, fps: float, limits: MotionLimits) -> np.ndarray:
    """The values nearest to these, in least squares, whose differences keep `DEMAND`; the first `N_BEFORE` are kept.

    Args:
        values: One row a step, shape (H, n), H more than `N_BEFORE`.
        fps: Steps a second [Hz].
        limits: What the bounds are told in.

    Returns:
        The same array where it keeps the bounds. What begins beyond them comes back to them.
    """
    most = np.multiply(DEMAND, (limits.speed, limits.acceleration, limits.jerk)) / fps ** np.arange(1, 4)
    if _keeps(values, most):
        return values
    soft = np.zeros((len(values), len(most)))
    for k, (squares, bound) in enumerate(zip(SQUARES, most, strict=True)):
        soft[N_BEFORE:, k] = SOFTNESS / bound**2 * squares[-1]
        soft[N_BEFORE : N_BEFORE + len(squares), k] = SOFTNESS / bound**2 * np.array(squares)[: len(values) - N_BEFORE]
    out, memory, scratch = values.copy(), np.empty((len(values), N_COLUMNS)), np.empty((6, 3))
    for k, column in enumerate(values.T):
        if _keeps(column[:, None], most):
            continue
        scale = max(float(np.ptp(column)), 1.0) ** 2
        if _nearest_steps(column.copy(), most, soft, scale, ROUNDS, SMALL, memory, scratch) == ROUNDS:
            raise PlanningError(
                "no steps within the bounds of a hand were found near those of the chunk: are its positions in metres?"
            )
        out[N_BEFORE:, k] = memory[N_BEFORE:, 0]
    return out


def _keeps(values: np.ndarray, most: np.ndarray) -> bool:
    """Whether first, second and third differences (3,) of values (H, n) that are not all past are at most that."""
    for k, bound in enumerate(most.tolist(), start=1):
        values = values[1:] - values[:-1]
        if not (np.abs(values[N_BEFORE - k :]) <= bound).all():
            return False
    return True
