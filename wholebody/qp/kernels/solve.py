"""Solve the assembled program: the search of `active_set` in its variables."""

from __future__ import annotations

import math

from wholebody.jit.arrays import Indices
from wholebody.jit.packed import Packed
from wholebody.qp.kernels import active_set
from wholebody.qp.kernels.constraints import add_spread, evaluate, total_wrench, transform
from wholebody.qp.kernels.cost import expand
from wholebody.qp.kernels.linear_algebra import dot, solve_upper


def search(tick: Packed) -> int:
    """Iterate to the solution; one of the codes of `active_set`."""
    follow_pairs(tick)
    return active_set.search(tick, point, transform)


def follow_pairs(tick: Packed) -> None:
    """Rows of pairs in the working set move to where their pair is now, -1 if it has no row any more."""
    rows, now, before = tick.rows, tick.pair_now, tick.pair_before
    last = tick.upper.shape[0] - 2
    first = last - now.shape[0]
    for k in range(tick.n_working):
        if first <= rows[k] < last:
            rows[k] = slot_of(before[rows[k] - first], now, tick.n_pairs, first)


def slot_of(pair: int, now: Indices, n: int, first: int) -> int:
    """Row of a pair in this tick, -1 if it has none."""
    for i in range(n):
        if now[i] == pair:
            return first + i
    return -1


def point(tick: Packed) -> None:
    """Accelerations, forces and slacks at ``u``, and the values of all rows there."""
    u, slack, ny = tick.u, tick.slack, tick.y.shape[0]
    reduced_point(tick)
    expand(tick)
    forces(tick)
    linear, squared = tick.penalty_slack, tick.penalty_slack_squared
    for i in range(2):
        slack[i] = u[ny + tick.f.shape[0] + i] / math.sqrt(squared) - linear / squared
    evaluate(tick)


def reduced_point(tick: Packed) -> None:
    """``y = y_free + U^-1 u``."""
    u, y, y_free = tick.u, tick.y, tick.y_free
    ny = y.shape[0]
    for i in range(ny):
        y[i] = u[i]
    solve_upper(tick.U, y, ny)
    for i in range(ny):
        y[i] += y_free[i]


def forces(tick: Packed) -> None:
    """The shortest forces with the wrench that ``dv`` needs, plus those of ``u`` that cancel."""
    u, dv, f, F, W, P, f_0, w, h = (
        tick.u, tick.dv, tick.f, tick.F, tick.W, tick.points, tick.f_0, tick.six_a, tick.six_b
    )  # fmt: skip
    ny, size = tick.y.shape[0], math.sqrt(tick.penalty_force)
    for a in range(6):
        w[a] = f_0[a]
    for c in range(dv.shape[0]):
        for a in range(6):
            w[a] += dv[c] * F[c, a]
    for i in range(f.shape[0]):
        f[i] = u[ny + i] / size
    # These forces cancel out but for rounding, which is taken out here: it would push the robot.
    total_wrench(f, P, tick.loaded, h)
    for a in range(6):
        w[a] -= h[a]
    for a in range(6):
        h[a] = dot(W[a], w, 6)
    add_spread(h, P, tick.loaded, 1.0, f)
