"""The cubic B-spline of a plan, whose control points the knots are.

At a knot its acceleration is the second difference of the control points, and changes linearly from there to the next.
It begins at a given position with a given velocity, from which the first control point follows (`FIRST_RATE`).
"""

from __future__ import annotations

from wholebody.robot.kernels.bodies import place_body
from wholebody.robot.kernels.frames import PALM_FRAME, place_frame
from wholebody.robot.kernels.rotation import base_rotation, rotation_between
from wholebody.trajopt.arrays import KnotTargets, Tables
from wholebody.trajopt.kernels.fixed_feet_kinematics import integrate
from wholebody.trajopt.layout import FIRST_RATE, LOWER, N_JOINTS, UPPER
from wholebody.trajopt.workspace import KnotMotion, KnotScratch


def knot_rate(k: int, K: int, dt: float) -> float:
    """Factor of the difference between knots k - 1 and k in the velocity between them [1/s]; 0 at both ends."""
    if k in (0, K):
        return 0.0
    return FIRST_RATE / dt if k == 1 else 1.0 / dt


def spline_offset(
    robot: Tables, task: KnotTargets, m: KnotMotion, other: KnotMotion, largest: float, work: KnotScratch
) -> None:
    """Put the palms of ``m.r`` on the spline, which is a sixth of the second difference away from a control point.

    Args:
        robot: The robot.
        task: What is asked; its offset is replaced.
        m: The motion, whose rows of the palms change by as much.
        other: Scratch, another motion.
        largest: Most that counts of an offset, in each coordinate [m, rad].
        work: Scratch.
    """
    share = task.dt**2 / 6.0
    for k in range(1, m.q.shape[0]):
        q, R, p, step, w = other.q[k], other.R[k], other.p[k], work.lower_step, work.six[0]
        for j in range(m.q.shape[1]):
            q[j] = m.q[k, j]
        for j in range(LOWER):
            step[j] = share * m.a[k, j]
        integrate(q, step)
        for u in range(UPPER):
            q[1 + LOWER + u] += share * m.a[k, LOWER + u]
        base_rotation(q, R[0])
        for a in range(3):
            p[0, a] = 0.0
        for i in range(LOWER - 5, N_JOINTS + 1):
            before = robot.parent[i]
            place_body(robot.bodies[i], q[6 + i], R[before], p[before], R[i], p[i])
        for f in range(2):
            body = robot.frame_body[PALM_FRAME + f]
            place_frame(R[body], p[body], robot.frame_R[PALM_FRAME + f], robot.frame_p[PALM_FRAME + f], work.R, work.p)
            rotation_between(work.R, m.palms[k, f, :3, :3], w)
            for a in range(3):
                replace(k, 6 * f + a, q[a] + work.p[a] - m.palms[k, f, a, 3], largest, task, m)
                replace(k, 6 * f + 3 + a, w[a], largest, task, m)


def replace(k: int, row: int, offset: float, largest: float, task: KnotTargets, m: KnotMotion) -> None:
    """Put one coordinate of an offset in place of what it was."""
    offset = min(max(offset, -largest), largest)
    m.r[k, row] += offset - task.offset[k, row]
    task.offset[k, row] = offset
