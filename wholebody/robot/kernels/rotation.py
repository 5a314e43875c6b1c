"""Rotations by their nine entries, and their logarithm: the one that all compiled code uses.

`policy.geometry.rotations` has the same vectorised over leading axes; a test holds the two equal.
"""

from __future__ import annotations

import math

from wholebody.jit.arrays import Matrix, Vector


def rotate(R: Matrix, a: int, x: float, y: float, z: float) -> float:
    """Component ``a`` of ``R [x y z]``."""
    return R[a, 0] * x + R[a, 1] * y + R[a, 2] * z


def base_rotation(q: Vector, R: Matrix) -> None:
    """Rotation matrix (3, 3) of the base quaternion ``q[3:7]`` (xyzw), which is normalised on the way."""
    size = math.sqrt(q[3] * q[3] + q[4] * q[4] + q[5] * q[5] + q[6] * q[6])
    x, y, z, w = q[3] / size, q[4] / size, q[5] / size, q[6] / size
    R[0, 0], R[0, 1], R[0, 2] = 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)
    R[1, 0], R[1, 1], R[1, 2] = 2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)
    R[2, 0], R[2, 1], R[2, 2] = 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)


def rotation_vector(
    xx: float, xy: float, xz: float, yx: float, yy: float, yz: float, zx: float, zy: float, zz: float
) -> tuple[float, float, float]:
    """Axis times angle [rad] of the rotation with these entries, row by row; the angle is in [0, pi].

    Source:
        Shepperd 1978, "Quaternion from rotation matrix": divides by the largest component, so it is exact near pi too.
    """
    trace = xx + yy + zz
    if trace >= xx and trace >= yy and trace >= zz:
        x, y, z, w = zy - yz, xz - zx, yx - xy, 1.0 + trace
    elif xx >= yy and xx >= zz:
        x, y, z, w = 1.0 + xx - yy - zz, xy + yx, zx + xz, zy - yz
    elif yy >= zz:
        x, y, z, w = xy + yx, 1.0 - xx + yy - zz, yz + zy, xz - zx
    else:
        x, y, z, w = zx + xz, yz + zy, 1.0 - xx - yy + zz, yx - xy
    if w < 0.0:
        x, y, z, w = -x, -y, -z, -w
    # All four are the quaternion times the same number, which drops out.
    sine = math.sqrt(x * x + y * y + z * z)
    factor = 2.0 / w if sine < 1e-12 * w else 2.0 * math.atan2(sine, w) / sine
    return factor * x, factor * y, factor * z


def logarithm(R: Matrix, w: Vector) -> None:
    """Rotation vector ``w`` (3,) of a rotation ``R`` (3, 3)."""
    w[0], w[1], w[2] = rotation_vector(R[0, 0], R[0, 1], R[0, 2], R[1, 0], R[1, 1], R[1, 2], R[2, 0], R[2, 1], R[2, 2])


def rotation_between(R_to: Matrix, R_from: Matrix, w: Vector) -> None:
    """Rotation vector ``w`` (3,) of ``R_to R_from'``, both (3, 3): the turn in world axes that leads to the first."""
    w[0], w[1], w[2] = rotation_vector(
        dot_rows(R_to, R_from, 0, 0),
        dot_rows(R_to, R_from, 0, 1),
        dot_rows(R_to, R_from, 0, 2),
        dot_rows(R_to, R_from, 1, 0),
        dot_rows(R_to, R_from, 1, 1),
        dot_rows(R_to, R_from, 1, 2),
        dot_rows(R_to, R_from, 2, 0),
        dot_rows(R_to, R_from, 2, 1),
        dot_rows(R_to, R_from, 2, 2),
    )


def dot_rows(A: Matrix, B: Matrix, a: int, b: int) -> float:
    """Scalar product of row ``a`` of A and row ``b`` of B, three entries."""
    return A[a, 0] * B[b, 0] + A[a, 1] * B[b, 1] + A[a, 2] * B[b, 2]
