"""The contacts eliminated: accelerations that they allow, and what point forces do to the robot."""

from __future__ import annotations

from wholebody.jit.arrays import Indices, Matrix
from wholebody.jit.packed import Packed
from wholebody.qp.kernels.linear_algebra import inverse_6, null_space, particular
from wholebody.robot.kernels.rotation import rotate, rotation_between


def contacts(tick: Packed) -> bool:
    """Fill ``Z``, ``dv_p``, the contact points and ``W``; False if the contacts depend on each other."""
    for c in range(tick.n_contacts):
        point_offsets(tick, c)
        foot_target(tick, c)
    if not allowed_motion(tick):
        return False
    contact_gram(tick.points, tick.loaded, tick.gram)
    return inverse_6(tick.gram, tick.K, tick.W)


def allowed_motion(tick: Packed) -> bool:
    """Basis ``Z`` of what the contacts allow and the shortest ``dv_p`` with ``J dv_p = contact_target``."""
    B, beta, bound, J, target, goal, standing = (
        tick.B, tick.beta, tick.bound_columns, tick.J, tick.contact_target, tick.contact_goal, tick.standing
    )  # fmt: skip
    m, n = B.shape
    for r in range(m):
        row = 6 * standing[r // 6] + r % 6
        goal[r] = target[row]
        for i in range(n):
            B[r, i] = J[row, bound[i]]
    if not null_space(B, m, n, beta, tick.Z):
        return False
    particular(B, beta, m, n, goal, tick.dv_p)
    return True


def foot_target(tick: Packed, c: int) -> None:
    """Wanted acceleration of contact ``c``, as `FootContact.acceleration`."""
    q, x, velocity, drift, kp, kd = (
        tick.q,
        tick.frame_p[c],
        tick.frame_V[c],
        tick.frame_A[c],
        tick.foot_kp,
        tick.foot_kd,
    )
    p_ref, turn, out = tick.foot_p_ref[c], tick.scratch, tick.contact_target[6 * c : 6 * c + 6]
    rotation_between(tick.foot_R_ref[c], tick.frame_R[c], turn)
    for k in range(3):
        out[k] = -drift[k] - kd * velocity[k] + kp * (p_ref[k] - q[k] - x[k])
        out[3 + k] = -drift[3 + k] - kd * velocity[3 + k] + kp * turn[k]


def point_offsets(tick: Packed, c: int) -> None:
    """Points of contact ``c`` from the base, world axes."""
    R, x, local, points = tick.frame_R[c], tick.frame_p[c], tick.points_local, tick.points
    each = local.shape[0] // tick.n_contacts
    for i in range(each * c, each * (c + 1)):
        for a in range(3):
            points[i, a] = x[a] + rotate(R, a, local[i, 0], local[i, 1], local[i, 2])


def contact_gram(P: Matrix, loaded: Indices, gram: Matrix) -> None:
    """``G G'`` (6, 6) of the contact points ``loaded`` (n,) of those at offsets P (k, 3)."""
    for a in range(6):
        for b in range(6):
            gram[a, b] = 0.0
    n = loaded.shape[0]
    for k in range(n):
        i = loaded[k]
        x, y, z = P[i, 0], P[i, 1], P[i, 2]
        gram[0, 4] += z
        gram[0, 5] -= y
        gram[1, 3] -= z
        gram[1, 5] += x
        gram[2, 3] += y
        gram[2, 4] -= x
        gram[3, 3] += y * y + z * z
        gram[4, 4] += x * x + z * z
        gram[5, 5] += x * x + y * y
        gram[3, 4] -= x * y
        gram[3, 5] -= x * z
        gram[4, 5] -= y * z
    for a in range(3):
        gram[a, a] = n
    for a in range(6):
        for b in range(a):
            gram[a, b] = gram[b, a]
