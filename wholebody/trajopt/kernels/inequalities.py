"""The inequalities of a plan and their derivatives in its free directions. Layouts as in `cost`."""

from __future__ import annotations

import numpy as np

from wholebody.jit.arrays import Matrix, Vector
from wholebody.jit.vectors import dot
from wholebody.trajopt.arrays import Tables
from wholebody.trajopt.kernels.banded import subtract_rows
from wholebody.trajopt.kernels.capture_point import (
    approach_and_capture_changes,
    approach_derivative,
    capture_derivative,
)
from wholebody.trajopt.kernels.dynamics_rows import friction_violation
from wholebody.trajopt.kernels.spline import knot_rate
from wholebody.trajopt.layout import (  # fmt: skip
    BASE_HEIGHT,
    COM,
    COM_EDGE,
    DISTANCE,
    FREE_LOWER,
    HEIGHT,
    HORIZONTAL,
    LOWER,
    N_BETWEEN,
    N_BLOCK,
    N_BODY,
    N_DISTANCES,
    N_DYNAMICS,
    N_FREE,
    N_FRICTION,
    N_JOINTS,
    POSITION,
    RIGHT,
    STATIC,
    TAU,
    UPPER,
    VERTICAL,
    WAIST,
    YAW,
)
from wholebody.trajopt.workspace import AssemblyScratch, KnotMotion, System


def changes(
    robot: Tables, m: KnotMotion, dt: float, z: Matrix, between: bool, out: Matrix, work: AssemblyScratch
) -> None:
    """How a step ``z`` changes the violations, ``out`` (K, n_rows); those between knots only if they count."""
    K, E, n = m.q.shape[0], robot.normals.shape[0], N_JOINTS
    dv_mid, flat = work.dv_mid, z.reshape(z.size)
    velocity_changes(m, dt, z, dv_mid)
    for k in range(K):
        row, sign, x = out[k], m.sign[k], z[k + 1]
        if k > 0:
            configuration_changes(k, robot, m, x, row, sign, work)
        dynamics = work.dynamics
        three = flat[N_FREE * k :]
        for i in range(N_DYNAMICS):
            dynamics[i] = dot(m.J_dynamics[k, i], three, 3 * N_FREE)
        load = COM_EDGE + E
        row[load] = -dynamics[VERTICAL]
        for u in range(UPPER):
            row[load + 1 + u] = sign[load + 1 + u] * dynamics[TAU + u] / robot.tau_max[u]
        zmp = load + 1 + UPPER
        for e in range(E):
            normal = robot.normals[e]
            row[zmp + e] = normal[0] * dynamics[0] + normal[1] * dynamics[1] - robot.zmp_offsets[e] * dynamics[VERTICAL]
        if k > 0:
            approach_and_capture_changes(k, robot, m, dt, dv_mid, x, dynamics, row)
        rate, scale = zmp + 2 * E, 2.0 / dt if k == 0 else 1.0 / dt
        for j in range(n):
            row[rate + j] = sign[rate + j] * scale * (dv_mid[k + 1, 6 + j] - dv_mid[k, 6 + j])
            row[rate + n + j] = sign[rate + n + j] * dv_mid[k, 6 + j]
        for e in range(N_FRICTION):
            row[rate + 2 * n + e] = friction_violation(robot.cone[e], dynamics)
        if between:
            for i in range(N_BETWEEN):
                at = rate + 2 * n + N_FRICTION + i
                row[at] = sign[at] * dot(m.J_between[k, i], three, 3 * N_FREE) / robot.between_max[i % UPPER]


def velocity_changes(m: KnotMotion, dt: float, z: Matrix, dv_mid: Matrix) -> None:
    """Changes of the velocities between knots, ``dv_mid`` (K + 1, N_BODY)."""
    K, f = m.q.shape[0], FREE_LOWER
    for k in range(K + 1):
        for j in range(N_BODY):
            dv_mid[k, j] = 0.0
        if k in (0, K):
            continue
        for r in range(f):
            x, y = z[k + 1, r], z[k, r]
            for j in range(LOWER):
                dv_mid[k, j] += m.dv_dnext[k, r, j] * x - m.dv_dprev[k, r, j] * y
        for u in range(UPPER):
            dv_mid[k, LOWER + u] = knot_rate(k, K, dt) * (z[k + 1, f + u] - z[k, f + u])


