"""Residuals of one configuration with their Jacobian, and its bounds on tilt, height, joints and centre of mass."""

from __future__ import annotations

import math

import numpy as np

from wholebody.jit.arrays import Matrix, Vector
from wholebody.robot.kernels.frames import PALM_FRAME, PELVIS_FRAME, TORSO_FRAME, place_frame
from wholebody.robot.kernels.rotation import logarithm, rotation_between
from wholebody.robot.kernels.spatial import (
    add_cross_force,
    add_force_at,
    body_inertia,
    cross,
    cross_motion,
    dot6,
    momentum_of,
)
from wholebody.trajopt.arrays import KnotTargets, Tables
from wholebody.trajopt.kernels.fixed_feet_kinematics import frame_rows, restore_feet
from wholebody.trajopt.layout import (  # fmt: skip
    BASE_HEIGHT,
    COM,
    COM_EDGE,
    FREE_LOWER,
    HEIGHT,
    JOINTS,
    LOWER,
    N_BODY,
    N_JOINTS,
    PELVIS,
    POSITION,
    STATIC,
    TILT,
    TORSO,
    UPPER,
    WAIST,
)
from wholebody.trajopt.workspace import KnotMotion, KnotScratch


def composite_inertias(
    robot: Tables, R: np.ndarray, p: Matrix, S: Matrix, inertia: Matrix, I_composite: Matrix, F: Matrix
) -> None:
    """Inertias (30, 10) of the bodies, of each with all that hangs on it, and forces ``F`` for unit accelerations."""
    n = inertia.shape[0]
    for i in range(n):
        body_inertia(robot.bodies[i], R[i], p[i], inertia[i])
        for c in range(10):
            I_composite[i, c] = inertia[i, c]
    for i in range(n - 1, 0, -1):
        k = robot.parent[i]
        for c in range(10):
            I_composite[k, c] += I_composite[i, c]
        momentum_of(I_composite[i], S[5 + i], F[5 + i])
    for j in range(6):
        momentum_of(I_composite[0], S[j], F[j])


def reduce_row(row: Vector, free: Matrix, out: Vector) -> None:
    """A row (N_BODY,) in the free directions, (N_FREE,)."""
    for r in range(FREE_LOWER):
        d = 0.0
        for j in range(LOWER):
            d += row[j] * free[r, j]
        out[r] = d
    for j in range(UPPER):
        out[FREE_LOWER + j] = row[LOWER + j]


def configuration_terms(k: int, robot: Tables, task: KnotTargets, m: KnotMotion, work: KnotScratch) -> None:
    """Put the feet of knot ``k`` back; fill palms, inertias, ``r`` and ``J``, and the bounds on configurations."""
    q, free, R, p, S, r, J = m.q[k], m.free[k], m.R[k], m.p[k], m.S[k], m.r[k], m.J[k]
    restore_feet(q, robot, R, p, S, free, work)
    composite_inertias(robot, R, p, S, m.inertia[k], m.I_composite[k], m.F[k])
    rows = work.rows
    for f in range(2):
        frame = PALM_FRAME + f
        body = robot.frame_body[frame]
        place_frame(R[body], p[body], robot.frame_R[frame], robot.frame_p[frame], work.R, work.p)
        frame_rows(S, robot.carries[frame], work.p, rows)
        rotation_between(work.R, task.T_palms[k, f, :3, :3], r[6 * f + 3 : 6 * f + 6])
        for a in range(3):
            m.palms[k, f, a, 3] = q[a] + work.p[a]
            r[6 * f + a] = m.palms[k, f, a, 3] - task.T_palms[k, f, a, 3] + task.offset[k, 6 * f + a]
            r[6 * f + 3 + a] += task.offset[k, 6 * f + 3 + a]
            for b in range(3):
                m.palms[k, f, a, b] = work.R[a, b]
        for a in range(6):
            reduce_row(rows[a], free, J[6 * f + a])
    com = m.I_composite[k, 0]
    for a in range(2):
        r[COM + a] = q[a] + com[1 + a] / robot.mass - robot.com_stance[a]
        for j in range(N_BODY):
            rows[a, j] = m.F[k, j, a] / robot.mass
        reduce_row(rows[a], free, J[COM + a])
    for f in range(2):
        frame, start = TORSO_FRAME if f == 0 else PELVIS_FRAME, TORSO if f == 0 else PELVIS
        body = robot.frame_body[frame]
        place_frame(R[body], p[body], robot.frame_R[frame], robot.frame_p[frame], work.R, work.p)
        frame_rows(S, robot.carries[frame], work.p, rows)
        logarithm(work.R, r[start : start + 3])
        for a in range(3):
            reduce_row(rows[3 + a], free, J[start + a])
        tilt(k, f, work.R, robot.limits[f], J[start : start + 3], m)
    reduce_row(rows[2], free, J[HEIGHT])
    r[HEIGHT] = q[2] - robot.q_stance[2]
    m.violation[k, BASE_HEIGHT] = robot.limits[2] - q[2]
    for i in range(N_JOINTS):
        x = q[7 + i]
        r[JOINTS + i] = x - robot.q_stance[7 + i]
        high = x > 0.5 * (robot.q_min[i] + robot.q_max[i])
        m.sign[k, POSITION + i] = 1.0 if high else -1.0
        m.violation[k, POSITION + i] = x - robot.q_max[i] if high else robot.q_min[i] - x
    for e in range(robot.normals.shape[0]):
        x, y = q[0] + com[1] / robot.mass, q[1] + com[2] / robot.mass
        m.violation[k, COM_EDGE + e] = robot.normals[e, 0] * x + robot.normals[e, 1] * y - robot.com_offsets[e]


