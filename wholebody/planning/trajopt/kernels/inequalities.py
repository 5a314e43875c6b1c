"""The plan's bounds, linear in its free directions; compiles with numba as it stands. Layouts as in `cost`."""

from __future__ import annotations

from wholebody.jit.blas import apply
from wholebody.planning.trajopt.kernels.capture_point import capture_derivative, look_changes, sweep_derivative
from wholebody.planning.trajopt.kernels.inverse_dynamics import beyond
from wholebody.planning.trajopt.kernels.spline import pace
from wholebody.planning.trajopt.layout import (  # fmt: skip
    COM,
    EDGE,
    FORCE,
    FREE_LOWER,
    HEIGHT,
    HOLD,
    LIMIT,
    LOADED,
    LOWER,
    LOWEST,
    N_BODY,
    N_FREE,
    N_FRICTION,
    N_JOINTS,
    N_NEAR,
    NEAR,
    TAU,
    TWIST,
    UPPER,
    WAIST,
)


def changes(robot, m, dt, z, out, work):
    """How a step ``z`` changes what bounds are exceeded by, ``out`` (K, n_sided)."""
    K, E, n = m.q.shape[0], robot.normals.shape[0], N_JOINTS
    dh, flat = work.half, z.reshape(z.size)
    steps(m, dt, z, dh)
    for k in range(K):
        row, sign, x = out[k], m.sign[k], z[k + 1]
        if k > 0:
            place_changes(k, robot, m, x, row, sign, work)
        motion = work.motion
        apply(m.J_m[k], flat[N_FREE * k : N_FREE * (k + 3)], motion)
        load = EDGE + E
        row[load] = -motion[LOADED]
        for u in range(UPPER):
            row[load + 1 + u] = sign[load + 1 + u] * motion[TAU + u] / robot.tau_max[u]
        zmp = load + 1 + UPPER
        for e in range(E):
            normal = robot.normals[e]
            row[zmp + e] = normal[0] * motion[0] + normal[1] * motion[1] - robot.zmp_offsets[e] * motion[LOADED]
        if k > 0:
            look_changes(k, robot, m, dh, x, motion, row)
        rate, scale = zmp + 2 * E, 2.0 / dt if k == 0 else 1.0 / dt
        for j in range(n):
            row[rate + j] = sign[rate + j] * scale * (dh[k + 1, 6 + j] - dh[k, 6 + j])
            row[rate + n + j] = sign[rate + n + j] * dh[k, 6 + j]
        for e in range(N_FRICTION):
            row[rate + 2 * n + e] = beyond(robot.cone[e], motion)


def steps(m, dt, z, dh):
    """Changes of the velocities between knots, ``dh`` (K + 1, N_BODY)."""
    K, f = m.q.shape[0], FREE_LOWER
    for k in range(K + 1):
        for j in range(N_BODY):
            dh[k, j] = 0.0
        if k in (0, K):
            continue
        for r in range(f):
            x, y = z[k + 1, r], z[k, r]
            for j in range(LOWER):
                dh[k, j] += m.ahead[k, r, j] * x - m.behind[k, r, j] * y
        for u in range(UPPER):
            dh[k, LOWER + u] = pace(k, K, dt) * (z[k + 1, f + u] - z[k, f + u])


def place_changes(k, robot, m, x, row, sign, work):
    """The same for the bounds on one configuration."""
    E, f, near = robot.normals.shape[0], FREE_LOWER, m.near[k]
    for i in range(2):
        d = 0.0
        for j in range(N_FREE):
            d += m.J_tilt[k, i, j] * x[j]
        row[i] = d
    d = sx = sy = 0.0
    for j in range(N_FREE):
        d += m.J[k, HEIGHT, j] * x[j]
        sx += m.J[k, COM, j] * x[j]
        sy += m.J[k, COM + 1, j] * x[j]
    row[LOWEST] = -d
    for j in range(LOWER - 6):
        row[LIMIT + j] = 0.0
    for r in range(f):
        for j in range(LOWER - 6):
            row[LIMIT + j] += m.free[k, r, 6 + j] * x[r]
    for j in range(N_JOINTS):
        if j < LOWER - 6:
            row[LIMIT + j] *= sign[LIMIT + j]
        else:
            row[LIMIT + j] = sign[LIMIT + j] * x[f + j - LOWER + 6]
    for w in range(WAIST):
        d = 0.0
        for j in range(N_FREE):
            d += m.J_hold[k, w, j] * x[j]
        row[HOLD + w] = sign[HOLD + w] * d / robot.tau_max[w]
    for c in range(N_NEAR):
        d = 0.0
        if c < near:
            for j in range(N_FREE):
                d += m.J_near[k, c, j] * x[j]
        row[NEAR + c] = d
    for e in range(E):
        row[EDGE + e] = robot.normals[e, 0] * sx + robot.normals[e, 1] * sy


