"""Karush-Kuhn-Tucker residuals of an answer, from the data of the program and not from its factors.

Compiles with numba as it stands. Only the multipliers of the equalities are eliminated: those of the contacts by
looking along the accelerations that they allow, those of the six root rows by least squares over the forces.
"""

from wholebody.qp.kernels import blocks as mem
from wholebody.qp.kernels.constraints import add_spread, contact_wrenches, torque_values, wrench_of
from wholebody.qp.kernels.cost import reduce_row
from wholebody.qp.kernels.linear_algebra import add_scaled, dot
from wholebody.qp.kernels.solve import full_row


def larger(a, b):
    """The larger one; NaN if one of them is, unlike `max`."""
    return a if (a > b or a != a) else b  # noqa: PLR0124


def primal(reals, ints):
    """Largest violation of a contact row, a root row or an inequality."""
    dv, f, w = (
        mem.vector(reals, mem.DV),
        mem.vector(reals, mem.FORCE),
        mem.vector(reals, mem.SIX_A),
    )
    J, F, root = mem.matrix(reals, mem.FJ_), mem.matrix(reals, mem.F_), mem.vector(reals, mem.ROOT)
    goal, nv, found = mem.vector(reals, mem.CONTACT_TARGET), dv.shape[0], 0.0
    for r in range(goal.shape[0]):
        found = larger(abs(dot(J[r], dv, nv) - goal[r]), found)
    wrench_of(f, mem.matrix(reals, mem.POINTS), w)
    for a in range(6):
        w[a] -= root[a]
    for c in range(nv):
        for a in range(6):
            w[a] -= F[c, a] * dv[c]
    for a in range(6):
        found = larger(abs(w[a]), found)
    value, lower, upper = (mem.vector(reals, mem.VALUE), mem.vector(reals, mem.LOWER), mem.vector(reals, mem.UPPER))
    for i in range(value.shape[0]):
        found = larger(value[i] - upper[i], larger(lower[i] - value[i], found))
    return found


def task_gradient(reals, ints):
    """Gradient of the tasks' cost over ``dv`` into GRADIENT; the cost, and the largest given part of the gradient."""
    dv, gradient, J = (
        mem.vector(reals, mem.DV),
        mem.vector(reals, mem.GRADIENT),
        mem.matrix(reals, mem.FJ_),
    )
    target, weight, prices = (
        mem.vector(reals, mem.TARGET),
        mem.vector(reals, mem.WEIGHT),
        mem.vector(reals, mem.PRICES),
    )
    gain, posture = mem.matrix(reals, mem.POSTURE_GAIN), mem.vector(reals, mem.POSTURE_TARGET)
    nv, total, scale = dv.shape[0], 0.0, 0.0
    for c in range(nv):
        gradient[c] = prices[mem.PRICE_ACCELERATION] * dv[c]
    for j in range(posture.shape[0]):
        left = dv[6 + j] - posture[j]
        gradient[6 + j] += gain[2, j] * left
        total += 0.5 * gain[2, j] * left * left
        scale = max(scale, gain[2, j] * abs(posture[j]))
    for r in range(target.shape[0]):
        if weight[r] > 0.0:
            left = dot(J[r], dv, nv) - target[r]
            add_scaled(gradient, weight[r] * left, J[r], nv)
            total += 0.5 * weight[r] * left * left
            scale = max(scale, weight[r] * abs(target[r]))
    return total, scale


def body_gradient(reals, ints):
    """Add centre of mass and momentum; the same two answers as `task_gradient`."""
    dv, gradient, F = (
        mem.vector(reals, mem.DV),
        mem.vector(reals, mem.GRADIENT),
        mem.matrix(reals, mem.F_),
    )
    target, weight, c = (
        mem.vector(reals, mem.BODY_TARGET),
        mem.vector(reals, mem.BODY_WEIGHT),
        mem.vector(reals, mem.CENTRE),
    )
    w, h, mass = (
        mem.vector(reals, mem.SIX_A),
        mem.vector(reals, mem.SIX_B),
        mem.vector(reals, mem.SUMS_)[21],
    )
    for a in range(6):
        w[a] = h[a] = 0.0
    for i in range(dv.shape[0]):
        for a in range(6):
            w[a] += F[i, a] * dv[i]
    left_x = w[3] - (c[1] * w[2] - c[2] * w[1])
    left_y = w[4] - (c[2] * w[0] - c[0] * w[2])
    left_z = w[5] - (c[0] * w[1] - c[1] * w[0])
    total, scale = 0.0, 0.0
    for a in range(3):
        left = w[a] / mass - target[a]
        h[a] = weight[a] * left / mass
        total += 0.5 * weight[a] * left * left
        moment = (left_x if a == 0 else (left_y if a == 1 else left_z)) - target[3 + a]
        h[3 + a] = weight[3 + a] * moment
        total += 0.5 * weight[3 + a] * moment * moment
        scale = max(scale, weight[a] * abs(target[a]), weight[3 + a] * abs(target[3 + a]))
    # h is the force on (w_l, moment about the centre); seen from w it gets the moment's share of the force.
    h[0] -= h[4] * c[2] - h[5] * c[1]
    h[1] -= h[5] * c[0] - h[3] * c[2]
    h[2] -= h[3] * c[1] - h[4] * c[0]
    for i in range(dv.shape[0]):
        gradient[i] += dot(F[i], h, 6)
    return total, scale


