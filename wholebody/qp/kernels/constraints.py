r"""Every inequality of the whole-body program as a numbered row.

Numbers, in this order, n joints, k contact points, s soft rows: acceleration of the n joints, torque of the n joints,
normal force of the k points, four sides of the friction pyramid of each point, s soft rows, two slacks. Rows are
two-sided, in full variables ``dv (nv), f (3 k), slack (2)``. The first ``n_balance`` soft rows share the first slack.
"""

from __future__ import annotations

import math

from wholebody.contacts.friction import PYRAMID_SIDES, beyond_side
from wholebody.jit.arrays import Indices, Matrix, Vector
from wholebody.jit.packed import Packed
from wholebody.qp.kernels.active_set import NO_BOUND
from wholebody.qp.kernels.cost import reduce_row
from wholebody.qp.kernels.linear_algebra import dot, solve_transposed
from wholebody.robot.kernels.spatial import add_force_at, velocity_at

WIDE = 1e4
"""Bound on the accelerations of joints that may give way [rad/s^2]; chosen, no trial is on record."""


def bounds(tick: Packed) -> None:
    """Bounds ``lower`` and ``upper`` of all rows; ``nle`` moves to the right-hand side."""
    lower, upper, soft, nle = tick.lower, tick.upper, tick.soft_upper, tick.nle
    ddq_min, ddq_max, tau_max = tick.ddq_min, tick.ddq_max, tick.tau_max if tick.hands else tick.effort_max
    owner, force_min, force_max, hands = tick.owner, tick.force_min, tick.force_max, tick.hands
    n, k, s = ddq_min.shape[0], owner.shape[0], soft.shape[0]
    for j in range(n):
        lower[j], upper[j] = (ddq_min[j], ddq_max[j]) if hands else (-WIDE, WIDE)
        lower[n + j], upper[n + j] = -tau_max[j] - nle[6 + j], tau_max[j] - nle[6 + j]
    at = 2 * n
    for i in range(k):
        lower[at + i], upper[at + i] = force_min[owner[i]], force_max[owner[i]]
    at += k
    for i in range(4 * k):
        lower[at + i], upper[at + i] = -NO_BOUND, 0.0
    at += 4 * k
    for i in range(s):
        lower[at + i], upper[at + i] = -NO_BOUND, soft[i]
    at += s
    for i in range(2):
        lower[at + i], upper[at + i] = 0.0, NO_BOUND


def contact_wrenches(tick: Packed) -> None:
    """Wrench about the base of the forces on each contact, into ``wrench`` (contacts, 6)."""
    f, P, owner, wrench = tick.f, tick.points, tick.owner, tick.wrench
    for c in range(wrench.shape[0]):
        for a in range(6):
            wrench[c, a] = 0.0
    for i in range(owner.shape[0]):
        add_force_at(P[i], f[3 * i], f[3 * i + 1], f[3 * i + 2], wrench[owner[i]])


def torque_values(tick: Packed, out: Vector) -> None:
    """``M_joints dv - J_points' f`` (n,): torque without ``nle``; fills ``wrench`` on the way."""
    dv, M, S, wrench, moves = tick.dv, tick.M, tick.S, tick.wrench, tick.moves
    nv = dv.shape[0]
    n = nv - 6
    contact_wrenches(tick)
    for j in range(n):
        out[j] = 0.0
    for c in range(nv):
        a = dv[c]
        for j in range(n):
            out[j] += a * M[c, 6 + j]
    for k in range(wrench.shape[0]):
        for j in range(n):
            if moves[k, 6 + j] > 0.0:
                out[j] -= dot(S[6 + j], wrench[k], 6)


def evaluate(tick: Packed) -> None:
    """Values of all rows at ``dv``, ``f`` and ``slack``; soft rows that are switched off are left out."""
    dv, f, slack, value, slope = tick.dv, tick.f, tick.slack, tick.value, tick.slope
    J, upper, n_balance = tick.soft_J, tick.soft_upper, tick.n_balance
    nv, k = dv.shape[0], tick.owner.shape[0]
    n = nv - 6
    for j in range(n):
        value[j] = dv[6 + j]
    torque_values(tick, value[n:])
    at = 2 * n
    for i in range(k):
        x, y, z = f[3 * i], f[3 * i + 1], f[3 * i + 2]
        value[at + i] = z
        for side in range(4):
            value[at + k + 4 * i + side] = beyond_side(side, slope, x, y, z)
    at += 5 * k
    for i in range(upper.shape[0]):
        if upper[i] < NO_BOUND:
            value[at + i] = dot(J[i], dv, nv) - slack[1 if i >= n_balance else 0]
    at += upper.shape[0]
    value[at], value[at + 1] = slack[0], slack[1]


