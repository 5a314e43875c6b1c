r"""Kinematics of one knot of the plan, with both feet put back in place; compiles with numba as it stands.

Spatial vectors are ``[linear; angular]`` in world axes about the origin of the base. Body 0 is the base, body i > 0
hangs on joint i, whose velocity is entry ``5 + i``; parents come before their children. The first `LOWER` velocities
are those of base and legs, the others move waist and arms; after the bodies of the plan come the fingers, which only
count for distances.

The feet leave `FREE_LOWER` directions to base and legs. ``free`` (FREE_LOWER, LOWER) holds them as orthonormal rows;
the free directions of a knot are those and the upper joints themselves.
"""

from __future__ import annotations

import math

from wholebody.planning.trajopt.layout import FREE_LOWER, LOWER

PLACEMENT_P, AXIS, MASS, LEVER, INERTIA = 9, 12, 15, 16, 19
"""Columns of the body table: joint placement (rotation from 0), joint axis, mass, its centre, inertia about that."""

SETTLED, SETTLE_STEPS = 1e-6, 6
"""To which the feet are put back [m, rad], in so many steps at most."""


def base_rotation(q, R):
    """Rotation matrix of the base quaternion ``q[3:7]`` (xyzw)."""
    x, y, z, w = q[3], q[4], q[5], q[6]
    R[0, 0], R[0, 1], R[0, 2] = 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)
    R[1, 0], R[1, 1], R[1, 2] = 2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)
    R[2, 0], R[2, 1], R[2, 2] = 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)


def place_base(q, R, p, S):
    """Placement and columns of the base."""
    base_rotation(q, R[0])
    for a in range(3):
        p[0, a] = 0.0
        for k in range(3):
            S[k, a], S[k, 3 + a] = R[0, a, k], 0.0
            S[3 + k, a], S[3 + k, 3 + a] = 0.0, R[0, a, k]


def place_body(row, angle, R_parent, p_parent, R, p):
    """Placement of a body that hangs on a parent by a joint at an angle."""
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


def place_bodies(q, table, parent, first, last, R, p, S):
    """Placements of bodies ``first`` to ``last - 1`` and the columns of their joints."""
    for i in range(first, last):
        row, k = table[i], parent[i]
        place_body(row, q[6 + i], R[k], p[k], R[i], p[i])
        s = S[5 + i]
        for a in range(3):
            s[3 + a] = R[i, a, 0] * row[AXIS] + R[i, a, 1] * row[AXIS + 1] + R[i, a, 2] * row[AXIS + 2]
        s[0] = p[i, 1] * s[5] - p[i, 2] * s[4]
        s[1] = p[i, 2] * s[3] - p[i, 0] * s[5]
        s[2] = p[i, 0] * s[4] - p[i, 1] * s[3]


def fixed_frame(R_body, p_body, R_local, p_local, R, p):
    """Placement of a frame fixed to a body."""
    for a in range(3):
        r0, r1, r2 = R_body[a, 0], R_body[a, 1], R_body[a, 2]
        p[a] = p_body[a] + r0 * p_local[0] + r1 * p_local[1] + r2 * p_local[2]
        for b in range(3):
            R[a, b] = r0 * R_local[0, b] + r1 * R_local[1, b] + r2 * R_local[2, b]


def turn_between(R, R_from, w):
    """Rotation vector of ``R R_from'``, world axes."""
    trace = 0.0
    w[0] = w[1] = w[2] = 0.0
    for k in range(3):
        trace += R[0, k] * R_from[0, k] + R[1, k] * R_from[1, k] + R[2, k] * R_from[2, k]
        w[0] += R[2, k] * R_from[1, k] - R[1, k] * R_from[2, k]
        w[1] += R[0, k] * R_from[2, k] - R[2, k] * R_from[0, k]
        w[2] += R[1, k] * R_from[0, k] - R[0, k] * R_from[1, k]
    s, c = 0.5 * math.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]), 0.5 * (trace - 1.0)
    if s > 1e-7:
        scale = 0.5 * math.atan2(s, c) / s
        for k in range(3):
            w[k] *= scale
    elif c > 0.0:
        for k in range(3):
            w[k] *= 0.5
    else:
        half_turn(R, R_from, w)


