"""Karush-Kuhn-Tucker residuals of an answer, from the data of the program and not from its factors.

Only the multipliers of the equalities are eliminated: those of the contacts by looking along the accelerations that
they allow, those of the six root rows by least squares over the forces.
"""

from __future__ import annotations

from wholebody.jit.packed import Packed
from wholebody.qp.kernels.constraints import add_spread, describe, torque_values, total_wrench
from wholebody.qp.kernels.cost import reduce_row
from wholebody.qp.kernels.linear_algebra import add_scaled, dot


def larger(a: float, b: float) -> float:
    """The larger one; NaN if one of them is, unlike `max`."""
    return a if (a > b or a != a) else b  # noqa: PLR0124


def conclude(tick: Packed) -> bool:
    """Torques, multipliers of all rows, positive at the upper side, and residuals; whether those are accepted."""
    tau, nle, dual, lam, rows, sides = tick.tau, tick.nle, tick.dual, tick.lam, tick.rows, tick.sides
    now, before = tick.pair_now, tick.pair_before
    torque_values(tick, tau)
    for j in range(tau.shape[0]):
        tau[j] += nle[6 + j]
    for i in range(dual.shape[0]):
        dual[i] = 0.0
    for k in range(tick.n_working):
        dual[rows[k]] += sides[k] * lam[k]
    for i in range(now.shape[0]):
        before[i] = now[i]
    residuals(tick)
    return accepted(tick)


def accepted(tick: Packed) -> bool:
    """Whether the residuals are within what is accepted; written so that NaN is refused."""
    r, largest = tick.residuals, tick.dual_accepted
    return r[0] <= tick.primal_accepted and r[1] <= largest and r[2] <= largest


def residuals(tick: Packed) -> None:
    """Write the primal, stationarity and complementarity residuals; NaN in the answer makes them NaN."""
    value, dual, rows, lower, upper, out = (
        tick.value, tick.dual, tick.rows, tick.lower, tick.upper, tick.residuals
    )  # fmt: skip
    out[0] = primal(tick)
    out[1], cost = stationarity(tick)
    found = 0.0
    for k in range(tick.n_working):
        i = rows[k]
        gap = value[i] - upper[i] if dual[i] > 0.0 else value[i] - lower[i]
        if dual[i] != 0.0:
            found = larger(abs(dual[i] * gap), found)
    out[2] = found / (1.0 + cost)


def primal(tick: Packed) -> float:
    """Largest violation of a contact row, a root row or an inequality."""
    dv, w, F, f_0 = tick.dv, tick.six_a, tick.F, tick.f_0
    nv, found = dv.shape[0], contact_error(tick)
    total_wrench(tick.f, tick.points, tick.loaded, w)
    for a in range(6):
        w[a] -= f_0[a]
    for c in range(nv):
        for a in range(6):
            w[a] -= F[c, a] * dv[c]
    for a in range(6):
        found = larger(abs(w[a]), found)
    return larger(violation(tick), found)


def contact_error(tick: Packed) -> float:
    """Largest difference of a row of the contacts that stand from its target."""
    J, dv, target, standing, found = tick.J, tick.dv, tick.contact_target, tick.standing, 0.0
    for s in range(standing.shape[0]):
        for r in range(6 * standing[s], 6 * standing[s] + 6):
            found = larger(abs(dot(J[r], dv, dv.shape[0]) - target[r]), found)
    return found


def violation(tick: Packed) -> float:
    """Largest violation of an inequality."""
    value, lower, upper, found = tick.value, tick.lower, tick.upper, 0.0
    for i in range(value.shape[0]):
        found = larger(value[i] - upper[i], larger(lower[i] - value[i], found))
    return found


