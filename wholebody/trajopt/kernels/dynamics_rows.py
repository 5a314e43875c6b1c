"""Rows of the dynamics of a knot, in the free directions of three knots, and the bounds on them.

They are the wrench of the floor per weight, torques of waist and arms, and accelerations of the soles.
"""

from __future__ import annotations

from wholebody.jit.arrays import Matrix, Vector
from wholebody.jit.vectors import times_transposed
from wholebody.robot.kernels.frames import SOLE_FRAME
from wholebody.robot.kernels.spatial import cross, cross_motion, dot6
from wholebody.trajopt.arrays import KnotTargets, Tables
from wholebody.trajopt.kernels.spline import knot_rate
from wholebody.trajopt.layout import (  # fmt: skip
    FREE_LOWER,
    HORIZONTAL,
    LOWER,
    N_BODY,
    N_FREE,
    N_FRICTION,
    SOLE,
    TAU,
    UPPER,
    VERTICAL,
    YAW,
)
from wholebody.trajopt.workspace import KnotMotion, KnotScratch

UNLOADED = 0.05
"""Least share of the weight by which moments are divided for the zero-moment point, which is reported only; chosen, no
trial is on record."""


PUSHED_MORE = 1.0 / 3.0
"""Share by which palms may be pushed harder than a plan counts on, for which it keeps the zero-moment point inside too;
chosen: the controller leans against the rest, which takes it half a second. Derivatives leave it out."""


def contact_wrench(k: int, robot: Tables, m: KnotMotion, work: KnotScratch) -> None:
    """Rows ZMP_FORCE, VERTICAL, HORIZONTAL and YAW: the wrench of the floor about the world's origin, per weight."""
    weight = -robot.mass * robot.gravity[2]
    f, p = work.f[0], m.q[k]
    n0, n1 = f[3] + p[1] * f[2] - p[2] * f[1], f[4] + p[2] * f[0] - p[0] * f[2]
    m.dynamics[k, 0], m.dynamics[k, 1], m.dynamics[k, VERTICAL] = -n1 / weight, n0 / weight, f[2] / weight
    m.dynamics[k, HORIZONTAL], m.dynamics[k, HORIZONTAL + 1] = f[0] / weight, f[1] / weight
    m.dynamics[k, YAW] = (f[5] + p[0] * f[1] - p[1] * f[0]) / weight
    share = max(m.dynamics[k, VERTICAL], UNLOADED)
    m.zmp[k, 0], m.zmp[k, 1] = m.dynamics[k, 0] / share, m.dynamics[k, 1] / share
    for part in range(3):
        F = m.F[k] if part == 2 else work.F[part]
        wrench_rows(F[:LOWER], p, weight, work.lower[part])
        wrench_rows(F[LOWER:], p, weight, work.upper[part])


def pushed_rows(k: int, robot: Tables, m: KnotMotion, work: KnotScratch) -> None:
    """How much forces on the palms change rows ZMP_FORCE and VERTICAL, per weight."""
    weight, p = -robot.mass * robot.gravity[2], m.q[k]
    for c in range(3):
        m.pushed[k, c] = 0.0
    for h in range(2):
        w = work.pushes[h]
        m.pushed[k, 0] += (w[4] + p[2] * w[0] - p[0] * w[2]) / weight
        m.pushed[k, 1] -= (w[3] + p[1] * w[2] - p[2] * w[1]) / weight
        m.pushed[k, VERTICAL] -= w[2] / weight


def wrench_rows(F: Matrix, p: Vector, weight: float, rows: Matrix) -> None:
    """Columns (N_DYNAMICS, n) of wrench rows, per weight [N], from forces F (n, 6) moved to a point p [m]."""
    for j in range(F.shape[0]):
        f = F[j]
        rows[0, j] = -(f[4] + p[2] * f[0] - p[0] * f[2]) / weight
        rows[1, j] = (f[3] + p[1] * f[2] - p[2] * f[1]) / weight
        rows[VERTICAL, j], rows[HORIZONTAL, j], rows[HORIZONTAL + 1, j] = f[2] / weight, f[0] / weight, f[1] / weight
        rows[YAW, j] = (f[5] + p[0] * f[1] - p[1] * f[0]) / weight


def sole_accelerations(k: int, robot: Tables, m: KnotMotion, work: KnotScratch) -> None:
    """Rows SOLE: how each sole would accelerate over the floor if pelvis and joints kept their velocities.

    Contact models that correct velocities, MuJoCo's among them, let a sole slide with this times their time constant
    (10 ms there), always the same way: a sum of ``angular rate squared times length``.
    """
    S, six = m.S[k], work.six
    for f in range(2):
        body, row = robot.frame_body[SOLE_FRAME + f], SOLE + 2 * f
        R, p = robot.frame_R[SOLE_FRAME + f], robot.frame_p[SOLE_FRAME + f]
        for a in range(3):
            x = m.R[k, body, a]
            six[0, a] = m.p[k, body, a] + x[0] * p[0] + x[1] * p[1] + x[2] * p[2]
            for e in range(2):
                six[1 + e, a] = x[0] * R[0, e] + x[1] * R[1, e] + x[2] * R[2, e]
        for e in range(2):
            cross(six[0], six[1 + e], six[1 + e, 3:])
            m.dynamics[k, row + e] = dot6(six[1 + e], work.A_kept[body])
        for j in range(LOWER):
            if robot.carries[SOLE_FRAME + f, j]:
                slide_column(j, robot, S[j], work.V[body], work)
                for e in range(2):
                    work.lower[0, row + e, j] = dot6(six[1 + e], six[3])
                    work.lower[1, row + e, j] = dot6(six[1 + e], six[4])
        # By the acceleration that keeps the pelvis' velocity in world: -w x u in its own axes.
        u, w = m.v[k, :3], m.v[k, 3:6]
        for e in range(2):
            for c in range(3):
                six[5, c] = dot6(six[1 + e], S[c])
            cross(w, six[5], six[6])
            cross(six[5], u, six[6, 3:])
            for c in range(6):
                work.lower[1, row + e, c] += six[6, c]


