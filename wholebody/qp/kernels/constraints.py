r"""Every inequality of the whole-body program as a numbered row; compiles with numba as it stands.

Numbers, in this order, n joints, k contact points, s soft rows: acceleration of the n joints, torque of the n joints,
normal force of the k points, four sides of the friction pyramid of each point, s soft rows, two slacks. Rows are
two-sided, in full variables ``dv (nv), f (3 k), slack (2)``.
"""

from wholebody.qp.kernels.cost import reduce_row
from wholebody.qp.kernels.linear_algebra import dot, solve_transposed
from wholebody.robot.kernels.spatial import add_force_at, velocity_at


def all_bounds(low, high, tau_max, nle, contact, soft_upper, lower, upper):
    """Bounds of all rows.

    Args:
        low: Least acceleration of the joints (n,).
        high: Largest.
        tau_max: Largest torques (n,).
        nle: Forces for ``dv = 0`` (6 + n,); they move to the right-hand side.
        contact: ``kp kd face force_min force_max`` (5,).
        soft_upper: Of the soft rows (s,).
        lower: Out.
        upper: Out.
    """
    n, s = low.shape[0], soft_upper.shape[0]
    points = (lower.shape[0] - 2 * n - s - 2) // 5
    for j in range(n):
        lower[j], upper[j] = low[j], high[j]
        lower[n + j], upper[n + j] = -tau_max[j] - nle[6 + j], tau_max[j] - nle[6 + j]
    at = 2 * n
    for i in range(points):
        lower[at + i], upper[at + i] = contact[3], contact[4]
    at += points
    for i in range(4 * points):
        lower[at + i], upper[at + i] = -1e300, 0.0
    at += 4 * points
    for i in range(s):
        lower[at + i], upper[at + i] = -1e300, soft_upper[i]
    at += s
    for i in range(2):
        lower[at + i], upper[at + i] = 0.0, 1e300


def contact_wrenches(f, P, owner, wrench):
    """Wrench about the base of the forces on each contact, (contacts, 6); ``owner`` is the contact of each point."""
    for c in range(wrench.shape[0]):
        for a in range(6):
            wrench[c, a] = 0.0
    for i in range(owner.shape[0]):
        add_force_at(P[i], f[3 * i], f[3 * i + 1], f[3 * i + 2], wrench[owner[i]])


def torque_values(dv, M, S, wrench, moves, out):
    """``M_joints dv - J_points' f`` (n,): torque without ``nle``; ``moves`` (contacts, nv) says who moves whom."""
    nv = dv.shape[0]
    n = nv - 6
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


def evaluate(dv, f, slack, M, S, P, owner, moves, face, JS, soft_upper, n_balance, wrench, value):
    """Values of all rows at a point; soft rows whose bound is infinite are left out.

    Args:
        dv: (nv,).
        f: (3 k,).
        slack: (2,).
        M: Mass matrix.
        S: Columns (nv, 6).
        P: Offsets of the contact points (k, 3).
        owner: Contact of each point (k,).
        moves: Which velocity moves which contact (contacts, nv).
        face: Slope of the friction pyramid.
        JS: Soft rows (s, nv).
        soft_upper: Their bounds (s,).
        n_balance: Number of soft rows that share the first slack.
        wrench: Scratch (contacts, 6).
        value: Out.
    """
    nv, k = dv.shape[0], owner.shape[0]
    n = nv - 6
    for j in range(n):
        value[j] = dv[6 + j]
    contact_wrenches(f, P, owner, wrench)
    torque_values(dv, M, S, wrench, moves, value[n:])
    at = 2 * n
    for i in range(k):
        x, y, z = f[3 * i], f[3 * i + 1], face * f[3 * i + 2]
        value[at + i] = f[3 * i + 2]
        cone = at + k + 4 * i
        value[cone], value[cone + 1], value[cone + 2], value[cone + 3] = x - z, -x - z, y - z, -y - z
    at += 5 * k
    for i in range(soft_upper.shape[0]):
        if soft_upper[i] < 1e300:
            value[at + i] = dot(JS[i], dv, nv) - slack[1 if i >= n_balance else 0]
    at += soft_upper.shape[0]
    value[at], value[at + 1] = slack[0], slack[1]