def task_gradient(tick: Packed) -> tuple[float, float]:
    """Gradient of the tasks' cost over ``dv`` into ``gradient``; the cost, and the largest given part of it."""
    dv, gradient, J, target, weight = tick.dv, tick.gradient, tick.J, tick.target, tick.weight
    stiffness, posture, penalty = tick.posture_weight, tick.posture_target, tick.penalty_acceleration
    nv, total, scale = dv.shape[0], 0.0, 0.0
    for c in range(nv):
        gradient[c] = penalty * dv[c]
    for j in range(posture.shape[0]):
        left = dv[6 + j] - posture[j]
        gradient[6 + j] += stiffness[j] * left
        total += 0.5 * stiffness[j] * left * left
        scale = max(scale, stiffness[j] * abs(posture[j]))
    for r in range(6 * target.shape[0]):
        size, wanted = weight[r // 6, r % 6], target[r // 6, r % 6]
        if size > 0.0:
            left = dot(J[r], dv, nv) - wanted
            add_scaled(gradient, size * left, J[r], nv)
            total += 0.5 * size * left * left
            scale = max(scale, size * abs(wanted))
    return total, scale


def body_gradient(tick: Packed) -> tuple[float, float]:
    """Add centre of mass and momentum; the same two answers as `task_gradient`."""
    dv, gradient, F, target, weight, c, w, h = (
        tick.dv, tick.gradient, tick.F, tick.body_target, tick.body_weight, tick.centre, tick.six_a, tick.six_b
    )  # fmt: skip
    mass, total, scale = tick.sums[21], 0.0, 0.0
    for a in range(6):
        w[a] = h[a] = 0.0
    for i in range(dv.shape[0]):
        for a in range(6):
            w[a] += F[i, a] * dv[i]
    left_x = w[3] - (c[1] * w[2] - c[2] * w[1])
    left_y = w[4] - (c[2] * w[0] - c[0] * w[2])
    left_z = w[5] - (c[0] * w[1] - c[1] * w[0])
    for a in range(3):
        left = w[a] / mass - target[a]
        h[a] = weight[a] * left / mass
        total += 0.5 * weight[a] * left * left
        moment = (left_x if a == 0 else (left_y if a == 1 else left_z)) - target[3 + a]
        h[3 + a] = weight[3 + a] * moment
        total += 0.5 * weight[3 + a] * moment * moment
        scale = max(scale, weight[a] * abs(target[a]), weight[3 + a] * abs(target[3 + a]))
    # h is the force on (w_l, moment about the centre); about the base the force gets its part of the moment.
    h[0] -= h[4] * c[2] - h[5] * c[1]
    h[1] -= h[5] * c[0] - h[3] * c[2]
    h[2] -= h[3] * c[1] - h[4] * c[0]
    for i in range(dv.shape[0]):
        gradient[i] += dot(F[i], h, 6)
    return total, scale


def stationarity(tick: Packed) -> tuple[float, float]:
    """Largest entry of the Lagrangian's gradient along what the equalities allow, scaled; and the cost."""
    f, gradient, gradient_f, slack, left = tick.f, tick.gradient, tick.gradient_f, tick.slack, tick.gradient_slack
    dual, rows, a_slack, penalty = tick.dual, tick.rows, tick.a_slack, tick.penalty_force
    cost, scale = task_gradient(tick)
    more, scale_body = body_gradient(tick)
    cost, scale = cost + more, 1.0 + max(scale, scale_body)
    for i in range(f.shape[0]):
        gradient_f[i] = penalty * f[i]
        cost += 0.5 * penalty * f[i] * f[i]
    for i in range(2):
        left[i] = tick.penalty_slack + tick.penalty_slack_squared * slack[i]
    for k in range(tick.n_working):
        z = dual[rows[k]]
        if describe(tick, rows[k]):
            add_scaled(gradient_f, z, tick.a_f, f.shape[0])
        add_scaled(gradient, z, tick.a_dv, gradient.shape[0])
        left[0] += z * a_slack[0]
        left[1] += z * a_slack[1]
    project(tick)
    found = larger(abs(left[0]), abs(left[1])) / (1.0 + tick.penalty_slack)
    reduced = tick.reduced_gradient
    for i in range(reduced.shape[0]):
        found = larger(abs(reduced[i]) / scale, found)
    for i in range(f.shape[0]):
        found = larger(abs(gradient_f[i]) / scale, found)
    return found, cost


def project(tick: Packed) -> None:
    """Take out of the gradients what the multipliers of root rows and contacts can carry."""
    gradient, F, W, P, w, h = tick.gradient, tick.F, tick.W, tick.points, tick.six_a, tick.six_b
    total_wrench(tick.gradient_f, P, tick.loaded, w)
    for a in range(6):
        h[a] = dot(W[a], w, 6)
    add_spread(h, P, tick.loaded, -1.0, tick.gradient_f)
    for i in range(gradient.shape[0]):
        gradient[i] += dot(F[i], h, 6)
    reduce_row(gradient, tick.bound_columns, tick.free_columns, tick.Z, tick.reduced_gradient)
