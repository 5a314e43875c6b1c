"""Noise in a chunk, taken out before it is planned.

Policies scatter: a trained one by a millimetre a step, an untrained one by centimetres, and a millimetre at 50 Hz is
already 10 m/s^2 and 1000 m/s^3, back and forth, which no plan follows. What such a chunk means is the curve through the
scatter. It is told from motion by its jerk, which turns round from step to step, whatever its size. How smooth the
curve is follows from the numbers, by generalised cross-validation: white noise leaves an arc, a smooth motion stays.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from policy.chunk import ActionChunk
from policy.geometry.rotations import matrix_to_rotvec
from policy.geometry.se3 import make_transform
from wholebody.reference import HandLimits, MotionLimits

SCATTER_SHARE = 0.5
"""Share of a chunk's steps at which the jerk must turn round; measured: 0.8 of white noise, 0.1 of a glitch or a
jump."""
JERK_SHARE = 0.25
"""Share of the jerk limit below which scatter does not matter; derived: for a hand 0.1 mm at 50 Hz, 0.5 mm at 30 Hz."""
SPREAD_MIN = 0.3
"""Least second singular value of a mean of rotations [no unit]; measured: scatter of 0.5 rad leaves 0.8, one from all
there are 0.2."""
DIFFERENCE_ORDER = 3
"""Order of the differences that are penalised: jerk. Penalising acceleration would flatten what moves."""
PENALTIES = 10.0 ** np.linspace(-2.0, 9.0, 45)
"""Penalties that are tried on them [no unit]; chosen: from next to nothing to an arc, for any number of steps."""
CAUTION = 1.4
"""Weight of the degrees of freedom; with 1 it takes noise for motion every so often.

Source: Kim and Gu 2004, "Smoothing spline Gaussian regression: more scalable computation via efficient approximation".
"""


def smoothed_chunk(chunk: ActionChunk, limits: Sequence[HandLimits]) -> tuple[ActionChunk, tuple[str, ...]]:
    """The chunk without the noise of the parts that scatter, and the names of those parts.

    Args:
        chunk: A valid chunk.
        limits: Of the left and of the right hand.

    Returns:
        The chunk itself and no names if nothing scatters.
    """
    changes = {}
    for side, limit in zip(("l", "r"), limits, strict=True):
        name, fingers = f"T_world_{side}hand", f"q_{side}hand"
        T, q = getattr(chunk, name), getattr(chunk, fingers)
        smoothed = _poses(T, chunk.fps, limit)
        if smoothed is not T:
            changes[name] = smoothed
        if _scatters(np.diff(q, axis=0), chunk.fps, limit.finger):
            changes[fingers] = smooth(limit.within(q))
    return (dataclasses.replace(chunk, **changes) if changes else chunk), tuple(changes)


def _poses(T: np.ndarray, fps: float, limits: HandLimits) -> np.ndarray:
    """Poses (H, 4, 4), smooth where they scatter; the same array where they do not."""
    p, R = T[:, :3, 3], T[:, :3, :3]
    moved = _scatters(np.diff(p, axis=0), fps, limits.position)
    turned = _scatters(matrix_to_rotvec(R[1:] @ np.swapaxes(R[:-1], 1, 2)), fps, limits.orientation)
    if not (moved or turned):
        return T
    return make_transform(_smooth_rotations(R) if turned else R, smooth(p) if moved else p)


def smooth(values: np.ndarray) -> np.ndarray:
    """The curve through scattered values by penalised least squares.

    Args:
        values: One row a step, shape (H, ...), H more than `DIFFERENCE_ORDER`; all columns get the same stiffness.

    Source:
        Eilers 2003, "A perfect smoother" (the penalty); Craven and Wahba 1979, "Smoothing noisy data with spline
        functions" (its size).
    """
    roughness, U = _basis(len(values))
    parts = U.T @ values.reshape(len(values), -1)
    kept = 1.0 / (1.0 + PENALTIES[:, None] * roughness)
    left_out = ((1.0 - kept) ** 2) @ (parts**2).sum(axis=1)
    freedom = 1.0 - CAUTION * kept.mean(axis=1)
    gcv = np.where(freedom > 0.0, left_out / np.maximum(freedom, 1e-9) ** 2, np.inf)
    return (U @ (kept[gcv.argmin()][:, None] * parts)).reshape(values.shape)


@lru_cache(maxsize=8)
def _basis(steps: int) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues (H,) and eigenvectors (H, H) of the penalty."""
    D = np.diff(np.eye(steps), DIFFERENCE_ORDER, axis=0)
    roughness, U = np.linalg.eigh(D.T @ D)
    return np.maximum(roughness, 0.0), U


def _scatters(steps: np.ndarray, fps: float, limits: MotionLimits) -> bool:
    """Whether the jerk of a motion with these differences between steps, shape (H - 1, n), turns round all the time."""
    jerk = np.diff(steps, DIFFERENCE_ORDER - 1, axis=0) * fps**DIFFERENCE_ORDER
    if len(jerk) < DIFFERENCE_ORDER:
        return False
    size = np.linalg.norm(jerk, axis=1)
    back = np.einsum("ki,ki->k", jerk[1:], jerk[:-1]) < 0.0
    matters = np.maximum(size[1:], size[:-1]) > JERK_SHARE * limits.jerk
    return bool((back & matters).mean() > SCATTER_SHARE)


def _smooth_rotations(R: np.ndarray) -> np.ndarray:
    """The rotations nearest to the smoothed matrices; the last good one where the scatter leaves no direction."""
    U, s, Vt = np.linalg.svd(smooth(R))
    U[..., :, 2] *= np.linalg.det(U @ Vt)[..., None]
    mean, good = U @ Vt, s[..., 1] > SPREAD_MIN
    last = np.maximum.accumulate(np.where(good, np.arange(len(R)), -1))
    first = int(np.argmax(good)) if good.any() else None
    if first is None:
        return np.broadcast_to(R[0], R.shape).copy()
    return mean[np.where(last < 0, first, last)]
