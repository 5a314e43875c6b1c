"""Where bodies, centre of mass and frames are, and what their weight asks of the joints.

``tick`` is the memory of `wholebody.backends.kinematic.workspace`, here and in `program`.
"""

from __future__ import annotations

from wholebody.jit.arrays import Vector
from wholebody.jit.packed import Packed
from wholebody.qp.kernels.contacts import contact_gram, point_offsets
from wholebody.qp.kernels.linear_algebra import dot, inverse_6
from wholebody.robot.kernels.bodies import LEVER, MASS, place_base, place_bodies
from wholebody.robot.kernels.frames import frame_columns, place_frames
from wholebody.robot.kernels.rotation import rotate
from wholebody.robot.kernels.spatial import add_force_at, dot6, velocity_at


def place(tick: Packed, q: Vector) -> None:
    """Bodies at ``q`` (nq,), columns, and mass and mass times centre of every subtree (``mass_moment``)."""
    R, p, S, bodies, parent, moment = tick.R, tick.p, tick.S, tick.bodies, tick.parent, tick.mass_moment
    n = parent.shape[0]
    place_base(q, R[0], p[0], S)
    place_bodies(q, bodies, parent, 1, n, R, p, S)
    for i in range(n):
        row = bodies[i]
        moment[i, 0] = row[MASS]
        for a in range(3):
            moment[i, 1 + a] = row[MASS] * (p[i, a] + rotate(R[i], a, row[LEVER], row[LEVER + 1], row[LEVER + 2]))
    for i in range(n - 1, 0, -1):
        for a in range(4):
            moment[parent[i], a] += moment[i, a]


def centre(tick: Packed) -> None:
    """Centre of mass into ``sums`` and ``com``, and its Jacobian into ``J_com``."""
    S, moment, J = tick.S, tick.mass_moment, tick.J_com
    mass = moment[0, 0]
    for a in range(3):
        tick.sums[a] = tick.com[a] = tick.q[a] + moment[0, 1 + a] / mass
    for c in range(S.shape[0]):
        s, n = S[c], moment[max(c - 5, 0)]
        J[0, c] = (n[0] * s[0] + s[4] * n[3] - s[5] * n[2]) / mass
        J[1, c] = (n[0] * s[1] + s[5] * n[1] - s[3] * n[3]) / mass
        J[2, c] = (n[0] * s[2] + s[3] * n[2] - s[4] * n[1]) / mass


def frames(tick: Packed) -> None:
    """Placements of all frames, in the order of `wholebody.robot.kernels.frames`."""
    place_frames(tick.R, tick.p, tick.frame_body, tick.frame_R_local, tick.frame_p_local, tick.frame_R, tick.frame_p)


def jacobians(tick: Packed) -> None:
    """Jacobians of the frames."""
    body, frame_p = tick.frame_body, tick.frame_p
    for f in range(body.shape[0]):
        frame_columns(tick.S, tick.parent, body[f], frame_p[f], tick.J, 6 * f)


def support(tick: Packed) -> None:
    """Joint torques ``tau`` that hold the robot still at ``q_measured``, with the shortest forces on the soles."""
    S, W, w, h, load, tau, standing = tick.S, tick.W, tick.six_a, tick.six_b, tick.force, tick.tau, tick.standing
    place(tick, tick.q_measured)
    frames(tick)
    weights(tick)
    for k in range(standing.shape[0]):
        point_offsets(tick, standing[k])
    contact_gram(tick.points, tick.loaded, tick.gram)
    inverse_6(tick.gram, tick.K, W)
    for a in range(6):
        w[a] = load[0, a]
    for a in range(6):
        h[a] = -dot(W[a], w, 6)
    for k in range(standing.shape[0]):
        carry(tick, h, standing[k])
    for j in range(tau.shape[0]):
        tau[j] = -dot6(S[6 + j], load[1 + j])


def weights(tick: Packed) -> None:
    """Weight of every subtree about the base: (0, 0, -m g) at its centre."""
    load, moment, g = tick.force, tick.mass_moment, tick.gravity
    for i in range(load.shape[0]):
        for a in range(6):
            load[i, a] = 0.0
        load[i, 2], load[i, 3], load[i, 4] = -g * moment[i, 0], -g * moment[i, 2], g * moment[i, 1]


def carry(tick: Packed, h: Vector, c: int) -> None:
    """Add the forces ``G' h`` of the points of contact ``c`` to the load (nb, 6) of foot and all that it hangs on."""
    P, parent, load = tick.points, tick.parent, tick.force
    each = P.shape[0] // tick.n_contacts
    for i in range(each * c, each * (c + 1)):
        fx, fy, fz = velocity_at(h, P[i])
        k = tick.frame_body[c]
        while k > 0:
            add_force_at(P[i], fx, fy, fz, load[k])
            k = parent[k]
