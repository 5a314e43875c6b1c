"""Legs in the axes of the base: where the soles are, and what the floor presses them with; compiles as it stands.

The torques of a leg and its own weight and inertia leave the wrench of the floor: ``J' f = tau_own - tau``, six rows for
six numbers. The specific force that the accelerometer feels is what the leg has to be carried against; accelerations
of the joints relative to the base are left out: a leg that stands hardly has any.
"""

from __future__ import annotations

from wholebody.jit.packed import Packed
from wholebody.robot.kernels.bodies import place_bodies
from wholebody.robot.kernels.rigid_body import body_force, move_body
from wholebody.robot.kernels.rotation import rotate
from wholebody.robot.kernels.spatial import body_inertia, dot6

LEG = 6
"""Joints of a leg: six, as a wrench has numbers."""
PIVOT_MIN = 1e-3
"""Least pivot [m, no unit] of a leg's Jacobian that tells the wrench; chosen: a stretched knee is below."""


def place_soles(memory: Packed, q, dq) -> None:
    """Places, twists and rotations of the bodies of the legs, and the middles of the soles from the IMU.

    Args:
        memory: As in `wholebody.estimation.state_estimator.memory`; ``R p S V`` and ``h`` of the soles are changed.
        q: Positions of all joints (n,) [rad].
        dq: Speeds likewise.
    """
    R, p, S, V, parent, joint = memory.R, memory.p, memory.S, memory.V, memory.parent, memory.joint
    for i in range(joint.shape[0]):
        memory.angles[7 + i] = q[joint[i]]
    place_bodies(memory.angles, memory.table, parent, 1, parent.shape[0], R, p, S)
    for k in range(6):
        V[0, k] = memory.gyro[k - 3] if k > 2 else 0.0
    for i in range(1, parent.shape[0]):
        move_body(S[5 + i], dq[joint[i - 1]], V[parent[i]], memory.A[parent[i]], V[i], memory.A[i])
    for foot in range(2):
        body, sole = memory.ankle[foot], memory.sole[foot]
        for k in range(3):
            memory.h[foot, k] = p[body, k] + rotate(R[body], k, sole[0], sole[1], sole[2]) - memory.imu[k]


def press(memory: Packed, tau, keep) -> None:
    """Low-pass how hard the floor presses on each sole along its normal, ``memory.pressed`` (2,) [N].

    Args:
        memory: After `place_soles`, with the specific force ``felt`` (3,) [m/s^2].
        tau: Torques of all joints (n,) [N m].
        keep: Share that the filter keeps, 0 to 1.
    """
    table, parent, force, joint = memory.table, memory.parent, memory.force, memory.joint
    for k in range(3):
        memory.falling[k] = -memory.felt[k]
    for i in range(1, parent.shape[0]):
        body_inertia(table[i], memory.R[i], memory.p[i], memory.inertia)
        body_force(memory.inertia, memory.V[i], memory.A[i], memory.falling, memory.h6, force[i], memory.lifted)
    for i in range(parent.shape[0] - 1, 0, -1):
        memory.missing[i - 1] = dot6(memory.S[5 + i], force[i]) - tau[joint[i - 1]]
        if parent[i] > 0:
            for k in range(6):
                force[parent[i], k] += force[i, k]
    for foot in range(2):
        body, J, f = memory.ankle[foot], memory.J, memory.wrench[foot]
        for row in range(LEG):
            f[row] = memory.missing[body - 1]
            for k in range(6):
                J[row, k] = memory.S[5 + body, k]
            body = parent[body]
        if solve6(J, f):
            R = memory.R[memory.ankle[foot]]
            normal = R[0, 2] * f[0] + R[1, 2] * f[1] + R[2, 2] * f[2]
            memory.pressed[foot] = keep * memory.pressed[foot] + (1.0 - keep) * normal


def solve6(A, b) -> bool:
    """Solve ``A x = b`` in place by elimination with row exchanges; the answer is in ``b``, False if there is none."""
    n = b.shape[0]
    for c in range(n):
        best = c
        for r in range(c + 1, n):
            if abs(A[r, c]) > abs(A[best, c]):
                best = r
        if not abs(A[best, c]) > PIVOT_MIN:
            return False
        if best != c:
            for k in range(c, n):
                A[c, k], A[best, k] = A[best, k], A[c, k]
            b[c], b[best] = b[best], b[c]
        for r in range(c + 1, n):
            factor = A[r, c] / A[c, c]
            for k in range(c, n):
                A[r, k] -= factor * A[c, k]
            b[r] -= factor * b[c]
    for c in range(n - 1, -1, -1):
        for k in range(c + 1, n):
            b[c] -= A[c, k] * b[k]
        b[c] /= A[c, c]
    return True
