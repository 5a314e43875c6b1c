r"""Velocities between knots, and inverse dynamics at a knot with its derivatives; compiles with numba as it stands.

Only what the plan asks for is computed: the wrench on the whole robot, torques of waist and arms, and how the soles
would accelerate. All vectors are in world axes about the base, as in `fixed_feet_kinematics`, and derivatives are
taken with that point held still: about one fixed point nothing has to be transformed.

For joint j with axis S, twist V and acceleration A of the body before it (gravity included):
``turning = V x S``, ``swinging = A x S + V x turning``. A subtree with inertia I, momentum (l, k), force f and
``B = [0, -2 l x; 0, D - k x]`` changes its force by ``B turning + I swinging + S x* f`` for the position of the joint
that carries it, and by ``B S + I (turning + dS/dt)`` for its velocity.

Source:
    Singh, Russo and Wensing 2022, "Efficient Analytical Derivatives of Rigid-Body Dynamics using Spatial Vector
    Algebra", RA-L 7(2); Sola, Deray and Atchuthan 2018, "A micro Lie theory for state estimation in robotics".
"""

from __future__ import annotations

import math

from wholebody.jit.blas import times_transposed
from wholebody.planning.trajopt.kernels.configuration_terms import momentum_of
from wholebody.planning.trajopt.kernels.fixed_feet_kinematics import base_rotation
from wholebody.planning.trajopt.kernels.spline import pace
from wholebody.planning.trajopt.layout import (  # fmt: skip
    FIRST,
    FORCE,
    FREE_LOWER,
    LOADED,
    LOWER,
    N_BODY,
    N_FREE,
    N_FRICTION,
    N_MOTION,
    SLIDE,
    TAU,
    TWIST,
    UPPER,
)


def cross(a, b, out, at):
    """``out[at:at + 3] = a x b`` of the first three entries."""
    x, y, z = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
    out[at], out[at + 1], out[at + 2] = x, y, z


def cross_motion(v, s, out):
    """Spatial cross product of two twists."""
    a, b, c, x, y, z = v[3], v[4], v[5], v[0], v[1], v[2]
    out[0] = b * s[2] - c * s[1] + y * s[5] - z * s[4]
    out[1] = c * s[0] - a * s[2] + z * s[3] - x * s[5]
    out[2] = a * s[1] - b * s[0] + x * s[4] - y * s[3]
    out[3] = b * s[5] - c * s[4]
    out[4] = c * s[3] - a * s[5]
    out[5] = a * s[4] - b * s[3]


def add_cross_force(v, f, out):
    """Add the spatial cross product of a twist and a force."""
    a, b, c, x, y, z = v[3], v[4], v[5], v[0], v[1], v[2]
    out[0] += b * f[2] - c * f[1]
    out[1] += c * f[0] - a * f[2]
    out[2] += a * f[1] - b * f[0]
    out[3] += y * f[2] - z * f[1] + b * f[5] - c * f[4]
    out[4] += z * f[0] - x * f[2] + c * f[3] - a * f[5]
    out[5] += x * f[1] - y * f[0] + a * f[4] - b * f[3]


