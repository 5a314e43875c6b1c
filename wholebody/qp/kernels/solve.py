"""Solve the assembled program and judge the answer; compiles with numba as it stands."""

import math

from wholebody.qp.kernels import blocks as mem
from wholebody.qp.kernels.active_set import append, exchange, point_of, remove, settle, step_back, worst
from wholebody.qp.kernels.constraints import add_spread, describe, evaluate, transform, wrench_of
from wholebody.qp.kernels.cost import expand
from wholebody.qp.kernels.linear_algebra import dot, solve_upper

REFINEMENTS = 4
EXACT = 2e-13
"""Violation of a row of the working set that is taken for none [m/s^2, rad/s^2, N, N m]."""
FACE = 2
"""Entry of CONTACT that holds the slope of the friction pyramid."""


def point(reals, ints):
    """Accelerations, forces and slacks at ``u``, and the values of all rows there."""
    u, y, U = mem.vector(reals, mem.U_VEC), mem.vector(reals, mem.X_Y), mem.matrix(reals, mem.U_)
    dv, f, slack = (
        mem.vector(reals, mem.DV),
        mem.vector(reals, mem.FORCE),
        mem.vector(reals, mem.SLACK),
    )
    y0, prices, P = (
        mem.vector(reals, mem.Y0),
        mem.vector(reals, mem.PRICES),
        mem.matrix(reals, mem.POINTS),
    )
    F, W, w, h = (
        mem.matrix(reals, mem.F_),
        mem.matrix(reals, mem.W_),
        mem.vector(reals, mem.SIX_A),
        mem.vector(reals, mem.SIX_B),
    )
    ny, nf = y0.shape[0], f.shape[0]
    for i in range(ny):
        y[i] = u[i]
    solve_upper(U, y, ny)
    for i in range(ny):
        y[i] += y0[i]
    bound, free, root = (
        mem.vector(ints, mem.BOUND),
        mem.vector(ints, mem.FREE),
        mem.vector(reals, mem.ROOT),
    )
    expand(y, mem.vector(reals, mem.DV_P), bound, free, mem.matrix(reals, mem.Z_), dv)
    for a in range(6):
        w[a] = root[a]
    for c in range(dv.shape[0]):
        for a in range(6):
            w[a] += dv[c] * F[c, a]
    for i in range(nf):
        f[i] = u[ny + i] / math.sqrt(prices[mem.PRICE_FORCE])
    # These forces cancel out but for rounding, which is taken out here: it would push the robot.
    wrench_of(f, P, h)
    for a in range(6):
        w[a] -= h[a]
    for a in range(6):
        h[a] = dot(W[a], w, 6)
    add_spread(h, P, 1.0, f)
    for i in range(2):
        slack[i] = u[ny + nf + i] / math.sqrt(prices[mem.PRICE_SLACK_SQUARED])
        slack[i] -= prices[mem.PRICE_SLACK] / prices[mem.PRICE_SLACK_SQUARED]
    soft = mem.vector(reals, mem.SOFT_UPPER)
    evaluate(
        dv,
        f,
        slack,
        mem.matrix(reals, mem.M_),
        mem.matrix(reals, mem.S_),
        P,
        mem.vector(ints, mem.OWNER),
        mem.matrix(reals, mem.MOVES),
        mem.vector(reals, mem.CONTACT)[FACE],
        mem.matrix(reals, mem.JS_),
        soft,
        balance_slots(reals, ints),
        mem.matrix(reals, mem.WRENCH),
        mem.vector(reals, mem.VALUE),
    )


def balance_slots(reals, ints):
    """Number of soft slots that share the first slack: those of the support's edges and of the trunk."""
    return mem.matrix(reals, mem.EDGES).shape[0] + (15 if mem.vector(ints, mem.COUNTS)[mem.TRUNK] else 0)