def slide_column(j: int, robot: Tables, s: Vector, V: Vector, work: KnotScratch) -> None:
    """Derivatives of an acceleration in axes of its body: ``work.six[3]`` by position, ``work.six[4]`` by velocity."""
    six, psi_dot = work.six, work.psi_dot[j]
    for c in range(6):
        six[3, c] = 0.0
    if j >= 6:
        before = robot.parent[j - 5]
        cross_motion(work.A_kept[before], s, six[3])
        for c in range(6):
            six[4, c] = work.V[before, c] - V[c]
        cross_motion(six[4], psi_dot, six[5])
        for c in range(6):
            six[3, c] += six[5, c]
    cross_motion(V, s, six[4])
    for c in range(6):
        six[4, c] = work.psi_S_dot[j, c] - six[4, c]


def project_dynamics(
    k: int,
    start: int,
    shares: tuple[float, float, float, float],
    task: KnotTargets,
    m: KnotMotion,
    J: Matrix,
    work: KnotScratch,
) -> None:
    """Rows of the dynamics from ``start`` on in the free directions of three knots, ``J`` (rows, 3 N_FREE).

    Their velocity is that before the knot and that after it with the first two ``shares``; their configuration that of
    the knot, moved by these velocities for the times that are the last two [s]. At the first knot the former is given.
    """
    K, dt = m.q.shape[0], task.dt
    lower, upper, f = work.lower, work.upper, FREE_LOWER
    earlier, later, back_time, time = shares
    each = 2.0 if k == 0 else 1.0
    here, there = knot_rate(k, K, dt), knot_rate(k + 1, K, dt)
    by_prev, by_next = work.by_prev, work.by_next
    for i in range(start, start + J.shape[0]):
        for j in range(LOWER):
            by_q, by_v, by_a = lower[0, i, j], lower[1, i, j], lower[2, i, j] / dt
            by_prev[i, j] = earlier * by_v - by_a + back_time * by_q
            by_next[i, j] = later * by_v + each * by_a + time * by_q
    back, mid, front = work.reduced[0], work.reduced[1], work.reduced[2]
    times_transposed(by_prev, m.dv_dprev[k], back)
    times_transposed(by_next, m.dv_dnext[k + 1], front)
    for i in range(J.shape[0]):
        for c in range(f):
            J[i, c], J[i, 2 * N_FREE + c] = -back[start + i, c], front[start + i, c]
    times_transposed(lower[0], m.free[k], mid)
    times_transposed(by_prev, m.dv_dnext[k], back)
    times_transposed(by_next, m.dv_dprev[k + 1], front)
    for i in range(J.shape[0]):
        row = start + i
        for c in range(f):
            J[i, N_FREE + c] = mid[row, c] + back[row, c] - front[row, c]
        back_u, mid_u, front_u = J[i, f:], J[i, N_FREE + f :], J[i, 2 * N_FREE + f :]
        for j in range(UPPER):
            by_q, by_v, by_a = upper[0, row, j], upper[1, row, j], upper[2, row, j] / dt
            x = earlier * by_v - by_a + back_time * by_q
            y = later * by_v + each * by_a + time * by_q
            back_u[j] = -here * x
            mid_u[j] = by_q + here * x - there * y
            front_u[j] = there * y


def dynamics_violations(k: int, robot: Tables, task: KnotTargets, m: KnotMotion, at: int) -> None:
    """The bounds on load, torques, zero-moment point, accelerations, speeds and friction, from row ``at`` on."""
    row, violation, sign = m.dynamics[k], m.violation[k], m.sign[k]
    edge, torque = robot.normals.shape[0], at + 1
    violation[at] = robot.load_min - row[VERTICAL]
    for u in range(UPPER):
        x = row[TAU + u]
        sign[torque + u] = 1.0 if x > 0.0 else -1.0
        violation[torque + u] = abs(x) / robot.tau_max[u] - 1.0 - (task.spent[u] if k == 0 else 0.0)
    zmp = torque + UPPER
    for e in range(edge):
        violation[zmp + e] = (
            robot.normals[e, 0] * row[0] + robot.normals[e, 1] * row[1] - robot.zmp_offsets[e] * row[VERTICAL]
        )
        if task.pushed:
            by = m.pushed[k]
            more = robot.normals[e, 0] * by[0] + robot.normals[e, 1] * by[1] - robot.zmp_offsets[e] * by[VERTICAL]
            violation[zmp + e] += PUSHED_MORE * max(more, 0.0)
    rates = zmp + 2 * edge
    n = N_BODY - 6
    for i in range(n):
        a, v = m.a[k, 6 + i], m.v_mid[k, 6 + i]
        sign[rates + i], sign[rates + n + i] = 1.0 if a > 0.0 else -1.0, 1.0 if v > 0.0 else -1.0
        violation[rates + i] = abs(a) - robot.acceleration_max[i]
        violation[rates + n + i] = abs(v) - robot.speed_max[i]
    for e in range(N_FRICTION):
        violation[rates + 2 * n + e] = friction_violation(robot.cone[e], row)


def friction_violation(side: Vector, row: Vector) -> float:
    """How far rows of the dynamics (N_DYNAMICS,) are beyond one side of the cone of friction."""
    d = side[0] * row[0] + side[1] * row[1] + side[2] * row[VERTICAL]
    return d + side[3] * row[HORIZONTAL] + side[4] * row[HORIZONTAL + 1] + side[5] * row[YAW]
