"""Centre of mass, centroidal momentum and palms in many configurations."""

from __future__ import annotations

import numpy as np

from wholebody.jit.arrays import Indices, Matrix
from wholebody.robot.kernels.bodies import base_twist, joint_column, place_body
from wholebody.robot.kernels.frames import PALM_FRAME, place_frame
from wholebody.robot.kernels.rotation import base_rotation
from wholebody.robot.kernels.spatial import body_inertia, momentum_of
from wholebody.trajopt.arrays import Tables
from wholebody.trajopt.layout import LOWER, N_JOINTS


def centroidal(
    table: Matrix, parent: Indices, frame_body: Indices, frame_R: np.ndarray, q: Matrix, v: Matrix, com: Matrix,
    velocity: Matrix, momentum: Matrix, turns: np.ndarray, R: np.ndarray, p: Matrix, V: Matrix, scratch: Matrix
) -> None:  # fmt: skip
    """Fill centre of mass, its velocity, angular momentum about it, and turns of frames, at every row.

    Args:
        table: Bodies (n, 25).
        parent: Their parents (n,).
        frame_body: Bodies of the frames (f,).
        frame_R: Rotations of the frames there (f, 3, 3).
        q: Configurations (K, nq).
        v: Velocities (K, nv).
        com: Out (K, 3).
        velocity: Out (K, 3).
        momentum: Out (K, 3).
        turns: Out (f, K, 3, 3).
        R: Scratch, rotations of the bodies (n, 3, 3).
        p: Scratch, their places (n, 3).
        V: Scratch, their twists (n, 6).
        scratch: (4, 10).
    """
    inertia, h, s, total = scratch[0], scratch[1], scratch[2], scratch[3]
    for k in range(q.shape[0]):
        base_rotation(q[k], R[0])
        for c in range(10):
            total[c] = 0.0
        base_twist(v[k], R[0], V[0])
        for a in range(3):
            p[0, a] = 0.0
        for i in range(table.shape[0]):
            if i > 0:
                before, rate = parent[i], v[k, 5 + i]
                place_body(table[i], q[k, 6 + i], R[before], p[before], R[i], p[i])
                joint_column(table[i], R[i], p[i], s)
                for c in range(6):
                    V[i, c] = V[before, c] + rate * s[c]
            body_inertia(table[i], R[i], p[i], inertia)
            momentum_of(inertia, V[i], h)
            for c in range(4):
                total[c] += inertia[c]
            for c in range(6):
                total[4 + c] += h[c]
        m, x, y, z = total[0], total[1] / total[0], total[2] / total[0], total[3] / total[0]
        com[k, 0], com[k, 1], com[k, 2] = q[k, 0] + x, q[k, 1] + y, q[k, 2] + z
        for a in range(3):
            velocity[k, a] = total[4 + a] / m
        momentum[k, 0] = total[7] - (y * total[6] - z * total[5])
        momentum[k, 1] = total[8] - (z * total[4] - x * total[6])
        momentum[k, 2] = total[9] - (x * total[5] - y * total[4])
        for f in range(frame_body.shape[0]):
            body = frame_body[f]
            place_frame(R[body], p[body], frame_R[f], scratch[2], turns[f, k], scratch[1])


def place_palms(robot: Tables, q: Matrix, T: np.ndarray, R: np.ndarray, p: Matrix) -> None:
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
            body = robot.frame_body[PALM_FRAME + f]
            place_frame(R[body], p[body], robot.frame_R[PALM_FRAME + f], robot.frame_p[PALM_FRAME + f], T[k, f], offset)
            for a in range(3):
                T[k, f, a, 3], T[k, f, 3, a] = q[k, a] + offset[a], 0.0
            T[k, f, 3, 3] = 1.0
