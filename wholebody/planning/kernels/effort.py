"""Torques of waist and arms along a motion."""

from __future__ import annotations

import numpy as np

from wholebody.jit.arrays import Matrix
from wholebody.robot.kernels.bodies import base_twist, joint_column, place_body
from wholebody.robot.kernels.frames import PALM_FRAME
from wholebody.robot.kernels.rotation import base_rotation
from wholebody.robot.kernels.spatial import add_cross_force, add_force_at, body_inertia, cross_motion, dot6, momentum_of
from wholebody.trajopt.arrays import Tables
from wholebody.trajopt.layout import LOWER, N_JOINTS


def effort(
    robot: Tables, q: Matrix, v: Matrix, a: Matrix, pushes: np.ndarray, torque: Matrix, R: np.ndarray, p: Matrix,
    S: Matrix, V: Matrix, A: Matrix, f: Matrix, scratch: Matrix
) -> None:  # fmt: skip
    """Fill the torques of waist and arms at every row; what the legs do does not matter to them.

    Recursive Newton-Euler in world axes about the base, as `wholebody.trajopt.kernels.inverse_dynamics`.

    Args:
        robot: `wholebody.trajopt.arrays.Tables`.
        q: Configurations of the body (n, 36).
        v: Velocities (n, 35), the base's in its own axes.
        a: Their derivatives (n, 35).
        pushes: Forces on both palms (n, 2, 3), world axes [N]; empty if there are none.
        torque: Out (n, UPPER) [N m].
        R: Scratch, rotations of the bodies (1 + N_JOINTS, 3, 3).
        p: Scratch, their places from the origin of the base (1 + N_JOINTS, 3).
        S: Scratch, columns of their joints (1 + N_JOINTS, 6).
        V: Scratch, their twists (1 + N_JOINTS, 6).
        A: Scratch, their accelerations (1 + N_JOINTS, 6).
        f: Scratch, forces on them with all that hangs on them (1 + N_JOINTS, 6).
        scratch: (3, 10).
    """
    inertia, h, bias = scratch[0], scratch[1], scratch[2]
    first = LOWER - 5
    for k in range(q.shape[0]):
        base_rotation(q[k], R[0])
        base_twist(v[k], R[0], V[0])
        base_twist(a[k], R[0], A[0])
        for c in range(3):
            p[0, c] = 0.0
            A[0, c] -= robot.gravity[c]
        for i in range(first, N_JOINTS + 1):
            before, rate = robot.parent[i], v[k, 5 + i]
            place_body(robot.bodies[i], q[k, 6 + i], R[before], p[before], R[i], p[i])
            joint_column(robot.bodies[i], R[i], p[i], S[i])
            cross_motion(V[before], S[i], bias)
            for c in range(6):
                V[i, c] = V[before, c] + rate * S[i, c]
                A[i, c] = A[before, c] + a[k, 5 + i] * S[i, c] + rate * bias[c]
            body_inertia(robot.bodies[i], R[i], p[i], inertia)
            momentum_of(inertia, V[i], h)
            momentum_of(inertia, A[i], f[i])
            add_cross_force(V[i], h, f[i])
        if pushes.shape[0] > 0:
            for palm in range(2):
                body, x, w = robot.frame_body[PALM_FRAME + palm], robot.frame_p[PALM_FRAME + palm], pushes[k, palm]
                for c in range(3):
                    row = R[body, c]
                    bias[c] = p[body, c] + row[0] * x[0] + row[1] * x[1] + row[2] * x[2]
                add_force_at(bias, -w[0], -w[1], -w[2], f[body])
        for i in range(N_JOINTS, first - 1, -1):
            before = robot.parent[i]
            torque[k, i - first] = dot6(S[i], f[i])
            if before >= first:
                for c in range(6):
                    f[before, c] += f[i, c]
