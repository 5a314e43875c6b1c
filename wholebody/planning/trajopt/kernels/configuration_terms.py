"""What the plan wants of a configuration, and which bounds it has; compiles with numba as it stands."""

from __future__ import annotations

import math

from wholebody.planning.trajopt.kernels.fixed_feet_kinematics import (
    INERTIA,
    LEVER,
    MASS,
    fixed_frame,
    frame_rows,
    settle,
    turn_between,
)
from wholebody.planning.trajopt.layout import (  # fmt: skip
    COM,
    EDGE,
    FREE_LOWER,
    HEIGHT,
    JOINTS,
    LIMIT,
    LOWER,
    LOWEST,
    N_BODY,
    N_JOINTS,
    PELVIS,
    TILT,
    TORSO,
    UPPER,
)


def body_inertia(row, R, p, out):
    """Spatial inertia of a body about the base: mass, mass times centre (3), moments xx xy xz yy yz zz."""
    m = row[MASS]
    for a in range(3):
        lever = R[a, 0] * row[LEVER] + R[a, 1] * row[LEVER + 1] + R[a, 2] * row[LEVER + 2]
        out[1 + a] = p[a] + lever
    x, y, z = out[1], out[2], out[3]
    xx, xy, xz, yy, yz, zz = row[INERTIA], row[20], row[21], row[22], row[23], row[24]
    at = 4
    for a in range(3):
        t0 = R[a, 0] * xx + R[a, 1] * xy + R[a, 2] * xz
        t1 = R[a, 0] * xy + R[a, 1] * yy + R[a, 2] * yz
        t2 = R[a, 0] * xz + R[a, 1] * yz + R[a, 2] * zz
        for b in range(a, 3):
            out[at] = t0 * R[b, 0] + t1 * R[b, 1] + t2 * R[b, 2]
            at += 1
    out[0], out[1], out[2], out[3] = m, m * x, m * y, m * z
    out[4] += m * (y * y + z * z)
    out[5] -= m * x * y
    out[6] -= m * x * z
    out[7] += m * (x * x + z * z)
    out[8] -= m * y * z
    out[9] += m * (x * x + y * y)


def momentum_of(n, t, out):
    """``out = inertia n times twist t``."""
    out[0] = n[0] * t[0] + t[4] * n[3] - t[5] * n[2]
    out[1] = n[0] * t[1] + t[5] * n[1] - t[3] * n[3]
    out[2] = n[0] * t[2] + t[3] * n[2] - t[4] * n[1]
    out[3] = n[2] * t[2] - n[3] * t[1] + n[4] * t[3] + n[5] * t[4] + n[6] * t[5]
    out[4] = n[3] * t[0] - n[1] * t[2] + n[5] * t[3] + n[7] * t[4] + n[8] * t[5]
    out[5] = n[1] * t[1] - n[2] * t[0] + n[6] * t[3] + n[8] * t[4] + n[9] * t[5]


def masses(robot, R, p, S, inertia, trees, F):
    """Inertias of the bodies and of what they carry, and the forces ``F`` for unit accelerations."""
    n = inertia.shape[0]
    for i in range(n):
        body_inertia(robot.bodies[i], R[i], p[i], inertia[i])
        for c in range(10):
            trees[i, c] = inertia[i, c]
    for i in range(n - 1, 0, -1):
        k = robot.parent[i]
        for c in range(10):
            trees[k, c] += trees[i, c]
        momentum_of(trees[i], S[5 + i], F[5 + i])
    for j in range(6):
        momentum_of(trees[0], S[j], F[j])


def reduce_row(row, free, out):
    """A row (N_BODY,) in the free directions, (N_FREE,)."""
    for r in range(FREE_LOWER):
        d = 0.0
        for j in range(LOWER):
            d += row[j] * free[r, j]
        out[r] = d
    for j in range(UPPER):
        out[FREE_LOWER + j] = row[LOWER + j]


