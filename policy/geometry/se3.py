"""Rigid transforms as plain 4x4 arrays, vectorised over leading axes."""

from __future__ import annotations

import numpy as np

from policy.geometry.rotations import matrix_to_rotvec, rotvec_to_matrix


def make_transform(R: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Transforms ``(..., 4, 4)`` from rotations ``(..., 3, 3)`` and positions ``(..., 3)`` [m], broadcast."""
    R, p = np.asarray(R, dtype=float), np.asarray(p, dtype=float)
    shape = np.broadcast_shapes(R.shape[:-2], p.shape[:-1])
    T = np.zeros((*shape, 4, 4))
    T[..., :3, :3] = R
    T[..., :3, 3] = p
    T[..., 3, 3] = 1.0
    return T


def inverse(T: np.ndarray) -> np.ndarray:
    """Inverse of rigid transforms ``(..., 4, 4)``."""
    R_inverse = np.swapaxes(T[..., :3, :3], -1, -2)
    return make_transform(R_inverse, -(R_inverse @ T[..., :3, 3:])[..., 0])


def translated(T: np.ndarray, offset: np.ndarray) -> np.ndarray:
    """``T * Translation(offset)``: the same axes, with the origin moved by an offset (3,) [m] in them."""
    return make_transform(T[..., :3, :3], T[..., :3, 3] + T[..., :3, :3] @ np.asarray(offset, dtype=float))


def yaw_frame(T: np.ndarray) -> np.ndarray:
    """The upright frame with the origin and the heading of ``T`` (4, 4).

    The heading is that of the x axis; for a frame pitched by exactly 90 degrees it is undefined and 0 is returned.
    """
    yaw = np.arctan2(T[1, 0], T[0, 0])
    return make_transform(rotvec_to_matrix(np.array([0.0, 0.0, yaw])), T[:3, 3])


def interpolate(T: np.ndarray, times: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Poses at other times: straight in position, geodesic in rotation; held before the first and after the last.

    Args:
        T: Poses, shape ``(n, 4, 4)``.
        times: Their times, shape ``(n,)``, increasing, [s].
        at: Wanted times, shape ``(m,)``, [s].

    Returns:
        Shape ``(m, 4, 4)``; exact at the given times.
    """
    T, at = np.asarray(T, dtype=float), np.asarray(at, dtype=float)
    if len(T) == 1:
        return np.repeat(T, len(at), axis=0)
    low, share = bracket(times, at)
    R_low, R_high = T[low, :3, :3], T[low + 1, :3, :3]
    turn = matrix_to_rotvec(np.swapaxes(R_low, -1, -2) @ R_high)
    R = R_low @ rotvec_to_matrix(share[:, None] * turn)
    p = T[low, :3, 3] + share[:, None] * (T[low + 1, :3, 3] - T[low, :3, 3])
    return make_transform(R, p)


def bracket(times: np.ndarray, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Interval and share within it, clipped to the ends, for interpolation.

    Args:
        times: Knots, shape ``(n,)``, n >= 2, increasing, [s].
        at: Wanted times, shape ``(m,)``, [s].

    Returns:
        Index of the knot before, shape ``(m,)`` in [0, n - 2], and share of the interval in [0, 1].
    """
    times = np.asarray(times, dtype=float)
    low = np.clip(np.searchsorted(times, at, side="right") - 1, 0, len(times) - 2)
    share = (at - times[low]) / (times[low + 1] - times[low])
    return low, np.clip(share, 0.0, 1.0)