def half_turn(R, R_from, w):
    """The same for half a turn: the axis is the largest column of ``R R_from' + 1``."""
    largest = -1.0
    for j in range(3):
        size, column = 0.0, (0.0, 0.0, 0.0)
        x = y = z = 0.0
        for k in range(3):
            x += R[0, k] * R_from[j, k]
            y += R[1, k] * R_from[j, k]
            z += R[2, k] * R_from[j, k]
        column = (x + (j == 0), y + (j == 1), z + (j == 2))
        size = math.sqrt(column[0] ** 2 + column[1] ** 2 + column[2] ** 2)
        if size > largest:
            largest = size
            for a in range(3):
                w[a] = math.pi * column[a] / size


def frame_rows(S, carries, x, rows):
    """Jacobian (6, n) of a frame at x, world axes; ``carries`` (n,) are the velocities that move it."""
    for j in range(S.shape[0]):
        if carries[j]:
            s = S[j]
            rows[0, j] = s[0] + s[4] * x[2] - s[5] * x[1]
            rows[1, j] = s[1] + s[5] * x[0] - s[3] * x[2]
            rows[2, j] = s[2] + s[3] * x[1] - s[4] * x[0]
            rows[3, j], rows[4, j], rows[5, j] = s[3], s[4], s[5]
        else:
            for a in range(6):
                rows[a, j] = 0.0


def leave_feet(W, error, V, X, diagonal, sums):
    """Least step that corrects an error of the feet, and directions that leave them.

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


def reflect_feet(v, first, W, sums):
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


def reflect_free(v, first, X, sums):
    """The same for eight columns."""
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


def move_base(q, u, w):
    """Move the base by the twist ``[u; w]`` in its own axes, as Pinocchio's ``integrate``."""
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
    for a_ in range(3, 7):
        q[a_] /= size


def move(q, lower):
    """Move base and legs of a configuration by ``lower`` (LOWER,), in place."""
    move_base(q, lower[:3], lower[3:6])
    for j in range(6, LOWER):
        q[1 + j] += lower[j]


def settle(q, robot, R, p, S, free, work):
    """Put the feet back, moving base and legs as little as possible; fills the kinematics and ``free`` there.

    Args:
        q: In and out, configuration (36,).
        robot: `tables.Tables`.
        R: Out, rotations of the bodies (bodies, 3, 3).
        p: Out, their origins from the base (bodies, 3).
        S: Out, columns (35, 6).
        free: Out (FREE_LOWER, LOWER).
        work: `tables.Work`.
    """
    W, error, X = work.feet, work.error, work.step
    for turn in range(SETTLE_STEPS):
        place_base(q, R, p, S)
        place_bodies(q, robot.bodies, robot.parent, 1, LOWER - 5, R, p, S)
        worst = 0.0
        for f in range(2):
            body = robot.frame_body[4 + f]
            fixed_frame(R[body], p[body], robot.frame_R[4 + f], robot.frame_p[4 + f], work.R, work.p)
            foot_columns(S, robot.carries[4 + f], work.p, 6 * f, W)
            turn_between(robot.R_feet[f], work.R, error[6 * f + 3 : 6 * f + 6])
            for a in range(3):
                error[6 * f + a] = robot.p_feet[f, a] - q[a] - work.p[a]
        for i in range(12):
            worst = max(worst, abs(error[i]))
        leave_feet(W, error, work.reflections, X, work.diagonal, work.sums)
        if worst < SETTLED or turn == SETTLE_STEPS - 1:
            break
        for j in range(LOWER):
            work.lower_step[j] = X[j, 0]
        move(q, work.lower_step)
    for r in range(FREE_LOWER):
        for j in range(LOWER):
            free[r, j] = X[j, 1 + r]
    place_bodies(q, robot.bodies, robot.parent, LOWER - 5, S.shape[0] - 5, R, p, S)


def foot_columns(S, carries, x, at, W):
    """Transposed Jacobian of a sole at x, world axes, in the columns of ``W`` (LOWER, 12) from ``at`` on."""
    for j in range(LOWER):
        s, row = S[j], W[j]
        on = 1.0 if carries[j] else 0.0
        row[at] = on * (s[0] + s[4] * x[2] - s[5] * x[1])
        row[at + 1] = on * (s[1] + s[5] * x[0] - s[3] * x[2])
        row[at + 2] = on * (s[2] + s[3] * x[1] - s[4] * x[0])
        row[at + 3], row[at + 4], row[at + 5] = on * s[3], on * s[4], on * s[5]