def dot6(a, b):
    """Scalar product of a twist and a force."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] + a[4] * b[4] + a[5] * b[5]


def logarithm(q_a, q_b, half, right, left, work):
    """``half[:6]`` = base twist that leads from q_a to q_b in unit time, as Pinocchio's ``difference``.

    ``right`` (6, 6) is its derivative by the place of b, ``left`` that by the place of a with the sign changed.
    """
    R_a, R_b, R, by_w = work.turns[0], work.turns[1], work.turns[2], work.turns[3]
    base_rotation(q_a, R_a)
    base_rotation(q_b, R_b)
    t, w, c, d = work.six[0], work.six[1], work.six[2], work.six[3]
    for i in range(3):
        t[i] = 0.0
        for k in range(3):
            t[i] += R_a[k, i] * (q_b[k] - q_a[k])
            R[i, k] = R_a[0, i] * R_b[0, k] + R_a[1, i] * R_b[1, k] + R_a[2, i] * R_b[2, k]
    w[0], w[1], w[2] = R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]
    s = 0.5 * math.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
    angle = math.atan2(s, 0.5 * (R[0, 0] + R[1, 1] + R[2, 2] - 1.0))
    scale = 0.5 * angle / s if s > 1e-9 else 0.5
    for i in range(3):
        w[i] *= scale
    x = angle * angle
    if angle < 0.3:
        b = 1 / 12 + x * (1 / 720 + x * (1 / 30240 + x * (1 / 1209600 + x / 47900160)))
        rate = 1 / 360 + x * (1 / 7560 + x * (1 / 201600 + x / 5987520))
    else:
        b = 1.0 / x - (1.0 + math.cos(angle)) / (2.0 * angle * math.sin(angle))
        rate = -2.0 / (x * x) + (angle + math.sin(angle)) / (2.0 * x * angle * (1.0 - math.cos(angle)))
    cross(w, t, c, 0)
    cross(w, c, d, 0)
    along = w[0] * t[0] + w[1] * t[1] + w[2] * t[2]
    for i in range(3):
        half[i], half[3 + i] = t[i] - 0.5 * c[i] + b * d[i], w[i]
    for i in range(3):
        for k in range(3):
            by_w[i, k] = b * (w[i] * t[k] - 2.0 * t[i] * w[k]) + rate * d[i] * w[k]
            right[3 + i, k] = 0.0
            right[i, k] = b * w[i] * w[k]
        by_w[i, i] += b * along
        right[i, i] += 1.0 - b * x
    add_skew(0.5, t, by_w)
    add_skew(0.5, w, right)
    for i in range(3):
        for k in range(3):
            right[3 + i, 3 + k] = right[i, k]
    for i in range(3):
        for k in range(3):
            right[i, 3 + k] = by_w[i, 0] * right[0, k] + by_w[i, 1] * right[1, k] + by_w[i, 2] * right[2, k]
    back = work.back
    for i in range(3):
        for k in range(3):
            back[i, k] = back[3 + i, 3 + k] = R[k, i]
            back[3 + i, k] = 0.0
        # - R' [t]x, t being the place of b seen from a.
        back[i, 3] = R[2, i] * t[1] - R[1, i] * t[2]
        back[i, 4] = R[0, i] * t[2] - R[2, i] * t[0]
        back[i, 5] = R[1, i] * t[0] - R[0, i] * t[1]
    for i in range(6):
        for k in range(6):
            total = 0.0
            for c_ in range(6):
                total += right[i, c_] * back[c_, k]
            left[i, k] = total


def add_skew(scale, w, M):
    """``M += scale [w]x``."""
    M[0, 1] -= scale * w[2]
    M[0, 2] += scale * w[1]
    M[1, 0] += scale * w[2]
    M[1, 2] -= scale * w[0]
    M[2, 0] -= scale * w[1]
    M[2, 1] += scale * w[0]


def half_steps(m, task, work):
    """Velocities between knots, their derivatives, and velocities and accelerations at the knots.

    The first velocity is that at its knot: half a step from the next one. After the last knot the plan rests.
    """
    K, dt = m.q.shape[0], task.dt
    right, left = work.turn_right, work.turn_left
    for j in range(N_BODY):
        m.half[0, j], m.half[K, j] = task.v_start[j], 0.0
    for k in range(1, K):
        half, before, after = m.half[k], m.behind[k], m.ahead[k]
        logarithm(m.q[k - 1], m.q[k], half, right, left, work)
        per, given = pace(k, K, dt), (1.0 - FIRST if k == 1 else 0.0)
        for j in range(6):
            half[j] = per * half[j] + given * task.v_start[j]
        for j in range(6, N_BODY):
            half[j] = per * (m.q[k, 1 + j] - m.q[k - 1, 1 + j]) + given * task.v_start[j]
        for r in range(FREE_LOWER):
            for i in range(6):
                back = forth = 0.0
                for j in range(6):
                    back += left[i, j] * m.free[k - 1, r, j]
                    forth += right[i, j] * m.free[k, r, j]
                before[r, i], after[r, i] = per * back, per * forth
            for j in range(6, LOWER):
                before[r, j], after[r, j] = per * m.free[k - 1, r, j], per * m.free[k, r, j]
    for k in range(K):
        scale = 2.0 / dt if k == 0 else 1.0 / dt
        for j in range(N_BODY):
            m.v[k, j] = m.half[0, j] if k == 0 else 0.5 * (m.half[k, j] + m.half[k + 1, j])
            m.a[k, j] = (m.half[k + 1, j] - m.half[k, j]) * scale


def move_bodies(k, robot, m, work):
    """Twists and accelerations of the bodies, forces on them and on what they carry, and how axes move."""
    S, v, a, V, A, kept, f, h = m.S[k], m.v[k], m.a[k], work.V, work.A, work.A_kept, work.f, work.h
    n = V.shape[0]
    for i in range(6):
        V[0, i] = A[0, i] = 0.0
        for j in range(6):
            V[0, i] += S[j, i] * v[j]
            A[0, i] += S[j, i] * a[j]
    cross(V[0], V[0, 3:], kept[0], 0)  # the pelvis keeps its velocity in world, not in its own axes
    for i in range(3):
        kept[0, 3 + i] = 0.0
        A[0, i] -= robot.gravity[i]
        work.six[0, i], work.six[0, 3 + i] = -robot.gravity[i], 0.0
    for j in range(6):
        cross_motion(work.six[0], S[j], work.swinging[j])
        for i in range(6):
            work.turning[j, i] = 0.0
    for i in range(n):
        if i > 0:
            before, j = robot.parent[i], 5 + i
            s, turn, swing = S[j], work.turning[j], work.swinging[j]
            cross_motion(V[before], s, turn)
            cross_motion(A[before], s, swing)
            cross_motion(V[before], turn, work.six[0])
            for c in range(6):
                swing[c] += work.six[0, c]
                V[i, c] = V[before, c] + v[j] * s[c]
                A[i, c] = A[before, c] + a[j] * s[c] + v[j] * turn[c]
                kept[i, c] = kept[before, c] + v[j] * turn[c]
        momentum_of(m.inertia[k, i], V[i], h[i])
        momentum_of(m.inertia[k, i], A[i], f[i])
        add_cross_force(V[i], h[i], f[i])
        turning_inertia(m.inertia[k, i], V[i], work.D[i])
    for i in range(n - 1, 0, -1):
        before = robot.parent[i]
        for c in range(6):
            f[before, c] += f[i, c]
            h[before, c] += h[i, c]
            work.D[before, c] += work.D[i, c]


def turning_inertia(n, V, D):
    """The symmetric part D (xx xy xz yy yz zz) of a body's B."""
    x, y, z, a, b, c = V[0], V[1], V[2], V[3], V[4], V[5]
    mx, my, mz = n[1], n[2], n[3]
    twice = 2.0 * (mx * x + my * y + mz * z)
    D[0] = twice - 2.0 * mx * x + 2.0 * (b * n[6] - c * n[5])
    D[3] = twice - 2.0 * my * y + 2.0 * (c * n[5] - a * n[8])
    D[5] = twice - 2.0 * mz * z + 2.0 * (a * n[8] - b * n[6])
    D[1] = -(mx * y + my * x) + (b * n[8] - c * n[7]) + (c * n[4] - a * n[6])
    D[2] = -(mx * z + mz * x) + (b * n[9] - c * n[8]) + (a * n[5] - b * n[4])
    D[4] = -(my * z + mz * y) + (c * n[6] - a * n[9]) + (a * n[7] - b * n[5])


