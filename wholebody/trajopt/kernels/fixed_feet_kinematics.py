r"""Kinematics of one knot with both feet put back in place.

Conventions are those of `wholebody.robot.kernels.bodies`. The first `LOWER` velocities are those of base and legs, the
others move waist and arms; after the bodies of the plan come the fingers, which only count for distances.

The feet leave `FREE_LOWER` directions to base and legs. ``free`` (FREE_LOWER, LOWER) holds them as orthonormal rows, a
basis of the nullspace of both feet's Jacobian; the free directions of a knot are those and the upper joints themselves.
"""

from __future__ import annotations

import math

import numpy as np

from wholebody.jit.arrays import Matrix, Vector
from wholebody.robot.kernels.bodies import place_base, place_bodies
from wholebody.robot.kernels.frames import SOLE_FRAME, place_frame
from wholebody.robot.kernels.rotation import rotation_between
from wholebody.robot.kernels.spatial import velocity_at
from wholebody.trajopt.arrays import Tables
from wholebody.trajopt.layout import FREE_LOWER, LOWER
from wholebody.trajopt.workspace import KnotScratch

FEET_TOLERANCE, FEET_STEPS = 1e-6, 6
"""How near the feet are put back to their place [m, rad], chosen far below what contact notices, and the most Newton
steps for it; they converge quadratically from the few centimetres that a step of the optimiser moves a foot."""


def frame_rows(S: Matrix, carries: np.ndarray, x: Vector, rows: Matrix) -> None:
    """Jacobian (6, n) of a frame at x, world axes; ``carries`` (n,) are the velocities that move it."""
    for j in range(S.shape[0]):
        if carries[j]:
            s = S[j]
            rows[0, j], rows[1, j], rows[2, j] = velocity_at(s, x)
            rows[3, j], rows[4, j], rows[5, j] = s[3], s[4], s[5]
        else:
            for a in range(6):
                rows[a, j] = 0.0


def feet_step_and_nullspace(W: Matrix, error: Vector, V: Matrix, X: Matrix, diagonal: Vector, sums: Vector) -> None:
    """Least-norm step that corrects an error of the feet, and a basis of the directions that leave them in place.

    Householder reflections ``V`` make the columns of ``W`` upper triangular; dependent ones get no step. All columns
    are reflected at once: those loops have a fixed length and become vector instructions.

    Args:
        W: Transposed Jacobian of the feet (LOWER, 12), overwritten.
        error: To be corrected (12,).
        V: Out, reflections (12, LOWER).
        X: Out, the step, then the directions, as columns (LOWER, 8).
        diagonal: Scratch (12,).
        sums: Scratch (12,).
    """
    n, m = W.shape
    for k in range(m):
        size = 0.0
        for j in range(k, n):
            size += W[j, k] * W[j, k]
        size = math.sqrt(size)
        length = size * (size + abs(W[k, k]))
        scale = 1.0 / math.sqrt(length) if length > 1e-24 else 0.0
        diagonal[k] = -size if W[k, k] > 0.0 else size
        for j in range(n):
            V[k, j] = scale * W[j, k] if j > k else 0.0
        V[k, k] = scale * (W[k, k] - diagonal[k])
        reflect_feet(V[k], k, W, sums)
    for j in range(n):
        for c in range(8):
            X[j, c] = 1.0 if c > 0 and j == m + c - 1 else 0.0
    for k in range(m):
        d = error[k]
        for i in range(k):
            d -= W[i, k] * X[i, 0]
        X[k, 0] = d / diagonal[k] if abs(diagonal[k]) > 1e-9 else 0.0
    for k in range(m - 1, -1, -1):
        reflect_free(V[k], k, X, sums)


def reflect_feet(v: Vector, first: int, W: Matrix, sums: Vector) -> None:
    """``W -= v (v' W)`` in place, twelve columns; v is zero before ``first``."""
    for c in range(12):
        sums[c] = 0.0
    for j in range(first, v.shape[0]):
        row, a = W[j], v[j]
        for c in range(12):
            sums[c] += a * row[c]
    for j in range(first, v.shape[0]):
        row, a = W[j], v[j]
        for c in range(12):
            row[c] -= a * sums[c]


def reflect_free(v: Vector, first: int, X: Matrix, sums: Vector) -> None:
    """Reflection ``X -= v (v' X)`` of eight columns, rows from ``first`` on; ``sums`` (8,) is scratch."""
    for c in range(8):
        sums[c] = 0.0
    for j in range(first, v.shape[0]):
        row, a = X[j], v[j]
        for c in range(8):
            sums[c] += a * row[c]
    for j in range(first, v.shape[0]):
        row, a = X[j], v[j]
        for c in range(8):
            row[c] -= a * sums[c]


