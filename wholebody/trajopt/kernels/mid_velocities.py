r"""Velocities between knots with their derivatives, and velocities and accelerations at the knots.

The base twist between two knots is the logarithm of the second base pose seen from the first. With the rotation vector
w, the translation t of that relative pose and ``V(w)^-1 = 1 - [w]x / 2 + b(|w|) [w]x^2`` it is ``[V^-1 t; w]``.

Source:
    Sola, Deray and Atchuthan 2018, "A micro Lie theory for state estimation in robotics", appendix D.
"""

from __future__ import annotations

import math

from wholebody.jit.arrays import Matrix, Vector
from wholebody.robot.kernels.rotation import base_rotation, logarithm
from wholebody.robot.kernels.spatial import cross
from wholebody.trajopt.arrays import KnotTargets
from wholebody.trajopt.kernels.spline import knot_rate
from wholebody.trajopt.layout import FIRST_RATE, FREE_LOWER, LOWER, N_BODY
from wholebody.trajopt.workspace import KnotMotion, KnotScratch

SERIES_ANGLE = 0.3
"""Angle below which the coefficients of the derivatives are taken from their Taylor series [rad]; derived: the closed
forms lose half of their digits at zero, and five terms leave 1e-12 here."""


def mid_velocities(m: KnotMotion, task: KnotTargets, work: KnotScratch) -> None:
    """Velocities between knots, their derivatives, and velocities and accelerations at the knots.

    The first velocity is that at its knot: half a step from the next one. After the last knot the plan rests.
    """
    K, dt = m.q.shape[0], task.dt
    for j in range(N_BODY):
        m.v_mid[0, j], m.v_mid[K, j] = task.v_start[j], 0.0
    for k in range(1, K):
        v_mid, by_prev, by_next = m.v_mid[k], m.dv_dprev[k], m.dv_dnext[k]
        base_difference(m.q[k - 1], m.q[k], v_mid, work)
        rate, given = knot_rate(k, K, dt), (1.0 - FIRST_RATE if k == 1 else 0.0)
        for j in range(6):
            v_mid[j] = rate * v_mid[j] + given * task.v_start[j]
        for j in range(6, N_BODY):
            v_mid[j] = rate * (m.q[k, 1 + j] - m.q[k - 1, 1 + j]) + given * task.v_start[j]
        for r in range(FREE_LOWER):
            for i in range(6):
                prev = following = 0.0
                for j in range(6):
                    prev += work.J_prev[i, j] * m.free[k - 1, r, j]
                    following += work.J_next[i, j] * m.free[k, r, j]
                by_prev[r, i], by_next[r, i] = rate * prev, rate * following
            for j in range(6, LOWER):
                by_prev[r, j], by_next[r, j] = rate * m.free[k - 1, r, j], rate * m.free[k, r, j]
    for k in range(K):
        scale = 2.0 / dt if k == 0 else 1.0 / dt
        for j in range(N_BODY):
            m.v[k, j] = m.v_mid[0, j] if k == 0 else 0.5 * (m.v_mid[k, j] + m.v_mid[k + 1, j])
            m.a[k, j] = (m.v_mid[k + 1, j] - m.v_mid[k, j]) * scale