def tilt(k: int, f: int, R: Matrix, limit: float, turn: Matrix, m: KnotMotion) -> None:
    """The bound on a tilt; ``turn`` (3, N_FREE) are the rows of the frame's orientation."""
    x, y = R[0, 2], R[1, 2]
    lean = math.sqrt(x * x + y * y)
    m.violation[k, TILT + f] = math.atan2(lean, R[2, 2]) - limit
    for j in range(turn.shape[1]):
        m.J_tilt[k, f, j] = (x * turn[1, j] - y * turn[0, j]) / lean if lean > 1e-6 else 0.0


def static_torque(k: int, robot: Tables, task: KnotTargets, m: KnotMotion, work: KnotScratch) -> None:
    """Bounds STATIC of knot ``k`` on torques with which the waist would hold the upper body still, and derivatives.

    Accelerations from knot to knot can lower the torques at the knots below those in between. Where the waist could
    hold the upper body at rest, the robot can stop anywhere. As `inverse_dynamics.torques` without velocities.
    """
    S, F, row, six = m.S[k], m.F[k], work.rows[0], work.six
    lift, lift_rate, force, force_rate = six[0], six[1], six[2], six[3]
    for a in range(3):
        lift[a], lift[3 + a] = -robot.gravity[a], 0.0
    for w in range(WAIST):
        i = LOWER + w
        momentum_of(m.I_composite[k, i - 5], lift, force)
        torque = dot6(S[i], force)
        if task.pushed:
            torque -= pushed_torque(k, i, robot, task.pushes[k], m, work)
        m.sign[k, STATIC + w] = 1.0 if torque > 0.0 else -1.0
        m.violation[k, STATIC + w] = abs(torque) / robot.tau_max[w] - 1.0
        for j in range(N_BODY):
            row[j] = 0.0
        for j in range(6):
            cross_motion(lift, S[j], lift_rate)
            row[j] = dot6(F[i], lift_rate)
        up = i - 5
        while up > 0:
            cross_motion(lift, S[5 + up], lift_rate)
            row[5 + up] = dot6(F[i], lift_rate)
            up = robot.parent[up]
        # What hangs on the waist changes its torque by how its own weight turns.
        for j in range(i + 1, N_BODY):
            momentum_of(m.I_composite[k, j - 5], lift, force)
            cross_motion(lift, S[j], lift_rate)
            momentum_of(m.I_composite[k, j - 5], lift_rate, force_rate)
            add_cross_force(S[j], force, force_rate)
            row[j] = dot6(S[i], force_rate)
        if task.pushed:
            turn_pushed_torque(k, i, robot, task.pushes[k], m, work)
        reduce_row(row, m.free[k], m.J_static[k, w])


def pushed_torque(k: int, i: int, robot: Tables, pushes: Vector, m: KnotMotion, work: KnotScratch) -> float:
    """Torque of what pushes the palms (6,) about joint ``i`` [N m]."""
    torque, w = 0.0, work.six[4]
    for h in range(2):
        palm_push(k, h, pushes, m, work.p, w)
        if robot.carries[PALM_FRAME + h, i]:
            torque += dot6(m.S[k, i], w)
    return torque


def turn_pushed_torque(k: int, i: int, robot: Tables, pushes: Vector, m: KnotMotion, work: KnotScratch) -> None:
    """Take its derivatives off ``work.rows[0]``: the force keeps its direction, its place moves with the palm."""
    S, row, x, w, g, turn = m.S[k], work.rows[0], work.p, work.six[4], work.six[5], work.six[6]
    for h in range(2):
        palm_push(k, h, pushes, m, x, w)
        for j in range(N_BODY):
            if robot.carries[PALM_FRAME + h, i] and robot.carries[PALM_FRAME + h, j]:
                turn[:] = 0.0
                cross(S[j, 3:], pushes[3 * h : 3 * h + 3], g)
                add_force_at(x, -g[0], -g[1], -g[2], turn)
                if j > i:
                    add_cross_force(S[j], w, turn)
                row[j] -= dot6(S[i], turn)


def palm_push(k: int, h: int, pushes: Vector, m: KnotMotion, x: Vector, w: Vector) -> None:
    """Place ``x`` (3,) of a palm from the base, and the wrench ``w`` (6,) of what pushes it, about the base."""
    w[:] = 0.0
    for a in range(3):
        x[a] = m.palms[k, h, a, 3] - m.q[k, a]
    add_force_at(x, pushes[3 * h], pushes[3 * h + 1], pushes[3 * h + 2], w)