def integrate_base(q: Vector, u: Vector, w: Vector) -> None:
    """Move the base of q (nq,) by the twist ``[u; w]`` in its own axes, as Pinocchio's ``integrate``."""
    angle = math.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
    square = angle * angle
    if angle < 1e-4:
        a, b, half = 0.5 - square / 24.0, 1.0 / 6.0 - square / 120.0, 0.5 - square / 48.0
    else:
        a, b = (1.0 - math.cos(angle)) / square, (angle - math.sin(angle)) / (square * angle)
        half = math.sin(0.5 * angle) / angle
    c0, c1, c2 = w[1] * u[2] - w[2] * u[1], w[2] * u[0] - w[0] * u[2], w[0] * u[1] - w[1] * u[0]
    x = u[0] + a * c0 + b * (w[1] * c2 - w[2] * c1)
    y = u[1] + a * c1 + b * (w[2] * c0 - w[0] * c2)
    z = u[2] + a * c2 + b * (w[0] * c1 - w[1] * c0)
    i, j, k, s = q[3], q[4], q[5], q[6]
    t0, t1, t2 = 2.0 * (j * z - k * y), 2.0 * (k * x - i * z), 2.0 * (i * y - j * x)
    q[0] += x + s * t0 + j * t2 - k * t1
    q[1] += y + s * t1 + k * t0 - i * t2
    q[2] += z + s * t2 + i * t1 - j * t0
    e0, e1, e2, e3 = half * w[0], half * w[1], half * w[2], math.cos(0.5 * angle)
    q[3], q[4] = s * e0 + i * e3 + j * e2 - k * e1, s * e1 + j * e3 + k * e0 - i * e2
    q[5], q[6] = s * e2 + k * e3 + i * e1 - j * e0, s * e3 - i * e0 - j * e1 - k * e2
    size = math.sqrt(q[3] * q[3] + q[4] * q[4] + q[5] * q[5] + q[6] * q[6])
    for c in range(3, 7):
        q[c] /= size


def integrate(q: Vector, lower: Vector) -> None:
    """Move base and legs of a configuration by ``lower`` (LOWER,), in place."""
    integrate_base(q, lower[:3], lower[3:6])
    for j in range(6, LOWER):
        q[1 + j] += lower[j]


def restore_feet(
    q: Vector, robot: Tables, R: np.ndarray, p: Matrix, S: Matrix, free: Matrix, work: KnotScratch
) -> None:
    """Put the feet back, moving base and legs as little as possible; fills the kinematics and ``free`` there.

    Args:
        q: In and out, configuration (36,).
        robot: `arrays.Tables`.
        R: Out, rotations of the bodies (bodies, 3, 3).
        p: Out, their origins from the base (bodies, 3).
        S: Out, columns (35, 6).
        free: Out (FREE_LOWER, LOWER).
        work: `workspace.KnotScratch`.
    """
    W, error, X = work.feet, work.error, work.step
    for turn in range(FEET_STEPS):
        place_base(q, R[0], p[0], S)
        place_bodies(q, robot.bodies, robot.parent, 1, LOWER - 5, R, p, S)
        worst = 0.0
        for f in range(2):
            body = robot.frame_body[SOLE_FRAME + f]
            place_frame(R[body], p[body], robot.frame_R[SOLE_FRAME + f], robot.frame_p[SOLE_FRAME + f], work.R, work.p)
            foot_columns(S, robot.carries[SOLE_FRAME + f], work.p, 6 * f, W)
            rotation_between(robot.R_feet[f], work.R, error[6 * f + 3 : 6 * f + 6])
            for a in range(3):
                error[6 * f + a] = robot.p_feet[f, a] - q[a] - work.p[a]
        for i in range(12):
            worst = max(worst, abs(error[i]))
        feet_step_and_nullspace(W, error, work.reflections, X, work.diagonal, work.sums)
        if worst < FEET_TOLERANCE or turn == FEET_STEPS - 1:
            break
        for j in range(LOWER):
            work.lower_step[j] = X[j, 0]
        integrate(q, work.lower_step)
    for r in range(FREE_LOWER):
        for j in range(LOWER):
            free[r, j] = X[j, 1 + r]
    place_bodies(q, robot.bodies, robot.parent, LOWER - 5, S.shape[0] - 5, R, p, S)


def foot_columns(S: Matrix, carries: np.ndarray, x: Vector, at: int, W: Matrix) -> None:
    """Transposed Jacobian of a sole at x, world axes, in the columns of ``W`` (LOWER, 12) from ``at`` on."""
    for j in range(LOWER):
        s, row = S[j], W[j]
        on = 1.0 if carries[j] else 0.0
        vx, vy, vz = velocity_at(s, x)
        row[at], row[at + 1], row[at + 2] = on * vx, on * vy, on * vz
        row[at + 3], row[at + 4], row[at + 5] = on * s[3], on * s[4], on * s[5]