def stationarity(reals, ints):
    """Largest entry of the Lagrangian's gradient along what the equalities allow, scaled; and the cost."""
    dv, f, slack = (
        mem.vector(reals, mem.DV),
        mem.vector(reals, mem.FORCE),
        mem.vector(reals, mem.SLACK),
    )
    gradient, gradient_f = mem.vector(reals, mem.GRADIENT), mem.vector(reals, mem.GRADIENT_F)
    prices, dual, rows = (
        mem.vector(reals, mem.PRICES),
        mem.vector(reals, mem.DUAL),
        mem.vector(ints, mem.ROWS),
    )
    a_v, a_f, a_s = (
        mem.vector(reals, mem.A_V),
        mem.vector(reals, mem.A_F),
        mem.vector(reals, mem.A_S),
    )
    P, w, h = (
        mem.matrix(reals, mem.POINTS),
        mem.vector(reals, mem.SIX_A),
        mem.vector(reals, mem.SIX_B),
    )
    cost, scale = task_gradient(reals, ints)
    more, scale_body = body_gradient(reals, ints)
    cost, scale = cost + more, 1.0 + max(scale, scale_body)
    nv, nf = dv.shape[0], f.shape[0]
    for i in range(nf):
        gradient_f[i] = prices[mem.PRICE_FORCE] * f[i]
        cost += 0.5 * prices[mem.PRICE_FORCE] * f[i] * f[i]
    slack_x = prices[mem.PRICE_SLACK] + prices[mem.PRICE_SLACK_SQUARED] * slack[0]
    slack_y = prices[mem.PRICE_SLACK] + prices[mem.PRICE_SLACK_SQUARED] * slack[1]
    for k in range(mem.vector(ints, mem.COUNTS)[mem.N_WORKING]):
        z = dual[rows[k]]
        if full_row(rows[k], reals, ints):
            add_scaled(gradient_f, z, a_f, nf)
        add_scaled(gradient, z, a_v, nv)
        slack_x += z * a_s[0]
        slack_y += z * a_s[1]
    wrench_of(gradient_f, P, w)
    for a in range(6):
        h[a] = dot(mem.matrix(reals, mem.W_)[a], w, 6)
    add_spread(h, P, -1.0, gradient_f)
    F, found = mem.matrix(reals, mem.F_), larger(abs(slack_x), abs(slack_y)) / (1.0 + prices[mem.PRICE_SLACK])
    for i in range(nv):
        gradient[i] += dot(F[i], h, 6)
    reduced = mem.vector(reals, mem.REDUCED_G)
    reduce_row(
        gradient,
        mem.vector(ints, mem.BOUND),
        mem.vector(ints, mem.FREE),
        mem.matrix(reals, mem.Z_),
        reduced,
    )
    for i in range(reduced.shape[0]):
        found = larger(abs(reduced[i]) / scale, found)
    for i in range(nf):
        found = larger(abs(gradient_f[i]) / scale, found)
    return found, cost


def judge(reals, ints):
    """Write the three residuals of the answer; NaN in it makes them NaN, which no tolerance accepts."""
    residuals, counts = mem.vector(reals, mem.RESIDUALS), mem.vector(ints, mem.COUNTS)
    value, dual, rows = (
        mem.vector(reals, mem.VALUE),
        mem.vector(reals, mem.DUAL),
        mem.vector(ints, mem.ROWS),
    )
    lower, upper = mem.vector(reals, mem.LOWER), mem.vector(reals, mem.UPPER)
    residuals[mem.PRIMAL] = primal(reals, ints)
    residuals[mem.STATIONARITY], cost = stationarity(reals, ints)
    found = 0.0
    for k in range(counts[mem.N_WORKING]):
        i = rows[k]
        gap = value[i] - upper[i] if dual[i] > 0.0 else value[i] - lower[i]
        if dual[i] != 0.0:
            found = larger(abs(dual[i] * gap), found)
    residuals[mem.COMPLEMENTARITY] = found / (1.0 + cost)


def conclude(reals, ints):
    """Torques, multipliers of all rows, positive at the upper side, and residuals; whether those are accepted."""
    dv, f, tau = (
        mem.vector(reals, mem.DV),
        mem.vector(reals, mem.FORCE),
        mem.vector(reals, mem.TAU_OUT),
    )
    wrench, nle = mem.matrix(reals, mem.WRENCH), mem.vector(reals, mem.NLE)
    contact_wrenches(f, mem.matrix(reals, mem.POINTS), mem.vector(ints, mem.OWNER), wrench)
    torque_values(dv, mem.matrix(reals, mem.M_), mem.matrix(reals, mem.S_), wrench, mem.matrix(reals, mem.MOVES), tau)
    for j in range(tau.shape[0]):
        tau[j] += nle[6 + j]
    dual, lam = mem.vector(reals, mem.DUAL), mem.vector(reals, mem.LAM)
    rows, sides = mem.vector(ints, mem.ROWS), mem.vector(reals, mem.SIDES)
    for i in range(dual.shape[0]):
        dual[i] = 0.0
    counts = mem.vector(ints, mem.COUNTS)
    for k in range(counts[mem.N_WORKING]):
        dual[rows[k]] += sides[k] * lam[k]
    now, before = mem.vector(ints, mem.PAIR_NOW), mem.vector(ints, mem.PAIR_BEFORE)
    for i in range(now.shape[0]):
        before[i] = now[i]
    judge(reals, ints)
    r, options = mem.vector(reals, mem.RESIDUALS), mem.vector(reals, mem.OPTIONS)
    dual_accepted = options[mem.DUAL_ACCEPTED]
    # Written so that NaN is refused.
    good = r[mem.STATIONARITY] <= dual_accepted and r[mem.COMPLEMENTARITY] <= dual_accepted
    return good and r[mem.PRIMAL] <= options[mem.PRIMAL_ACCEPTED]
