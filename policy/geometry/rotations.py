"""Rotations between the forms that policies speak and 3x3 matrices, vectorised over leading axes.

Conventions, once: ``rot6d`` ``cols`` is the first column followed by the second, ``rows`` the first row followed by
the second (a transpose, that is the inverse rotation), ``interleaved`` the first two columns read row by row (r00 r01
r10 r11 r20 r21: what flattening ``R[:, :2]`` gives); ``rpy`` is roll, pitch, yaw about fixed x, y, z axes, so
``R = Rz(yaw) Ry(pitch) Rx(roll)`` as in URDF; quaternions always name their order.
"""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np

from policy.errors import RotationError

Rot6dLayout = Literal["rows", "cols", "interleaved"]
QuaternionOrder = Literal["xyzw", "wxyz"]

ROT6D_NORM_MIN = 0.1
"""Shortest rot6d vector accepted: below it, its direction is noise."""
ROT6D_SINE_MIN = 0.1
"""Least sine of the angle between both rot6d vectors: below it, they are near-parallel (6 degrees)."""
QUATERNION_TOLERANCE = 1e-3
"""Largest distance of a quaternion's norm from 1 in files and states (float32 and six printed digits pass)."""

_IDENTITY = np.eye(3)


def rot6d_to_matrix(rot6d: np.ndarray, layout: Rot6dLayout) -> np.ndarray:
    """Rotation from two vectors by Gram-Schmidt.

    Args:
        rot6d: Shape ``(..., 6)``.
        layout: ``cols``, ``rows`` or ``interleaved``; there is no default because guessing it wrong is silent.

    Returns:
        Rotation matrices, shape ``(..., 3, 3)``.

    Raises:
        RotationError: If a vector is too short or both are near-parallel.

    Source:
        Zhou et al. 2019, "On the Continuity of Rotation Representations in Neural Networks".
    """
    _check_layout(layout)
    rot6d = _finite(rot6d, 6, "rot6d")
    pair = rot6d_vectors(rot6d, layout)
    norms = _norm(pair)
    if norms.min(initial=np.inf) < ROT6D_NORM_MIN:
        raise _refusal(
            norms.min(axis=-1) < ROT6D_NORM_MIN,
            f"rot6d has a vector of norm {norms.min():.3g}, below {ROT6D_NORM_MIN}: its direction is noise; "
            "unit vectors are expected",
        )
    units = pair / norms[..., None]
    x, y = units[..., 0, :], units[..., 1, :]
    y = y - _dot(x, y)[..., None] * x
    sine = _norm(y)
    if sine.min(initial=np.inf) < ROT6D_SINE_MIN:
        raise _refusal(
            sine < ROT6D_SINE_MIN,
            f"rot6d has two near-parallel vectors (sine {sine.min():.3g} < {ROT6D_SINE_MIN}): "
            "they must be two different axes",
        )
    rows = np.empty((*rot6d.shape[:-1], 3, 3))
    rows[..., 0, :] = x
    rows[..., 1, :] = y / sine[..., None]
    rows[..., 2, :] = _cross(x, rows[..., 1, :])
    return rows if layout == "rows" else np.swapaxes(rows, -1, -2)


def rot6d_vectors(rot6d: np.ndarray, layout: Rot6dLayout) -> np.ndarray:
    """Both vectors of rot6d numbers ``(..., 6)`` in a layout, shape ``(..., 2, 3)``."""
    if layout == "interleaved":
        return np.swapaxes(rot6d.reshape(*rot6d.shape[:-1], 3, 2), -1, -2)
    return rot6d.reshape(*rot6d.shape[:-1], 2, 3)


def matrix_to_rot6d(R: np.ndarray, layout: Rot6dLayout) -> np.ndarray:
    """First two columns or rows of rotation matrices ``(..., 3, 3)``, shape ``(..., 6)``."""
    _check_layout(layout)
    R = np.asarray(R, dtype=float)
    if layout == "interleaved":
        return R[..., :, :2].reshape(*R.shape[:-2], 6)
    pair = R[..., :2, :] if layout == "rows" else np.swapaxes(R, -1, -2)[..., :2, :]
    return pair.reshape(*R.shape[:-2], 6)