def base_difference(q_a: Vector, q_b: Vector, twist: Vector, work: KnotScratch) -> None:
    """``twist[:6]`` that leads the base from q_a to q_b in unit time, as Pinocchio's ``difference``.

    ``work.J_next`` (6, 6) is its derivative by the pose of b, ``work.J_prev`` that by the pose of a with the sign
    changed, both by twists in the axes of the base there.
    """
    R_a, R_b, R = work.turns[0], work.turns[1], work.turns[2]
    base_rotation(q_a, R_a)
    base_rotation(q_b, R_b)
    t, w, wt, wwt = work.six[0], work.six[1], work.six[2], work.six[3]
    for i in range(3):
        t[i] = 0.0
        for k in range(3):
            t[i] += R_a[k, i] * (q_b[k] - q_a[k])
            R[i, k] = R_a[0, i] * R_b[0, k] + R_a[1, i] * R_b[1, k] + R_a[2, i] * R_b[2, k]
    logarithm(R, w)
    square = w[0] * w[0] + w[1] * w[1] + w[2] * w[2]
    b, db = coefficients(square)
    cross(w, t, wt)
    cross(w, wt, wwt)
    for i in range(3):
        twist[i], twist[3 + i] = t[i] - 0.5 * wt[i] + b * wwt[i], w[i]
    right_derivative(t, w, wwt, square, b, db, work.turns[3], work.J_next)
    left_derivative(R, t, work.J_next, work.adjoint, work.J_prev)


def coefficients(square: float) -> tuple[float, float]:
    """``b(x) = 1 / x^2 - (1 + cos x) / (2 x sin x)`` and ``b'(x) / x`` for an angle x with this square."""
    if square < SERIES_ANGLE * SERIES_ANGLE:
        b = 1 / 12 + square * (1 / 720 + square * (1 / 30240 + square * (1 / 1209600 + square / 47900160)))
        return b, 1 / 360 + square * (1 / 7560 + square * (1 / 201600 + square / 5987520))
    x = math.sqrt(square)
    b = 1.0 / square - (1.0 + math.cos(x)) / (2.0 * x * math.sin(x))
    return b, -2.0 / (square * square) + (x + math.sin(x)) / (2.0 * square * x * (1.0 - math.cos(x)))


def right_derivative(
    t: Vector, w: Vector, wwt: Vector, square: float, b: float, db: float, by_w: Matrix, J: Matrix
) -> None:
    """``J = [V^-1, Q V^-1; 0, V^-1]`` with ``Q = d(V^-1 t)/dw``, which is left in ``by_w`` (3, 3)."""
    along = w[0] * t[0] + w[1] * t[1] + w[2] * t[2]
    for i in range(3):
        for k in range(3):
            by_w[i, k] = b * (w[i] * t[k] - 2.0 * t[i] * w[k]) + db * wwt[i] * w[k]
            J[3 + i, k] = 0.0
            J[i, k] = b * w[i] * w[k]
        by_w[i, i] += b * along
        J[i, i] += 1.0 - b * square
    add_skew(0.5, t, by_w)
    add_skew(0.5, w, J)
    for i in range(3):
        for k in range(3):
            J[3 + i, 3 + k] = J[i, k]
    for i in range(3):
        for k in range(3):
            J[i, 3 + k] = by_w[i, 0] * J[0, k] + by_w[i, 1] * J[1, k] + by_w[i, 2] * J[2, k]


def left_derivative(R: Matrix, t: Vector, J_right: Matrix, adjoint: Matrix, J: Matrix) -> None:
    """``J = J_right Ad(R, t)^-1``."""
    for i in range(3):
        for k in range(3):
            adjoint[i, k] = adjoint[3 + i, 3 + k] = R[k, i]
            adjoint[3 + i, k] = 0.0
        adjoint[i, 3] = R[2, i] * t[1] - R[1, i] * t[2]
        adjoint[i, 4] = R[0, i] * t[2] - R[2, i] * t[0]
        adjoint[i, 5] = R[1, i] * t[0] - R[0, i] * t[1]
    for i in range(6):
        for k in range(6):
            total = 0.0
            for c in range(6):
                total += J_right[i, c] * adjoint[c, k]
            J[i, k] = total


def add_skew(scale: float, w: Vector, M: Matrix) -> None:
    """``M += scale [w]x``."""
    M[0, 1] -= scale * w[2]
    M[0, 2] += scale * w[1]
    M[1, 0] += scale * w[2]
    M[1, 2] -= scale * w[0]
    M[2, 0] -= scale * w[1]
    M[2, 1] += scale * w[0]
