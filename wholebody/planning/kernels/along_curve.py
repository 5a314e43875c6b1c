"""States of the robot along a cubic B-spline of configurations."""

from __future__ import annotations

import math

import numpy as np

from wholebody.jit.arrays import Matrix, Vector
from wholebody.robot.kernels.rotation import base_rotation


def along_curve(
    start: float, step: float, c: np.ndarray, s: Vector, q: Matrix, v: Matrix, dq: Matrix, ddq: Matrix, R: Matrix
) -> None:
    """Fill configurations with unit quaternions, velocities and derivatives of the curve, at every row.

    The curve is that of `wholebody.reference.cubic.CubicBSpline`, evaluated as it does.

    Args:
        start: Parameter at which the curve begins [s].
        step: Between two knots [s].
        c: Its coefficients (4, N, nq).
        s: Parameters (n,) [s].
        q: Out, configurations (n, nq).
        v: Out, velocities (n, nq - 1).
        dq: Out, first derivative (n, nq).
        ddq: Out, second derivative (n, nq).
        R: Scratch (3, 3).
    """
    for k in range(s.shape[0]):
        x = (s[k] - start) / step
        i = min(max(int(x), 0), c.shape[1] - 1)
        u = x - i
        for j in range(c.shape[2]):
            c0, c1, c2, c3 = c[0, i, j], c[1, i, j], c[2, i, j], c[3, i, j]
            q[k, j] = c0 + u * (c1 + u * (c2 + u * c3))
            dq[k, j] = (c1 + u * (2.0 * c2 + 3.0 * u * c3)) / step
            ddq[k, j] = (2.0 * c2 + 6.0 * u * c3) / step**2
        size = math.sqrt(q[k, 3] ** 2 + q[k, 4] ** 2 + q[k, 5] ** 2 + q[k, 6] ** 2)
        for j in range(3, 7):
            q[k, j] /= size
        base_rotation(q[k], R)
        velocity(q[k], dq[k], size, R, v[k])


def velocity(q: Vector, dq: Vector, size: float, R: Matrix, v: Vector) -> None:
    """Velocity (nv,) at a configuration (nq,) of rotation R (3, 3), whose quaternion was divided by ``size``."""
    for a in range(3):
        v[a] = R[0, a] * dq[0] + R[1, a] * dq[1] + R[2, a] * dq[2]
    x, y, z, w = q[3], q[4], q[5], q[6]
    dx, dy, dz, dw = dq[3] / size, dq[4] / size, dq[5] / size, dq[6] / size
    # The vector part of 2 conj(q) dq: the angular velocity in base axes.
    v[3] = 2.0 * (w * dx - x * dw - y * dz + z * dy)
    v[4] = 2.0 * (w * dy - y * dw - z * dx + x * dz)
    v[5] = 2.0 * (w * dz - z * dw - x * dy + y * dx)
    for j in range(7, q.shape[0]):
        v[j - 1] = dq[j]
