"""Where the palms are in many configurations."""

from __future__ import annotations

from wholebody.planning.trajopt.layout import LOWER, N_JOINTS
from wholebody.robot.kernels.bodies import place_body
from wholebody.robot.kernels.frames import place_frame
from wholebody.robot.kernels.rotation import base_rotation


def place_palms(robot, q, T, R, p) -> None:
    """Fill poses of both palms in world at every row.

    Args:
        robot: The robot.
        q: Configurations of the body (n, 36).
        T: Out, poses (n, 2, 4, 4).
        R: Scratch, rotations of the bodies (1 + N_JOINTS, 3, 3).
        p: Scratch, their places from the origin of the base, and one more (2 + N_JOINTS, 3).
    """
    offset = p[1 + N_JOINTS]
    for k in range(q.shape[0]):
        base_rotation(q[k], R[0])
        for a in range(3):
            p[0, a] = 0.0
        # The legs, which come first, do not move palms.
        for i in range(LOWER - 5, N_JOINTS + 1):
            before = robot.parent[i]
            place_body(robot.bodies[i], q[k, 6 + i], R[before], p[before], R[i], p[i])
        for f in range(2):
            body = robot.frame_body[f]
            place_frame(R[body], p[body], robot.frame_R[f], robot.frame_p[f], T[k, f], offset)
            for a in range(3):
                T[k, f, a, 3], T[k, f, 3, a] = q[k, a] + offset[a], 0.0
            T[k, f, 3, 3] = 1.0