def configuration_changes(
    k: int, robot: Tables, m: KnotMotion, x: Vector, row: Vector, sign: Vector, work: AssemblyScratch
) -> None:
    """Changes of the bounds on one configuration, entries TILT to COM_EDGE of ``row``, by a step x (N_FREE,)."""
    E, f, n_near = robot.normals.shape[0], FREE_LOWER, m.n_near[k]
    for i in range(2):
        row[i] = dot(m.J_tilt[k, i], x, N_FREE)
    row[BASE_HEIGHT] = -dot(m.J[k, HEIGHT], x, N_FREE)
    for j in range(LOWER - 6):
        row[POSITION + j] = 0.0
    for r in range(f):
        for j in range(LOWER - 6):
            row[POSITION + j] += m.free[k, r, 6 + j] * x[r]
    for j in range(N_JOINTS):
        if j < LOWER - 6:
            row[POSITION + j] *= sign[POSITION + j]
        else:
            row[POSITION + j] = sign[POSITION + j] * x[f + j - LOWER + 6]
    for w in range(WAIST):
        row[STATIC + w] = sign[STATIC + w] * dot(m.J_static[k, w], x, N_FREE) / robot.tau_max[w]
    for c in range(N_DISTANCES):
        row[DISTANCE + c] = dot(m.J_distance[k, c], x, N_FREE) if c < n_near else 0.0
    sx, sy = dot(m.J[k, COM], x, N_FREE), dot(m.J[k, COM + 1], x, N_FREE)
    for e in range(E):
        row[COM_EDGE + e] = robot.normals[e, 0] * sx + robot.normals[e, 1] * sy


def derivative(i: int, k: int, robot: Tables, m: KnotMotion, dt: float, out: Vector) -> tuple[int, int]:
    """Derivative ``out`` (3 N_FREE,) of one bound of knot k; the first and the last entry that are not zero."""
    E, n = robot.normals.shape[0], N_FREE
    load = COM_EDGE + E
    if i < load:
        ends = configuration_derivative(i, k, robot, m, out)
        if not DISTANCE <= i < COM_EDGE:
            return ends
        approach_derivative(i - DISTANCE, k, m, dt, out)
        return 0, 3 * n
    zmp = load + 1 + UPPER
    rate = zmp + 2 * E
    out[:] = 0.0
    sign = m.sign[k, i]
    if zmp + E <= i < rate:
        capture_derivative(i - zmp - E, k, robot, m, dt, out)
    elif i < rate:
        J = m.J_dynamics[k]
        for j in range(3 * n):
            if i == load:
                out[j] = -J[VERTICAL, j]
            elif i < zmp:
                out[j] = sign / robot.tau_max[i - load - 1] * J[TAU + i - load - 1, j]
            else:
                normal = robot.normals[i - zmp]
                out[j] = normal[0] * J[0, j] + normal[1] * J[1, j] - robot.zmp_offsets[i - zmp] * J[VERTICAL, j]
    elif i >= rate + 2 * N_JOINTS + N_FRICTION:
        u = i - rate - 2 * N_JOINTS - N_FRICTION
        for j in range(3 * n):
            out[j] = sign / robot.between_max[u % UPPER] * m.J_between[k, u, j]
    elif i >= rate + 2 * N_JOINTS:
        side, J = robot.cone[i - rate - 2 * N_JOINTS], m.J_dynamics[k]
        for j in range(3 * n):
            d = side[0] * J[0, j] + side[1] * J[1, j] + side[2] * J[VERTICAL, j]
            out[j] = d + side[3] * J[HORIZONTAL, j] + side[4] * J[HORIZONTAL + 1, j] + side[5] * J[YAW, j]
    else:
        return rate_derivative(i - rate, k, m, dt, sign, out)
    return 0, 3 * n