def quaternion_to_matrix(
    quat: np.ndarray, order: QuaternionOrder, *, tolerance: float = QUATERNION_TOLERANCE
) -> np.ndarray:
    """Rotation matrices from unit quaternions.

    Args:
        quat: Shape ``(..., 4)``.
        order: ``xyzw`` or ``wxyz``.
        tolerance: Largest distance of the norm from 1; within it the quaternion is normalised.

    Returns:
        Shape ``(..., 3, 3)``.

    Raises:
        RotationError: If a norm is too far from 1.
    """
    _check_order(order)
    quat = _finite(quat, 4, "quaternion")
    norm = _length(quat)
    bad = np.abs(norm[..., 0] - 1.0) > tolerance
    if bad.any():
        raise _refusal(
            bad,
            f"quaternion has norm {norm.flat[int(np.argmax(bad))]:.4g}, not 1 within {tolerance}; "
            f"a unit quaternion in the order {order} is expected",
        )
    quat = quat / norm
    x, y, z, w = (quat[..., i] for i in ((0, 1, 2, 3) if order == "xyzw" else (1, 2, 3, 0)))
    xx, xy, xz, yy, yz, zz, xw, yw, zw = x * x, x * y, x * z, y * y, y * z, z * z, x * w, y * w, z * w
    R = np.empty((*x.shape, 3, 3))
    R[..., 0, 0], R[..., 0, 1], R[..., 0, 2] = 1 - 2 * (yy + zz), 2 * (xy - zw), 2 * (xz + yw)
    R[..., 1, 0], R[..., 1, 1], R[..., 1, 2] = 2 * (xy + zw), 1 - 2 * (xx + zz), 2 * (yz - xw)
    R[..., 2, 0], R[..., 2, 1], R[..., 2, 2] = 2 * (xz - yw), 2 * (yz + xw), 1 - 2 * (xx + yy)
    return R


def matrix_to_quaternion(R: np.ndarray, order: QuaternionOrder) -> np.ndarray:
    """Unit quaternions with ``w >= 0``, shape ``(..., 4)``, from rotation matrices ``(..., 3, 3)``.

    Source:
        Shepperd 1978, "Quaternion from rotation matrix": divides by the largest component, so it is exact near pi.
    """
    _check_order(order)
    R = np.asarray(R, dtype=float)
    xx, yy, zz = R[..., 0, 0], R[..., 1, 1], R[..., 2, 2]
    # The four candidates are the quaternion times 4x, 4y, 4z, 4w.
    candidates = np.empty((*xx.shape, 4, 4))
    for (i, j), pair in {
        (0, 1): R[..., 0, 1] + R[..., 1, 0],
        (0, 2): R[..., 0, 2] + R[..., 2, 0],
        (1, 2): R[..., 1, 2] + R[..., 2, 1],
        (0, 3): R[..., 2, 1] - R[..., 1, 2],
        (1, 3): R[..., 0, 2] - R[..., 2, 0],
        (2, 3): R[..., 1, 0] - R[..., 0, 1],
    }.items():
        candidates[..., i, j] = candidates[..., j, i] = pair
    for i, square in enumerate((1 + xx - yy - zz, 1 - xx + yy - zz, 1 - xx - yy + zz, 1 + xx + yy + zz)):
        candidates[..., i, i] = square
    best = np.argmax(np.einsum("...ii->...i", candidates), axis=-1)
    quat = candidates.reshape(-1, 4, 4)[np.arange(best.size), best.ravel()].reshape(*best.shape, 4)
    quat /= _length(quat)
    quat = np.where(quat[..., 3:] < 0.0, -quat, quat)
    return quat if order == "xyzw" else np.roll(quat, 1, axis=-1)


def rotvec_to_matrix(rotvec: np.ndarray) -> np.ndarray:
    """Exponential map: axis times angle [rad], shape ``(..., 3)``, to matrices ``(..., 3, 3)``."""
    rotvec = _finite(rotvec, 3, "rotation vector")
    half = 0.5 * _length(rotvec)
    # np.sinc(x) = sin(pi x) / (pi x), so this is sin(angle / 2) / angle without a division by zero.
    quat = np.concatenate([0.5 * np.sinc(half / np.pi) * rotvec, np.cos(half)], axis=-1)
    return quaternion_to_matrix(quat, "xyzw")


def matrix_to_rotvec(R: np.ndarray) -> np.ndarray:
    """Logarithm: matrices ``(..., 3, 3)`` to axis times angle, shape ``(..., 3)`` [rad], angle in [0, pi]."""
    quat = matrix_to_quaternion(R, "xyzw")
    vector, w = quat[..., :3], quat[..., 3:]
    sine = _length(vector)
    angle = 2.0 * np.arctan2(sine, w)
    # angle / sine tends to 2 at the identity, where w = 1.
    small = sine < 1e-12
    return np.where(small, 2.0, angle / np.where(small, 1.0, sine)) * vector