def times_D(D, x, y, z, out, at):
    """``out[at:at + 3] += D [x y z]``."""
    out[at] += D[0] * x + D[1] * y + D[2] * z
    out[at + 1] += D[1] * x + D[3] * y + D[4] * z
    out[at + 2] += D[2] * x + D[4] * y + D[5] * z


def add_B(h, D, t, out):
    """Add ``B t`` to a force."""
    a, b, c = t[3], t[4], t[5]
    out[0] -= 2.0 * (h[1] * c - h[2] * b)
    out[1] -= 2.0 * (h[2] * a - h[0] * c)
    out[2] -= 2.0 * (h[0] * b - h[1] * a)
    times_D(D, a, b, c, out, 3)
    out[3] -= h[4] * c - h[5] * b
    out[4] -= h[5] * a - h[3] * c
    out[5] -= h[3] * b - h[4] * a


def force_rates(k, m, work):
    """Fill ``work.F``: derivatives of the forces on what the joints carry, by their own positions and velocities."""
    S = m.S[k]
    for j in range(N_BODY):
        i = max(j - 5, 0)
        by_q, by_v, tree = work.F[0, j], work.F[1, j], m.trees[k, i]
        momentum_of(tree, work.swinging[j], by_q)
        add_B(work.h[i], work.D[i], work.turning[j], by_q)
        add_cross_force(S[j], work.f[i], by_q)
        # The axis of a joint moves with the body before it, those of the base with the base itself.
        if j < 6:
            cross_motion(work.V[0], S[j], work.moving[j])
        else:
            for c in range(6):
                work.moving[j, c] = 2.0 * work.turning[j, c]
        momentum_of(tree, work.moving[j], by_v)
        add_B(work.h[i], work.D[i], S[j], by_v)