def configuration_derivative(i: int, k: int, robot: Tables, m: KnotMotion, out: Vector) -> tuple[int, int]:
    """Derivative ``out`` (3 N_FREE,) of a bound on one configuration, bodies at rest, and where it begins and ends."""
    f, n = FREE_LOWER, N_FREE
    out[:] = 0.0
    sign = m.sign[k, i]
    if i < BASE_HEIGHT:
        copy(1.0, m.J_tilt[k, i], out)
    elif i == BASE_HEIGHT:
        copy(-1.0, m.J[k, HEIGHT], out)
    elif i < POSITION + LOWER - 6:
        for r in range(f):
            out[n + r] = sign * m.free[k, r, 6 + i - POSITION]
        return n, n + f
    elif i < STATIC:
        j = n + f + i - POSITION - LOWER + 6
        out[j] = sign
        return j, j + 1
    elif i < DISTANCE:
        copy(sign / robot.tau_max[i - STATIC], m.J_static[k, i - STATIC], out)
    elif i < COM_EDGE:
        copy(1.0, m.J_distance[k, i - DISTANCE], out)
    else:
        normal = robot.normals[i - COM_EDGE]
        for j in range(n):
            out[n + j] = normal[0] * m.J[k, COM, j] + normal[1] * m.J[k, COM + 1, j]
    return n, 2 * n


def copy(sign: float, row: Vector, out: Vector) -> None:
    """Write a row (N_FREE,) into the middle of ``out``."""
    for j in range(N_FREE):
        out[N_FREE + j] = sign * row[j]


def rate_derivative(i: int, k: int, m: KnotMotion, dt: float, sign: float, out: Vector) -> tuple[int, int]:
    """Derivative ``out`` (3 N_FREE,) of an acceleration, i < N_JOINTS, or a speed, and where it begins and ends."""
    f, n, j = FREE_LOWER, N_FREE, 6 + i % N_JOINTS
    here, there = knot_rate(k, m.q.shape[0], dt), knot_rate(k + 1, m.q.shape[0], dt)
    a, b, c = -sign, sign, 0.0
    if i < N_JOINTS:
        c = sign * (2.0 / dt if k == 0 else 1.0 / dt)
        a, b = c, -c
    if j >= LOWER:
        u = f + j - LOWER
        out[u], out[n + u], out[2 * n + u] = a * here, b * here - c * there, c * there
        return u, 2 * n + u + 1
    for r in range(f):
        out[r] = a * m.dv_dprev[k, r, j]
        out[n + r] = b * m.dv_dnext[k, r, j] - c * m.dv_dprev[k + 1, r, j]
        out[2 * n + r] = c * m.dv_dnext[k + 1, r, j]
    return 0, 2 * n + f


def add_active(
    k: int, lowest: int, robot: Tables, m: KnotMotion, dt: float, penalties: Vector, s: System, work: AssemblyScratch
) -> None:
    """Add the active bounds of one knot to the panels of half the cost from the lowest on, four at a time."""
    for start in range(0, s.n_active[k], 4):
        low, high = 3, 0
        for r in range(4):
            bound, weighted = work.bounds[r], work.weighted[r]
            if start + r >= s.n_active[k]:
                bound[:], weighted[:] = 0.0, 0.0
                continue
            i = s.active[k, start + r]
            first, last = derivative(i, k, robot, m, dt, work.row)
            low, high = min(low, first // N_FREE), max(high, (last - 1) // N_FREE + 1)
            put(work.row, m.violation[k, i], -penalties[i], bound, weighted)
        for c in range(max(low, lowest - k), high):
            add_four(k + c, c, s.panels, work)


def put(row: Vector, value: float, weight: float, bound: Vector, weighted: Vector) -> None:
    """Write a bound's derivative (3 N_FREE,) and its value as a row of a panel, and the derivative times a weight."""
    for c in range(3):
        for j in range(N_FREE):
            x = row[c * N_FREE + j]
            bound[c * N_BLOCK + j], weighted[c * N_BLOCK + j] = x, weight * x
    bound[RIGHT] = -value


def add_four(k: int, c: int, panels: np.ndarray, work: AssemblyScratch) -> None:
    """Add the four bounds in ``work`` to a panel, to whose knot their block c belongs."""
    bounds, weighted = work.bounds.reshape(work.bounds.size), work.weighted.reshape(work.weighted.size)
    panel = panels[k]
    subtract_rows(c, 4, weighted, bounds, panel.reshape(panel.size))