def full_row(row, reals, ints):
    """Write one row in full variables into A_V, A_F, A_S; True if it has a part on the forces."""
    return describe(
        row,
        mem.matrix(reals, mem.M_),
        mem.matrix(reals, mem.S_),
        mem.matrix(reals, mem.POINTS),
        mem.vector(ints, mem.OWNER),
        mem.matrix(reals, mem.MOVES),
        mem.vector(reals, mem.CONTACT)[FACE],
        mem.matrix(reals, mem.JS_),
        balance_slots(reals, ints),
        mem.vector(reals, mem.A_V),
        mem.vector(reals, mem.A_F),
        mem.vector(reals, mem.A_S),
    )


def enter(row, side, count, multiplier, reals, ints):
    """Try to add a row to the working set; False if it depends on it. Its bound is that at ``u = 0``.

    The value at ``u = 0`` is the value now less what ``u`` changed, so no second point has to be kept.
    """
    m, u, prices = (
        mem.vector(reals, mem.ROW_M),
        mem.vector(reals, mem.U_VEC),
        mem.vector(reals, mem.PRICES),
    )
    value, Q, R = (
        mem.vector(reals, mem.VALUE),
        mem.matrix(reals, mem.QR_Q),
        mem.matrix(reals, mem.QR_R),
    )
    loaded = full_row(row, reals, ints)
    force, slack = 1.0 / math.sqrt(prices[mem.PRICE_FORCE]), 1.0 / math.sqrt(prices[mem.PRICE_SLACK_SQUARED])
    transform(
        mem.vector(reals, mem.A_V),
        mem.vector(reals, mem.A_F),
        mem.vector(reals, mem.A_S),
        loaded,
        mem.vector(ints, mem.BOUND),
        mem.vector(ints, mem.FREE),
        mem.matrix(reals, mem.Z_),
        mem.matrix(reals, mem.REDUCED_F),
        mem.matrix(reals, mem.W_),
        mem.matrix(reals, mem.POINTS),
        mem.matrix(reals, mem.U_),
        force,
        slack,
        m,
        mem.vector(reals, mem.SIX_A),
        mem.vector(reals, mem.SIX_B),
    )
    nu = m.shape[0]
    limit = mem.vector(reals, mem.UPPER)[row] if side > 0 else -mem.vector(reals, mem.LOWER)[row]
    now = side * (value[row] - dot(m, u, nu))
    for k in range(nu):
        m[k] *= side
    if not append(m, limit - now, count, nu, Q, R, mem.vector(reals, mem.RHS), mem.vector(reals, mem.COEFFICIENTS)):
        return False
    mem.vector(ints, mem.ROWS)[count] = row
    mem.vector(reals, mem.SIDES)[count] = side
    mem.vector(reals, mem.LAM)[count] = multiplier
    return True


def start(reals, ints):
    """The working set of the last tick, at the free minimiser; rows of pairs move to where their pair is now.

    Returns:
        Number of rows.
    """
    counts, rows, sides = (
        mem.vector(ints, mem.COUNTS),
        mem.vector(ints, mem.ROWS),
        mem.vector(reals, mem.SIDES),
    )
    now, before = mem.vector(ints, mem.PAIR_NOW), mem.vector(ints, mem.PAIR_BEFORE)
    upper, u = mem.vector(reals, mem.UPPER), mem.vector(reals, mem.U_VEC)
    last = upper.shape[0] - 2
    first = last - now.shape[0]
    for k in range(u.shape[0]):
        u[k] = 0.0
    point(reals, ints)
    count = 0
    for k in range(counts[mem.N_WORKING]):
        row, side = rows[k], sides[k]
        if first <= row < last:
            row = slot_of(before[row - first], now, counts[mem.N_PAIRS], first)
        if row < 0 or (side > 0.0 and not upper[row] < 1e300):
            continue
        if enter(row, side, count, 0.0, reals, ints):
            count += 1
    return count


def slot_of(pair, now, n, first):
    """Row of a pair in this tick, -1 if it has none."""
    for i in range(n):
        if now[i] == pair:
            return first + i
    return -1


