"""Where the bodies of the robot are: one pass from the base to the fingers.

Body 0 is the base; body i > 0 hangs on joint i, whose velocity is entry ``5 + i`` of ``v`` and whose angle is entry
``6 + i`` of ``q``; parents come before their children. Places are from the origin of the base, in world axes, and a
column of ``S`` (nv, 6) is the twist about that point of a unit speed.
"""

from __future__ import annotations

import math

import numpy as np

from wholebody.jit.arrays import Indices, Matrix, Vector
from wholebody.robot.kernels.rotation import base_rotation, rotate

# Columns of the body table, one row a body; `wholebody.robot.body_table` fills it.
PLACEMENT_R, PLACEMENT_P, AXIS, MASS, LEVER, INERTIA = 0, 9, 12, 15, 16, 19
"""Joint placement in the parent, joint axis, mass, centre of mass and inertia (xx xy xz yy yz zz) about it."""
BODY = 25
"""Number of columns."""


def place_base(q: Vector, R: Matrix, p: Vector, S: Matrix) -> None:
    """Rotation (3, 3), place (3,) and the six columns of the base; its velocity is given in its own axes."""
    base_rotation(q, R)
    for a in range(3):
        p[a] = 0.0
        for k in range(3):
            S[k, a], S[k, 3 + a] = R[a, k], 0.0
            S[3 + k, a], S[3 + k, 3 + a] = 0.0, R[a, k]


def place_body(row: Vector, angle: float, R_parent: Matrix, p_parent: Vector, R: Matrix, p: Vector) -> None:
    """``R = R_parent R_joint exp(axis angle)`` (3, 3) and ``p = p_parent + R_parent p_joint`` (3,) of one body."""
    c, s = math.cos(angle), math.sin(angle)
    x, y, z = row[AXIS], row[AXIS + 1], row[AXIS + 2]
    t = 1.0 - c
    e00, e01, e02 = t * x * x + c, t * x * y - s * z, t * x * z + s * y
    e10, e11, e12 = t * x * y + s * z, t * y * y + c, t * y * z - s * x
    e20, e21, e22 = t * x * z - s * y, t * y * z + s * x, t * z * z + c
    for a in range(3):
        r0, r1, r2 = R_parent[a, 0], R_parent[a, 1], R_parent[a, 2]
        m0 = r0 * row[0] + r1 * row[3] + r2 * row[6]
        m1 = r0 * row[1] + r1 * row[4] + r2 * row[7]
        m2 = r0 * row[2] + r1 * row[5] + r2 * row[8]
        R[a, 0] = m0 * e00 + m1 * e10 + m2 * e20
        R[a, 1] = m0 * e01 + m1 * e11 + m2 * e21
        R[a, 2] = m0 * e02 + m1 * e12 + m2 * e22
        p[a] = p_parent[a] + r0 * row[PLACEMENT_P] + r1 * row[PLACEMENT_P + 1] + r2 * row[PLACEMENT_P + 2]


def joint_column(row: Vector, R: Matrix, p: Vector, s: Vector) -> None:
    """Column (6,) of the joint of a body at ``R`` (3, 3), ``p`` (3,)."""
    for a in range(3):
        s[3 + a] = rotate(R, a, row[AXIS], row[AXIS + 1], row[AXIS + 2])
    s[0] = p[1] * s[5] - p[2] * s[4]
    s[1] = p[2] * s[3] - p[0] * s[5]
    s[2] = p[0] * s[4] - p[1] * s[3]


def place_bodies(
    q: Vector, table: Matrix, parent: Indices, first: int, last: int, R: np.ndarray, p: Matrix, S: Matrix
) -> None:
    """Places of bodies ``first`` to ``last - 1``, and the columns of their joints.

    Args:
        q: Configuration (7 + n,).
        table: Body table (1 + n, BODY).
        parent: Parent bodies (1 + n,).
        first: At least 1; the bodies before it are placed.
        last: See first.
        R: In and out, rotations (1 + n, 3, 3).
        p: In and out, origins (1 + n, 3).
        S: Out, columns (6 + n, 6).
    """
    for i in range(first, last):
        k = parent[i]
        place_body(table[i], q[6 + i], R[k], p[k], R[i], p[i])
        joint_column(table[i], R[i], p[i], S[5 + i])


def base_twist(v: Vector, R: Matrix, V: Vector) -> None:
    """Twist (6,) of the base, in world axes, from the first six entries of ``v``, which are in its own axes."""
    for a in range(3):
        V[a] = rotate(R, a, v[0], v[1], v[2])
        V[3 + a] = rotate(R, a, v[3], v[4], v[5])