def describe(tick: Packed, row: int) -> bool:
    """Write one row in full variables into ``a_dv``, ``a_f`` and ``a_slack``; True if it has a part in ``a_f``."""
    a_dv, a_f, a_slack, J = tick.a_dv, tick.a_f, tick.a_slack, tick.soft_J
    nv, k, s = a_dv.shape[0], tick.owner.shape[0], J.shape[0]
    n = nv - 6
    for c in range(nv):
        a_dv[c] = 0.0
    for c in range(3 * k):
        a_f[c] = 0.0
    a_slack[0] = a_slack[1] = 0.0
    if row < n:
        a_dv[6 + row] = 1.0
        return False
    if row < 2 * n:
        return describe_torque(tick, row - n)
    row -= 2 * n
    if row < k:
        a_f[3 * row + 2] = 1.0
        return True
    row -= k
    if row < 4 * k:
        i, side = row // 4, PYRAMID_SIDES[row % 4]
        a_f[3 * i], a_f[3 * i + 1], a_f[3 * i + 2] = side[0], side[1], -tick.slope
        return True
    row -= 4 * k
    if row < s:
        for c in range(nv):
            a_dv[c] = J[row, c]
        a_slack[1 if row >= tick.n_balance else 0] = -1.0
        return False
    a_slack[row - s] = 1.0
    return False


def describe_torque(tick: Packed, j: int) -> bool:
    """The torque row of joint ``j``; True if it moves a contact."""
    a_dv, a_f, M, S, P, moves = tick.a_dv, tick.a_f, tick.M, tick.S, tick.points, tick.moves
    owner, loaded, c, found = tick.owner, tick.loaded, 6 + j, False
    for i in range(a_dv.shape[0]):
        a_dv[i] = M[c, i]
    for k in range(loaded.shape[0]):
        i = loaded[k]
        if moves[owner[i], c] > 0.0:
            found = True
            x, y, z = velocity_at(S[c], P[i])
            a_f[3 * i], a_f[3 * i + 1], a_f[3 * i + 2] = -x, -y, -z
    return found


def total_wrench(f: Vector, P: Matrix, loaded: Indices, w: Vector) -> None:
    """``w = G f`` (6,) of the point forces ``loaded`` (n,) of those (3 k,) at offsets P (k, 3)."""
    for a in range(6):
        w[a] = 0.0
    for k in range(loaded.shape[0]):
        i = loaded[k]
        add_force_at(P[i], f[3 * i], f[3 * i + 1], f[3 * i + 2], w)


def add_spread(h: Vector, P: Matrix, loaded: Indices, factor: float, f: Vector) -> None:
    """``f += factor G' h`` (3 k,), at the points ``loaded``."""
    for k in range(loaded.shape[0]):
        i = loaded[k]
        x, y, z = velocity_at(h, P[i])
        f[3 * i] += factor * x
        f[3 * i + 1] += factor * y
        f[3 * i + 2] += factor * z


def transform(tick: Packed, row: int) -> None:
    """Write a row in the variables ``u`` of `active_set` into ``m`` (ny + 3 k + 2,)."""
    m, a_f, a_slack, FZ, W, P, w, h = (
        tick.m, tick.a_f, tick.a_slack, tick.FZ, tick.W, tick.points, tick.six_a, tick.six_b
    )  # fmt: skip
    ny, nf = FZ.shape[1], a_f.shape[0]
    loaded = describe(tick, row)
    reduce_row(tick.a_dv, tick.bound_columns, tick.free_columns, tick.Z, m)
    if loaded:
        # What of a_f moves the whole robot is the business of dv; what is left acts on forces that cancel.
        total_wrench(a_f, P, tick.loaded, w)
        for a in range(6):
            h[a] = dot(W[a], w, 6)
            for j in range(ny):
                m[j] += h[a] * FZ[a, j]
        add_spread(h, P, tick.loaded, -1.0, a_f)
    solve_transposed(tick.U, m, ny)
    force, slack = 1.0 / math.sqrt(tick.penalty_force), 1.0 / math.sqrt(tick.penalty_slack_squared)
    for i in range(nf):
        m[ny + i] = force * a_f[i]
    m[ny + nf], m[ny + nf + 1] = slack * a_slack[0], slack * a_slack[1]