def search(reals, ints):
    """Iterate to the solution; a code of `blocks`. Leaves the point, its values and the multipliers."""
    counts, rows, sides = (
        mem.vector(ints, mem.COUNTS),
        mem.vector(ints, mem.ROWS),
        mem.vector(reals, mem.SIDES),
    )
    lam, y, wanted = (
        mem.vector(reals, mem.LAM),
        mem.vector(reals, mem.Y_),
        mem.vector(reals, mem.WANTED),
    )
    Q, R, rhs, u = (
        mem.matrix(reals, mem.QR_Q),
        mem.matrix(reals, mem.QR_R),
        mem.vector(reals, mem.RHS),
        mem.vector(reals, mem.U_VEC),
    )
    value, lower, upper = (mem.vector(reals, mem.VALUE), mem.vector(reals, mem.LOWER), mem.vector(reals, mem.UPPER))
    coefficients, nu = mem.vector(reals, mem.COEFFICIENTS), u.shape[0]
    count = start(reals, ints)
    tolerance = mem.vector(reals, mem.OPTIONS)[mem.TOLERANCE]
    for iteration in range(counts[mem.ITERATION_LIMIT]):
        counts[mem.ITERATIONS] = iteration + 1
        count = settle(count, nu, Q, R, rhs, lam, rows, sides, y, wanted)
        counts[mem.N_WORKING] = count
        point_of(count, nu, Q, y, u)
        point(reals, ints)
        row = worst(value, lower, upper, mem.vector(reals, mem.SIZE), upper.shape[0], tolerance)
        if row < 0 or holds(row, rows, count):
            refine(count, reals, ints)
            row = worst(value, lower, upper, mem.vector(reals, mem.SIZE), upper.shape[0], tolerance)
            if row < 0 or holds(row, rows, count):
                return mem.SOLVED
        side = 1.0 if value[row] > upper[row] else -1.0
        multiplier = 0.0
        while not enter(row, side, count, multiplier, reals, ints):
            for k in range(count):
                coefficients[k] = R[k, count]
            leaving, step = exchange(count, R, lam, coefficients)
            if leaving < 0:
                return mem.INFEASIBLE
            multiplier += step
            remove(leaving, count, nu, Q, R, rhs, lam, rows, sides)
            count -= 1
        count += 1
    return mem.TOO_MANY_ITERATIONS


def refine(count, reals, ints):
    """Correct the boundary point for what rounding left of the violation of its rows, as long as it gets less.

    The correction is added to ``u``: the price of the slacks makes ``y`` so large that ``Q y`` is rounded at 1e-12, and
    forces are 300 times that.
    """
    left, largest = mem.vector(reals, mem.COEFFICIENTS), math.inf
    for _ in range(REFINEMENTS):
        before, largest = largest, violation(count, left, reals, ints)
        if not EXACT < largest < 0.5 * before:
            return
        step_back(count, mem.matrix(reals, mem.QR_R), left, mem.matrix(reals, mem.QR_Q), mem.vector(reals, mem.U_VEC))
        point(reals, ints)


def violation(count, left, reals, ints):
    """How far the rows of the working set are beyond their sides, into ``left`` (count,); the largest amount."""
    value, lower, upper = mem.vector(reals, mem.VALUE), mem.vector(reals, mem.LOWER), mem.vector(reals, mem.UPPER)
    rows, sides, largest = mem.vector(ints, mem.ROWS), mem.vector(reals, mem.SIDES), 0.0
    for k in range(count):
        i = rows[k]
        left[k] = value[i] - upper[i] if sides[k] > 0.0 else lower[i] - value[i]
        largest = max(largest, abs(left[k]))
    return largest


def holds(row, rows, count):
    """Whether a row is in the working set; what is left of its violation is then rounding."""
    found = False
    for k in range(count):
        found = found or rows[k] == row
    return found
