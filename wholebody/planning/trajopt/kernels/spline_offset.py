"""How far the curve that has the knots as control points bends away from them; compiles with numba as it stands."""

from __future__ import annotations

from wholebody.planning.trajopt.kernels.fixed_feet_kinematics import (
    base_rotation,
    fixed_frame,
    move,
    place_body,
    turn_between,
)
from wholebody.planning.trajopt.layout import LOWER, N_JOINTS, UPPER


def bend(robot, task, m, other, largest, work):
    """Judge the palms on the curve: a control point is a sixth of its second difference away from it.

    Args:
        robot: The robot.
        task: What is asked; its bend is replaced.
        m: The motion, whose rows of the palms change by as much.
        other: Scratch, another motion.
        largest: By which a palm is taken to bend at most, in each coordinate [m, rad].
        work: Scratch.
    """
    share = task.dt**2 / 6.0
    for k in range(1, m.q.shape[0]):
        q, R, p, step, w = other.q[k], other.R[k], other.p[k], work.lower_step, work.six[0]
        for j in range(m.q.shape[1]):
            q[j] = m.q[k, j]
        for j in range(LOWER):
            step[j] = share * m.a[k, j]
        move(q, step)
        for u in range(UPPER):
            q[1 + LOWER + u] += share * m.a[k, LOWER + u]
        base_rotation(q, R[0])
        for a in range(3):
            p[0, a] = 0.0
        for i in range(LOWER - 5, N_JOINTS + 1):
            before = robot.parent[i]
            place_body(robot.bodies[i], q[6 + i], R[before], p[before], R[i], p[i])
        for f in range(2):
            body = robot.frame_body[f]
            fixed_frame(R[body], p[body], robot.frame_R[f], robot.frame_p[f], work.R, work.p)
            turn_between(work.R, m.palms[k, f, :3, :3], w)
            for a in range(3):
                replace(k, 6 * f + a, q[a] + work.p[a] - m.palms[k, f, a, 3], largest, task, m)
                replace(k, 6 * f + 3 + a, w[a], largest, task, m)


def replace(k, row, bend, largest, task, m):
    """Put one coordinate of a bend in place of what it was."""
    bend = min(max(bend, -largest), largest)
    m.r[k, row] += bend - task.bend[k, row]
    task.bend[k, row] = bend