def rpy_to_matrix(rpy: np.ndarray) -> np.ndarray:
    """``Rz(yaw) Ry(pitch) Rx(roll)`` from roll, pitch, yaw ``(..., 3)`` [rad]."""
    rpy = _finite(rpy, 3, "rpy")
    (cr, cp, cy), (sr, sp, sy) = np.moveaxis(np.cos(rpy), -1, 0), np.moveaxis(np.sin(rpy), -1, 0)
    rows = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def matrix_to_rpy(R: np.ndarray) -> np.ndarray:
    """Roll, pitch, yaw ``(..., 3)`` [rad]; at pitch ±pi/2, where roll and yaw are one, roll is 0."""
    R = np.asarray(R, dtype=float)
    cos_pitch = np.hypot(R[..., 0, 0], R[..., 1, 0])
    pitch = np.arctan2(-R[..., 2, 0], cos_pitch)
    locked = cos_pitch < 1e-9
    roll = np.where(locked, 0.0, np.arctan2(R[..., 2, 1], R[..., 2, 2]))
    yaw = np.where(locked, np.arctan2(-R[..., 0, 1], R[..., 1, 1]), np.arctan2(R[..., 1, 0], R[..., 0, 0]))
    return np.stack([roll, pitch, yaw], axis=-1)


def rotation_residual(R: np.ndarray) -> np.ndarray:
    """How far matrices ``(..., 3, 3)`` are from rotations, shape ``(...,)``; NaN where not finite, 2 for mirrors.

    The first two rows must be orthonormal and the third one their cross product.
    """
    R = np.asarray(R, dtype=float)
    x, y, z = R[..., 0, :], R[..., 1, :], R[..., 2, :]
    with np.errstate(invalid="ignore"):  # the answer for NaN is NaN
        lengths = np.maximum(np.abs(_dot(x, x) - 1.0), np.abs(_dot(y, y) - 1.0))
        angles = np.maximum(np.abs(_dot(x, y)), np.abs(z - _cross(x, y)).max(axis=-1))
        return np.maximum(lengths, angles)


def nearest_rotation(R: np.ndarray) -> np.ndarray:
    """Rotations next to matrices ``(..., 3, 3)`` that are rotations but for rounding; a residual e becomes about e².

    Source:
        Higham 1986, "Computing the Polar Decomposition", the Newton-Schulz step.
    """
    return R @ (1.5 * _IDENTITY - 0.5 * (np.swapaxes(R, -1, -2) @ R))


def angle_between(R_a: np.ndarray, R_b: np.ndarray) -> np.ndarray:
    """Angle of the rotation from one matrix to another [rad], over leading axes."""
    # Matrices that are an angle apart differ by sqrt(8) sin(angle / 2) in the Frobenius norm.
    chord = np.sqrt(np.square(np.asarray(R_b) - R_a).sum(axis=(-2, -1)))
    return 2.0 * np.arcsin(np.minimum(chord / np.sqrt(8.0), 1.0))


def _check_layout(layout: str) -> None:
    if layout not in get_args(Rot6dLayout):
        raise RotationError(f"unknown rot6d layout {layout!r}; it is 'rows', 'cols' or 'interleaved'")


def _check_order(order: str) -> None:
    if order not in get_args(QuaternionOrder):
        raise RotationError(f"unknown quaternion order {order!r}; it is 'xyzw' or 'wxyz'")


def _finite(values: np.ndarray, width: int, what: str) -> np.ndarray:
    values = np.asarray(values, dtype=float)
    if values.shape[-1:] != (width,):
        raise RotationError(f"{what} has shape {values.shape}; its last axis must be {width}")
    finite = np.isfinite(values)
    if not finite.all():
        raise _refusal(~finite.all(axis=-1), f"{what} is not finite")
    return values


def _refusal(bad: np.ndarray, message: str) -> RotationError:
    return RotationError(message, index=int(np.argmax(bad)))


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.einsum("...i,...i->...", a, b)


def _norm(a: np.ndarray) -> np.ndarray:
    return np.sqrt(_dot(a, a))


def _length(a: np.ndarray) -> np.ndarray:
    """``np.linalg.norm(a, axis=-1, keepdims=True)``, which takes longer to see what it is given than to compute it."""
    return np.sqrt(np.add.reduce(a * a, axis=-1, keepdims=True))


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """``np.cross`` over leading axes, which takes four times as long."""
    out = np.empty_like(a)
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        out[..., i] = a[..., j] * b[..., k] - a[..., k] * b[..., j]
    return out