def configuration(k, robot, task, m, work):
    """Put the feet of knot ``k`` back; fill palms, masses, rows ``r`` and ``J``, and the bounds on configurations."""
    q, free, R, p, S, r, J = m.q[k], m.free[k], m.R[k], m.p[k], m.S[k], m.r[k], m.J[k]
    settle(q, robot, R, p, S, free, work)
    masses(robot, R, p, S, m.inertia[k], m.trees[k], m.F[k])
    rows = work.rows
    for f in range(2):
        body = robot.frame_body[f]
        fixed_frame(R[body], p[body], robot.frame_R[f], robot.frame_p[f], work.R, work.p)
        frame_rows(S, robot.carries[f], work.p, rows)
        turn_between(work.R, task.T_palms[k, f, :3, :3], r[6 * f + 3 : 6 * f + 6])
        for a in range(3):
            m.palms[k, f, a, 3] = q[a] + work.p[a]
            r[6 * f + a] = m.palms[k, f, a, 3] - task.T_palms[k, f, a, 3] + task.bend[k, 6 * f + a]
            r[6 * f + 3 + a] += task.bend[k, 6 * f + 3 + a]
            for b in range(3):
                m.palms[k, f, a, b] = work.R[a, b]
        for a in range(6):
            reduce_row(rows[a], free, J[6 * f + a])
    com = m.trees[k, 0]
    for a in range(2):
        r[COM + a] = q[a] + com[1 + a] / robot.mass - robot.com_stance[a]
        for j in range(N_BODY):
            rows[a, j] = m.F[k, j, a] / robot.mass
        reduce_row(rows[a], free, J[COM + a])
    for f in range(2):
        body, start = robot.frame_body[2 + f], TORSO if f == 0 else PELVIS
        fixed_frame(R[body], p[body], robot.frame_R[2 + f], robot.frame_p[2 + f], work.R, work.p)
        frame_rows(S, robot.carries[2 + f], work.p, rows)
        upright(work.R, r[start : start + 3])
        for a in range(3):
            reduce_row(rows[3 + a], free, J[start + a])
        tilt(k, f, work.R, robot.limits[f], J[start : start + 3], m)
    reduce_row(rows[2], free, J[HEIGHT])
    r[HEIGHT] = q[2] - robot.q_stance[2]
    m.over[k, LOWEST] = robot.limits[2] - q[2]
    for i in range(N_JOINTS):
        x = q[7 + i]
        r[JOINTS + i] = x - robot.q_stance[7 + i]
        high = x > 0.5 * (robot.q_min[i] + robot.q_max[i])
        m.sign[k, LIMIT + i] = 1.0 if high else -1.0
        m.over[k, LIMIT + i] = x - robot.q_max[i] if high else robot.q_min[i] - x
    for e in range(robot.normals.shape[0]):
        x, y = q[0] + com[1] / robot.mass, q[1] + com[2] / robot.mass
        m.over[k, EDGE + e] = robot.normals[e, 0] * x + robot.normals[e, 1] * y - robot.com_offsets[e]


def upright(R, w):
    """Rotation vector of a rotation (3, 3)."""
    s0, s1, s2 = R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]
    s = 0.5 * math.sqrt(s0 * s0 + s1 * s1 + s2 * s2)
    angle = math.atan2(s, 0.5 * (R[0, 0] + R[1, 1] + R[2, 2] - 1.0))
    scale = 0.5 * angle / s if s > 1e-7 else 0.5
    w[0], w[1], w[2] = scale * s0, scale * s1, scale * s2


def tilt(k, f, R, limit, turn, m):
    """The bound on a tilt; ``turn`` (3, N_FREE) are the rows of the frame's orientation."""
    x, y = R[0, 2], R[1, 2]
    lean = math.sqrt(x * x + y * y)
    m.over[k, TILT + f] = math.atan2(lean, R[2, 2]) - limit
    for j in range(turn.shape[1]):
        m.J_tilt[k, f, j] = (x * turn[1, j] - y * turn[0, j]) / lean if lean > 1e-6 else 0.0