def balance(k, robot, m, work):
    """Rows MOMENT, LOADED, FORCE and TWIST: the wrench of the floor, about the world's origin and per weight."""
    weight = -robot.mass * robot.gravity[2]
    f, p = work.f[0], m.q[k]
    n0, n1 = f[3] + p[1] * f[2] - p[2] * f[1], f[4] + p[2] * f[0] - p[0] * f[2]
    m.m[k, 0], m.m[k, 1], m.m[k, LOADED] = -n1 / weight, n0 / weight, f[2] / weight
    m.m[k, FORCE], m.m[k, FORCE + 1] = f[0] / weight, f[1] / weight
    m.m[k, TWIST] = (f[5] + p[0] * f[1] - p[1] * f[0]) / weight
    share = max(m.m[k, LOADED], 0.05)
    m.zmp[k, 0], m.zmp[k, 1] = m.m[k, 0] / share, m.m[k, 1] / share
    for part in range(3):
        F = m.F[k] if part == 2 else work.F[part]
        shares(F[:LOWER], p, weight, work.lower[part])
        shares(F[LOWER:], p, weight, work.upper[part])


def shares(F, p, weight, rows):
    """The same rows of the forces (n, 6) about a point p."""
    for j in range(F.shape[0]):
        f = F[j]
        rows[0, j] = -(f[4] + p[2] * f[0] - p[0] * f[2]) / weight
        rows[1, j] = (f[3] + p[1] * f[2] - p[2] * f[1]) / weight
        rows[LOADED, j], rows[FORCE, j], rows[FORCE + 1, j] = f[2] / weight, f[0] / weight, f[1] / weight
        rows[TWIST, j] = (f[5] + p[0] * f[1] - p[1] * f[0]) / weight


def torques(k, robot, m, work):
    """Rows TAU: torques of waist and arms, which base, waist and arms move."""
    S, D, lower, upper = m.S[k], work.six[2], work.lower, work.upper
    for u in range(UPPER):
        i, row = LOWER + u, TAU + u
        body, s, force = i - 5, S[i], m.F[k, i]
        m.m[k, row] = dot6(s, work.f[body])
        h = work.h[body]
        # B' S, whose linear part is zero.
        D[3] = -2.0 * (s[1] * h[2] - s[2] * h[1]) - (s[4] * h[5] - s[5] * h[4])
        D[4] = -2.0 * (s[2] * h[0] - s[0] * h[2]) - (s[5] * h[3] - s[3] * h[5])
        D[5] = -2.0 * (s[0] * h[1] - s[1] * h[0]) - (s[3] * h[4] - s[4] * h[3])
        times_D(work.D[body], s[3], s[4], s[5], D, 3)
        for j in range(6):
            lower[0, row, j], lower[1, row, j], lower[2, row, j] = by_joint(j, force, D, S, work)
        up = body
        while up > 0:
            j = 5 + up
            column = j - LOWER
            upper[0, row, column], upper[1, row, column], upper[2, row, column] = by_joint(j, force, D, S, work)
            if j < i:
                # The other half: the torque of a joint before, by this one.
                x, other = S[j], TAU + column
                upper[0, other, u], upper[1, other, u] = dot6(x, work.F[0, i]), dot6(x, work.F[1, i])
                upper[2, other, u] = dot6(x, force)
            up = robot.parent[up]


def by_joint(j, force, D, S, work):
    """Derivatives of a torque by position, velocity and acceleration of a joint at or before its own."""
    s, t = S[j], work.turning[j]
    by_q = dot6(force, work.swinging[j]) + D[3] * t[3] + D[4] * t[4] + D[5] * t[5]
    by_v = dot6(force, work.moving[j]) + D[3] * s[3] + D[4] * s[4] + D[5] * s[5]
    return by_q, by_v, dot6(force, s)


def soles(k, robot, m, work):
    """Rows SLIDE: how each sole would accelerate over the floor if pelvis and joints kept their velocities.

    Contact models that correct velocities, MuJoCo's among them, let a sole slide with this times their time constant
    (10 ms there), always the same way: a sum of ``angular rate squared times length``.
    """
    S, six = m.S[k], work.six
    for f in range(2):
        body, row = robot.frame_body[4 + f], SLIDE + 2 * f
        R, p = robot.frame_R[4 + f], robot.frame_p[4 + f]
        for a in range(3):
            x = m.R[k, body, a]
            six[0, a] = m.p[k, body, a] + x[0] * p[0] + x[1] * p[1] + x[2] * p[2]
            for e in range(2):
                six[1 + e, a] = x[0] * R[0, e] + x[1] * R[1, e] + x[2] * R[2, e]
        for e in range(2):
            cross(six[0], six[1 + e], six[1 + e], 3)
            m.m[k, row + e] = dot6(six[1 + e], work.A_kept[body])
        for j in range(LOWER):
            if robot.carries[4 + f, j]:
                slide_column(j, robot, S[j], work.V[body], work)
                for e in range(2):
                    work.lower[0, row + e, j] = dot6(six[1 + e], six[3])
                    work.lower[1, row + e, j] = dot6(six[1 + e], six[4])
        # By the acceleration that keeps the pelvis' velocity in world: -w x u in its own axes.
        u, w = m.v[k, :3], m.v[k, 3:6]
        for e in range(2):
            for c in range(3):
                six[5, c] = dot6(six[1 + e], S[c])
            cross(w, six[5], six[6], 0)
            cross(six[5], u, six[6], 3)
            for c in range(6):
                work.lower[1, row + e, c] += six[6, c]


