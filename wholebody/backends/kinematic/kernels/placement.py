"""Where bodies, centre of mass and frames are, and what their weight asks of the joints.

Compiles with numba as it stands. Blocks are those of `wholebody.qp.kernels.blocks`.
"""

from wholebody.qp.kernels import blocks as mem
from wholebody.qp.kernels.cost import contact_gram
from wholebody.qp.kernels.limits import point_offsets
from wholebody.qp.kernels.linear_algebra import dot, inverse_6
from wholebody.robot.kernels.bodies import LEVER, MASS, place_base, place_bodies
from wholebody.robot.kernels.frames import frame_columns, place_frames
from wholebody.robot.kernels.rotation import rotate
from wholebody.robot.kernels.spatial import add_force_at, dot6, velocity_at

# Entries of STEP.
DT, FOOT_GAIN, SPEED_PRICE, RETREAT, HAND_KD, TRUNK_KD, COM_KD, GRAVITY = range(8)
STEP = 8


def place(q, reals, ints):
    """Bodies at ``q``, columns, and mass and mass times centre of every subtree (``INERTIA_[:, :4]``)."""
    R, p, S = mem.cube(reals, mem.R_), mem.matrix(reals, mem.P_), mem.matrix(reals, mem.S_)
    table, parent = mem.matrix(reals, mem.TABLE), mem.vector(ints, mem.PARENT)
    sub = mem.matrix(reals, mem.INERTIA_)
    n = parent.shape[0]
    place_base(q, R[0], p[0], S)
    place_bodies(q, table, parent, 1, n, R, p, S)
    for i in range(n):
        row = table[i]
        sub[i, 0] = row[MASS]
        for a in range(3):
            sub[i, 1 + a] = row[MASS] * (p[i, a] + rotate(R[i], a, row[LEVER], row[LEVER + 1], row[LEVER + 2]))
    for i in range(n - 1, 0, -1):
        for a in range(4):
            sub[parent[i], a] += sub[i, a]


def centre(q, reals):
    """Centre of mass into SUMS_ and CENTRE_NOW, and its Jacobian into the first three rows of JS_."""
    S, sub, J = mem.matrix(reals, mem.S_), mem.matrix(reals, mem.INERTIA_), mem.matrix(reals, mem.JS_)
    sums, now, mass = mem.vector(reals, mem.SUMS_), mem.vector(reals, mem.CENTRE_NOW), sub[0, 0]
    for a in range(3):
        sums[a] = now[a] = q[a] + sub[0, 1 + a] / mass
    for c in range(S.shape[0]):
        s, n = S[c], sub[max(c - 5, 0)]
        J[0, c] = (n[0] * s[0] + s[4] * n[3] - s[5] * n[2]) / mass
        J[1, c] = (n[0] * s[1] + s[5] * n[1] - s[3] * n[3]) / mass
        J[2, c] = (n[0] * s[2] + s[3] * n[2] - s[4] * n[1]) / mass


def frames(reals, ints):
    """Placements and Jacobians of the frames; contacts, palms, pelvis, torso."""
    R, p, S = mem.cube(reals, mem.R_), mem.matrix(reals, mem.P_), mem.matrix(reals, mem.S_)
    body, parent, FP = mem.vector(ints, mem.FRAME_BODY), mem.vector(ints, mem.PARENT), mem.matrix(reals, mem.FP_)
    place_frames(R, p, body, mem.cube(reals, mem.FRAME_R), mem.matrix(reals, mem.FRAME_P), mem.cube(reals, mem.FR_), FP)
    for f in range(body.shape[0]):
        frame_columns(S, parent, body[f], FP[f], mem.matrix(reals, mem.FJ_), 6 * f)


def support(reals, ints):
    """Joint torques TAU_OUT that hold the robot still at DESIRED, its measured configuration."""
    parent, body = mem.vector(ints, mem.PARENT), mem.vector(ints, mem.FRAME_BODY)
    R, p, S, sub = (
        mem.cube(reals, mem.R_), mem.matrix(reals, mem.P_), mem.matrix(reals, mem.S_), mem.matrix(reals, mem.INERTIA_)
    )  # fmt: skip
    R_local, p_local = mem.cube(reals, mem.FRAME_R), mem.matrix(reals, mem.FRAME_P)
    FR, FP = mem.cube(reals, mem.FR_), mem.matrix(reals, mem.FP_)
    local, arms, points = (
        mem.matrix(reals, mem.LOCAL_POINTS), mem.matrix(reals, mem.ARMS), mem.matrix(reals, mem.POINTS)
    )  # fmt: skip
    gram, W, w, h = (
        mem.matrix(reals, mem.GRAM), mem.matrix(reals, mem.W_), mem.vector(reals, mem.SIX_A),
        mem.vector(reals, mem.SIX_B),
    )  # fmt: skip
    load, tau, weight = mem.matrix(reals, mem.FORCES), mem.vector(reals, mem.TAU_OUT), mem.vector(reals, mem.STEP)
    place(mem.vector(reals, mem.DESIRED), reals, ints)
    n, feet = parent.shape[0], mem.vector(ints, mem.COUNTS)[mem.N_CONTACTS]
    each = local.shape[0] // feet
    # Weight of every subtree about the base: (0, 0, -m g) at its centre.
    for i in range(n):
        for a in range(6):
            load[i, a] = 0.0
        load[i, 2], load[i, 3], load[i, 4] = (
            -weight[GRAVITY] * sub[i, 0],
            -weight[GRAVITY] * sub[i, 2],
            (weight[GRAVITY] * sub[i, 1]),
        )
    place_frames(R, p, body[:feet], R_local, p_local, FR, FP)
    for c in range(feet):
        mine = slice(each * c, each * (c + 1))
        point_offsets(FR[c], FP[c], local[mine], arms[mine], points[mine])
    contact_gram(points, gram)
    inverse_6(gram, mem.matrix(reals, mem.K_), W)
    for a in range(6):
        w[a] = load[0, a]
    for a in range(6):
        h[a] = -dot(W[a], w, 6)
    for c in range(feet):
        carry(h, points, each * c, each * (c + 1), body[c], parent, load)
    for j in range(tau.shape[0]):
        tau[j] = -dot6(S[6 + j], load[1 + j])


def carry(h, P, first, last, body, parent, load):
    """Add the forces of some points, `add_spread` of ``h``, to the load of a foot and of all that it hangs on."""
    for i in range(first, last):
        fx, fy, fz = velocity_at(h, P[i])
        k = body
        while k > 0:
            add_force_at(P[i], fx, fy, fz, load[k])
            k = parent[k]