def describe(row, M, S, P, owner, moves, face, JS, n_balance, a_v, a_f, a_s):
    """One row in full variables: ``a_v`` (nv,), ``a_f`` (3 k,), ``a_s`` (2,); True if it has a part in ``a_f``."""
    nv, k, s = a_v.shape[0], owner.shape[0], JS.shape[0]
    n = nv - 6
    for c in range(nv):
        a_v[c] = 0.0
    for c in range(3 * k):
        a_f[c] = 0.0
    a_s[0] = a_s[1] = 0.0
    if row < n:
        a_v[6 + row] = 1.0
        return False
    if row < 2 * n:
        return describe_torque(row - n, M, S, P, owner, moves, a_v, a_f)
    row -= 2 * n
    if row < k:
        a_f[3 * row + 2] = 1.0
        return True
    row -= k
    if row < 4 * k:
        i, side = row // 4, row % 4
        a_f[3 * i + side // 2] = 1.0 - 2.0 * (side % 2)
        a_f[3 * i + 2] = -face
        return True
    row -= 4 * k
    if row < s:
        for c in range(nv):
            a_v[c] = JS[row, c]
        a_s[1 if row >= n_balance else 0] = -1.0
        return False
    a_s[row - s] = 1.0
    return False


def describe_torque(j, M, S, P, owner, moves, a_v, a_f):
    """The torque row of joint ``j``; True if it moves a contact."""
    c = 6 + j
    for i in range(a_v.shape[0]):
        a_v[i] = M[c, i]
    found = False
    for i in range(owner.shape[0]):
        if moves[owner[i], c] > 0.0:
            found = True
            x, y, z = velocity_at(S[c], P[i])
            a_f[3 * i], a_f[3 * i + 1], a_f[3 * i + 2] = -x, -y, -z
    return found


def wrench_of(f, P, w):
    """``w = G f`` (6,)."""
    for a in range(6):
        w[a] = 0.0
    for i in range(P.shape[0]):
        add_force_at(P[i], f[3 * i], f[3 * i + 1], f[3 * i + 2], w)


def add_spread(h, P, factor, f):
    """``f += factor G' h`` (3 k,)."""
    for i in range(P.shape[0]):
        x, y, z = velocity_at(h, P[i])
        f[3 * i] += factor * x
        f[3 * i + 1] += factor * y
        f[3 * i + 2] += factor * z


def transform(a_v, a_f, a_s, loaded, bound, free, Z, FR, W, P, U, force, slack, m, w, h):
    """A row in the variables ``u`` of `active_set`, m (ny + 3 k + 2,).

    Args:
        a_v: Row on ``dv``.
        a_f: Row on ``f``; left without what moves the whole robot.
        a_s: Row on the slacks.
        loaded: Whether ``a_f`` is not zero.
        bound: Bound columns.
        free: Free columns.
        Z: Basis of the allowed accelerations.
        FR: ``F' Z`` (6, ny).
        W: ``(G G')^-1``.
        P: Contact points.
        U: Factor of the reduced Hessian.
        force: Inverse root of the price of forces.
        slack: Inverse root of the price of squared slacks.
        m: Out.
        w: Scratch (6,).
        h: Scratch (6,).
    """
    ny, nf = FR.shape[1], a_f.shape[0]
    reduce_row(a_v, bound, free, Z, m)
    if loaded:
        wrench_of(a_f, P, w)
        for a in range(6):
            h[a] = dot(W[a], w, 6)
            for j in range(ny):
                m[j] += h[a] * FR[a, j]
        add_spread(h, P, -1.0, a_f)
    solve_transposed(U, m, ny)
    for i in range(nf):
        m[ny + i] = force * a_f[i]
    m[ny + nf] = slack * a_s[0]
    m[ny + nf + 1] = slack * a_s[1]