def slide_column(j, robot, s, V, work):
    """Derivatives of an acceleration in axes of its body: ``work.six[3]`` by position, ``work.six[4]`` by velocity."""
    six, turn = work.six, work.turning[j]
    for c in range(6):
        six[3, c] = 0.0
    if j >= 6:
        before = robot.parent[j - 5]
        cross_motion(work.A_kept[before], s, six[3])
        for c in range(6):
            six[4, c] = work.V[before, c] - V[c]
        cross_motion(six[4], turn, six[5])
        for c in range(6):
            six[3, c] += six[5, c]
    cross_motion(V, s, six[4])
    for c in range(6):
        six[4, c] = work.moving[j, c] - six[4, c]


def reduce_motion(k, task, m, work):
    """The rows of the motion in the free directions of three knots."""
    K, dt = m.q.shape[0], task.dt
    lower, upper, J, f = work.lower, work.upper, m.J_m[k], FREE_LOWER
    first = k == 0
    here, there = pace(k, K, dt), pace(k + 1, K, dt)
    before, after = work.before, work.after
    for i in range(N_MOTION):
        for j in range(LOWER):
            by_v, by_a = 0.5 * lower[1, i, j], lower[2, i, j] / dt
            before[i, j], after[i, j] = by_v - by_a, 2.0 * by_a if first else by_v + by_a
    back, mid, front = work.reduced[0], work.reduced[1], work.reduced[2]
    times_transposed(before, m.behind[k], back)
    times_transposed(after, m.ahead[k + 1], front)
    for i in range(N_MOTION):
        for c in range(f):
            J[i, c], J[i, 2 * N_FREE + c] = -back[i, c], front[i, c]
    times_transposed(lower[0], m.free[k], mid)
    times_transposed(before, m.ahead[k], back)
    times_transposed(after, m.behind[k + 1], front)
    for i in range(N_MOTION):
        for c in range(f):
            J[i, N_FREE + c] = mid[i, c] + back[i, c] - front[i, c]
        back_u, mid_u, front_u = J[i, f:], J[i, N_FREE + f :], J[i, 2 * N_FREE + f :]
        for j in range(UPPER):
            by_v, by_a = 0.5 * upper[1, i, j], upper[2, i, j] / dt
            x, y = by_v - by_a, 2.0 * by_a if first else by_v + by_a
            back_u[j] = -here * x
            mid_u[j] = upper[0, i, j] + here * x - there * y
            front_u[j] = there * y


def bound_motion(k, robot, m, at):
    """The bounds on load, torques, zero-moment point, accelerations, speeds and friction, from row ``at`` on."""
    row, over, sign = m.m[k], m.over[k], m.sign[k]
    edge, torque = robot.normals.shape[0], at + 1
    over[at] = robot.load_min - row[LOADED]
    for u in range(UPPER):
        x = row[TAU + u]
        sign[torque + u] = 1.0 if x > 0.0 else -1.0
        over[torque + u] = abs(x) / robot.tau_max[u] - 1.0
    zmp = torque + UPPER
    for e in range(edge):
        over[zmp + e] = robot.normals[e, 0] * row[0] + robot.normals[e, 1] * row[1] - robot.zmp_offsets[e] * row[LOADED]
    rates = zmp + 2 * edge
    n = N_BODY - 6
    for i in range(n):
        a, h = m.a[k, 6 + i], m.half[k, 6 + i]
        sign[rates + i], sign[rates + n + i] = 1.0 if a > 0.0 else -1.0, 1.0 if h > 0.0 else -1.0
        over[rates + i] = abs(a) - robot.acceleration_max[i]
        over[rates + n + i] = abs(h) - robot.speed_max[i]
    for e in range(N_FRICTION):
        over[rates + 2 * n + e] = beyond(robot.cone[e], row)


def beyond(side, row):
    """How far rows of the motion (N_MOTION,) are beyond one side of the cone of friction."""
    d = side[0] * row[0] + side[1] * row[1] + side[2] * row[LOADED]
    return d + side[3] * row[FORCE] + side[4] * row[FORCE + 1] + side[5] * row[TWIST]
