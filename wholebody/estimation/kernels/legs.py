"""Legs in the axes of the base: where the soles are, and what the floor presses them with; compiles as it stands.

The torques of a leg less those that carry its own weight leave the wrench of the floor: ``J' f = tau_own - tau``, six
rows for six numbers. The weight is what the accelerometer feels; that a leg moves beside it is left out: one that
stands hardly does.
"""

from __future__ import annotations

from wholebody.jit.arrays import Matrix, Vector
from wholebody.jit.packed import Packed
from wholebody.robot.kernels.bodies import LEVER, MASS, place_bodies
from wholebody.robot.kernels.rotation import rotate
from wholebody.robot.kernels.spatial import add_force_at, dot6, velocity_at

LEG = 6
"""Joints of a leg: six, as a wrench has numbers."""
PIVOT_MIN = 1e-3
"""Least pivot [m, no unit] of a leg's Jacobian that tells the wrench; chosen: a stretched knee is below."""


def place_soles(memory: Packed, q: Vector) -> None:
    """Places and joint columns of the bodies of the legs, and the middles ``h`` of the soles from the IMU.

    Args:
        memory: As in `wholebody.estimation.state_estimator`; ``R p S h`` are changed.
        q: Positions of all joints (n,) [rad].
    """
    R, p, parent, joint = memory.R, memory.p, memory.parent, memory.joint
    for i in range(joint.shape[0]):
        memory.angles[7 + i] = q[joint[i]]
    place_bodies(memory.angles, memory.table, parent, 1, parent.shape[0], R, p, memory.S)
    for foot in range(2):
        body, sole = memory.ankle[foot], memory.sole[foot]
        for k in range(3):
            memory.h[foot, k] = p[body, k] + rotate(R[body], k, sole[0], sole[1], sole[2]) - memory.imu[k]


def sole_speed(memory: Packed, foot: int, dq: Vector) -> tuple[float, float, float]:
    """Velocity of the middle of a sole, as seen from the turning base, plus that of the turn about the IMU."""
    body, twist, place = memory.ankle[foot], memory.wrench[foot], memory.place
    for k in range(6):
        twist[k] = 0.0
    while body > 0:
        for k in range(6):
            twist[k] += dq[memory.joint[body - 1]] * memory.S[5 + body, k]
        body = memory.parent[body]
    for k in range(3):
        place[k] = memory.h[foot, k] + memory.imu[k]
    x, y, z = velocity_at(twist, place)
    w, h = memory.gyro, memory.h[foot]
    return x + w[1] * h[2] - w[2] * h[1], y + w[2] * h[0] - w[0] * h[2], z + w[0] * h[1] - w[1] * h[0]


def press(memory: Packed, tau: Vector, keep: float) -> None:
    """Low-pass how hard the floor presses on each sole along its normal, ``memory.pressed`` (2,) [N].

    Args:
        memory: After `place_soles`, with the specific force ``felt`` (3,) [m/s^2].
        tau: Torques of all joints (n,) [N m].
        keep: Share that the filter keeps, 0 to 1.
    """
    S, parent, joint, J, force, place = memory.S, memory.parent, memory.joint, memory.J, memory.force, memory.place
    for foot in range(2):
        body, f = memory.ankle[foot], memory.wrench[foot]
        R = memory.R[body]
        for k in range(6):
            force[k] = 0.0
        for row in range(LEG):
            carry(memory, body, place, force)
            f[row] = dot6(S[5 + body], force) - tau[joint[body - 1]]
            for k in range(6):
                J[row, k] = S[5 + body, k]
            body = parent[body]
        if solve6(J, f):
            normal = R[0, 2] * f[0] + R[1, 2] * f[1] + R[2, 2] * f[2]
            memory.pressed[foot] = keep * memory.pressed[foot] + (1.0 - keep) * normal


def carry(memory: Packed, body: int, place: Vector, force: Vector) -> None:
    """Add what carries a body, its mass times the specific force, to a wrench about the base (6,)."""
    R, p, row, f = memory.R[body], memory.p[body], memory.table[body], memory.felt
    for k in range(3):
        place[k] = p[k] + rotate(R, k, row[LEVER], row[LEVER + 1], row[LEVER + 2])
    add_force_at(place, row[MASS] * f[0], row[MASS] * f[1], row[MASS] * f[2], force)


def solve6(A: Matrix, b: Vector) -> bool:
    """Solve ``A x = b``, A (6, 6), in place by elimination with row exchanges, x in ``b``; False if there is none."""
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