def derivative(i, k, robot, m, dt, out):
    """Derivative ``out`` (3 N_FREE,) of one bound of knot k; the first and the last entry that are not zero."""
    E, n = robot.normals.shape[0], N_FREE
    load = EDGE + E
    if i < load:
        ends = place_derivative(i, k, robot, m, out)
        if not NEAR <= i < EDGE:
            return ends
        sweep_derivative(i - NEAR, k, m, dt, out)
        return 0, 3 * n
    zmp = load + 1 + UPPER
    rate = zmp + 2 * E
    out[:] = 0.0
    sign = m.sign[k, i]
    if zmp + E <= i < rate:
        capture_derivative(i - zmp - E, k, robot, m, dt, out)
    elif i < rate:
        J = m.J_m[k]
        for j in range(3 * n):
            if i == load:
                out[j] = -J[LOADED, j]
            elif i < zmp:
                out[j] = sign / robot.tau_max[i - load - 1] * J[TAU + i - load - 1, j]
            else:
                normal = robot.normals[i - zmp]
                out[j] = normal[0] * J[0, j] + normal[1] * J[1, j] - robot.zmp_offsets[i - zmp] * J[LOADED, j]
    elif i >= rate + 2 * N_JOINTS:
        side, J = robot.cone[i - rate - 2 * N_JOINTS], m.J_m[k]
        for j in range(3 * n):
            d = side[0] * J[0, j] + side[1] * J[1, j] + side[2] * J[LOADED, j]
            out[j] = d + side[3] * J[FORCE, j] + side[4] * J[FORCE + 1, j] + side[5] * J[TWIST, j]
    else:
        return rate_derivative(i - rate, k, m, dt, sign, out)
    return 0, 3 * n


def place_derivative(i, k, robot, m, out):
    """The same for bounds on one configuration, as if the bodies stood still."""
    f, n = FREE_LOWER, N_FREE
    out[:] = 0.0
    sign = m.sign[k, i]
    if i < LOWEST:
        copy(1.0, m.J_tilt[k, i], out)
    elif i == LOWEST:
        copy(-1.0, m.J[k, HEIGHT], out)
    elif i < LIMIT + LOWER - 6:
        for r in range(f):
            out[n + r] = sign * m.free[k, r, 6 + i - LIMIT]
        return n, n + f
    elif i < HOLD:
        j = n + f + i - LIMIT - LOWER + 6
        out[j] = sign
        return j, j + 1
    elif i < NEAR:
        copy(sign / robot.tau_max[i - HOLD], m.J_hold[k, i - HOLD], out)
    elif i < EDGE:
        copy(1.0, m.J_near[k, i - NEAR], out)
    else:
        normal = robot.normals[i - EDGE]
        for j in range(n):
            out[n + j] = normal[0] * m.J[k, COM, j] + normal[1] * m.J[k, COM + 1, j]
    return n, 2 * n


def copy(sign, row, out):
    """Write a row (N_FREE,) into the middle of ``out``."""
    for j in range(N_FREE):
        out[N_FREE + j] = sign * row[j]


def rate_derivative(i, k, m, dt, sign, out):
    """The same for accelerations, i < N_JOINTS, and speeds."""
    f, n, j = FREE_LOWER, N_FREE, 6 + i % N_JOINTS
    here, there = pace(k, m.q.shape[0], dt), pace(k + 1, m.q.shape[0], dt)
    a, b, c = -sign, sign, 0.0
    if i < N_JOINTS:
        c = sign * (2.0 / dt if k == 0 else 1.0 / dt)
        a, b = c, -c
    if j >= LOWER:
        u = f + j - LOWER
        out[u], out[n + u], out[2 * n + u] = a * here, b * here - c * there, c * there
        return u, 2 * n + u + 1
    for r in range(f):
        out[r] = a * m.behind[k, r, j]
        out[n + r] = b * m.ahead[k, r, j] - c * m.behind[k + 1, r, j]
        out[2 * n + r] = c * m.ahead[k + 1, r, j]
    return 0, 2 * n + f


def add_active(k, lowest, robot, m, dt, weights, active, H, g, row):
    """Add the active bounds of one knot to Hessian and gradient of half the cost, to panels from the lowest on."""
    n = N_FREE
    for i in range(active.shape[1]):
        if not active[k, i]:
            continue
        first, last = derivative(i, k, robot, m, dt, row)
        w, value = weights[i], m.over[k, i]
        for a in range(first, last):
            x, c = w * row[a], a // n
            if x != 0.0 and k + c >= lowest:
                g[k + c, a - c * n] += x * value
                panel, ahead = H[k + c, a - c * n], row[c * n :]
                for b in range(last - c * n):
                    panel[b] += x * ahead[b]
