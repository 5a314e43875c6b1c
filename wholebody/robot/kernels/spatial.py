r"""Spatial vectors and inertias about one common point, the origin of the base, in world axes.

Twists and accelerations are ``[linear; angular]``, forces ``[force; moment]``, each (6,). A spatial inertia is its ten
numbers: mass, mass times centre (3), moments xx xy xz yy yz zz about the common point. With one common point nothing
has to be transformed between bodies: inertias and forces are simply added up.

Source:
    Featherstone 2008, "Rigid Body Dynamics Algorithms", chapters 2, 5 and 6, in ground coordinates.
"""

from __future__ import annotations

from wholebody.jit.arrays import Matrix, Vector
from wholebody.robot.kernels.bodies import INERTIA, LEVER, MASS
from wholebody.robot.kernels.rotation import rotate


def dot6(a: Vector, b: Vector) -> float:
    """Scalar product of a twist (6,) and a force (6,)."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] + a[4] * b[4] + a[5] * b[5]


def cross(a: Vector, b: Vector, out: Vector) -> None:
    """``out = a x b`` of the first three entries; ``out`` may be one of them."""
    out[0], out[1], out[2] = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def cross_motion(v: Vector, s: Vector, out: Vector) -> None:
    """``out = v x s`` (6,), the spatial cross product of two twists."""
    a, b, c, x, y, z = v[3], v[4], v[5], v[0], v[1], v[2]
    out[0] = b * s[2] - c * s[1] + y * s[5] - z * s[4]
    out[1] = c * s[0] - a * s[2] + z * s[3] - x * s[5]
    out[2] = a * s[1] - b * s[0] + x * s[4] - y * s[3]
    out[3] = b * s[5] - c * s[4]
    out[4] = c * s[3] - a * s[5]
    out[5] = a * s[4] - b * s[3]


def add_cross_force(v: Vector, f: Vector, out: Vector) -> None:
    """``out += v x* f`` (6,), the spatial cross product of a twist and a force."""
    a, b, c, x, y, z = v[3], v[4], v[5], v[0], v[1], v[2]
    out[0] += b * f[2] - c * f[1]
    out[1] += c * f[0] - a * f[2]
    out[2] += a * f[1] - b * f[0]
    out[3] += y * f[2] - z * f[1] + b * f[5] - c * f[4]
    out[4] += z * f[0] - x * f[2] + c * f[3] - a * f[5]
    out[5] += x * f[1] - y * f[0] + a * f[4] - b * f[3]


def velocity_at(V: Vector, x: Vector) -> tuple[float, float, float]:
    """Linear velocity, as a tuple, of the point at offset ``x`` (3,) of a body with twist ``V``.

    The same sum gives the linear part of a column of a Jacobian at ``x``.
    """
    return V[0] + V[4] * x[2] - V[5] * x[1], V[1] + V[5] * x[0] - V[3] * x[2], V[2] + V[3] * x[1] - V[4] * x[0]


def add_force_at(x: Vector, fx: float, fy: float, fz: float, w: Vector) -> None:
    """Add the wrench about the common point of a force at offset ``x`` (3,) to ``w``."""
    w[0] += fx
    w[1] += fy
    w[2] += fz
    w[3] += x[1] * fz - x[2] * fy
    w[4] += x[2] * fx - x[0] * fz
    w[5] += x[0] * fy - x[1] * fx


def body_inertia(row: Vector, R: Matrix, p: Vector, inertia: Vector) -> None:
    """Spatial inertia (10,) of a body at ``R`` (3, 3), ``p`` (3,); ``row`` is its row of the body table."""
    m = row[MASS]
    x = p[0] + rotate(R, 0, row[LEVER], row[LEVER + 1], row[LEVER + 2])
    y = p[1] + rotate(R, 1, row[LEVER], row[LEVER + 1], row[LEVER + 2])
    z = p[2] + rotate(R, 2, row[LEVER], row[LEVER + 1], row[LEVER + 2])
    xx, xy, xz = row[INERTIA], row[INERTIA + 1], row[INERTIA + 2]
    yy, yz, zz = row[INERTIA + 3], row[INERTIA + 4], row[INERTIA + 5]
    inertia[0], inertia[1], inertia[2], inertia[3] = m, m * x, m * y, m * z
    at = 4
    for a in range(3):
        t0 = R[a, 0] * xx + R[a, 1] * xy + R[a, 2] * xz
        t1 = R[a, 0] * xy + R[a, 1] * yy + R[a, 2] * yz
        t2 = R[a, 0] * xz + R[a, 1] * yz + R[a, 2] * zz
        for b in range(a, 3):
            inertia[at] = t0 * R[b, 0] + t1 * R[b, 1] + t2 * R[b, 2]
            at += 1
    inertia[4] += m * (y * y + z * z)
    inertia[5] -= m * x * y
    inertia[6] -= m * x * z
    inertia[7] += m * (x * x + z * z)
    inertia[8] -= m * y * z
    inertia[9] += m * (x * x + y * y)


def momentum_of(n: Vector, t: Vector, out: Vector) -> None:
    """``out = inertia n (10,) times twist t``."""
    out[0] = n[0] * t[0] + t[4] * n[3] - t[5] * n[2]
    out[1] = n[0] * t[1] + t[5] * n[1] - t[3] * n[3]
    out[2] = n[0] * t[2] + t[3] * n[2] - t[4] * n[1]
    out[3] = n[2] * t[2] - n[3] * t[1] + n[4] * t[3] + n[5] * t[4] + n[6] * t[5]
    out[4] = n[3] * t[0] - n[1] * t[2] + n[5] * t[3] + n[7] * t[4] + n[8] * t[5]
    out[5] = n[1] * t[1] - n[2] * t[0] + n[6] * t[3] + n[8] * t[4] + n[9] * t[5]
