r"""A dual active-set method for strictly convex programs: the search of every compiled program.

With ``H = U'U`` and ``x = x_0 + U^-1 u``, ``x_0`` the free minimiser, the program is to find the shortest ``u``
with ``m_i u <= d_i``. The rows of the working set are kept as ``[m_1 ... m_k] = Q R`` with orthonormal columns of Q, so
the shortest ``u`` on their boundary is ``Q y`` with ``R' y = d`` and its multipliers are ``-R^-1 y``: no squared
condition number, and only rows that were active once are ever transformed. A start from the last working set costs its
size, not the iterations that led there.

Q is stored by rows: ``Q[k]`` is the column k above.

`search` works on any memory ``tick`` with the fields of `standing_shapes` in `wholebody.qp.program_inputs` (T is the R
above), and with two functions of the program: ``evaluate_point(tick)`` fills ``value`` at ``u``, and
``transform(tick, row)`` writes a row in the variables ``u`` into ``m``.

Source:
    Goldfarb and Idnani 1983, "A numerically stable dual method for solving strictly convex quadratic programs",
    Mathematical Programming 27; Arnstroem, Bemporad and Axehill 2022, "A Dual Active-Set Solver for Embedded Quadratic
    Programming Using Recursive LDL' Updates", IEEE TAC 67(8).
"""

from __future__ import annotations

import math
from collections.abc import Callable

from wholebody.jit.arrays import Indices, Matrix, Vector
from wholebody.jit.packed import Packed
from wholebody.qp.kernels.linear_algebra import add_scaled, dot

SOLVED, INFEASIBLE, TOO_MANY_ITERATIONS, NOT_CONVEX, NO_CONTACT = range(5)
"""What a compiled program answers."""
NO_BOUND = 1e300
"""Bound of a side that a row does not have [units of the rows]; chosen: near the largest number there is."""
REFINEMENTS = 4
"""Largest number of corrections of the answer for rounding."""
EXACT = 2e-13
"""Violation of a row of the working set that is taken for none [units of the rows]; chosen: rounding of numbers of a
thousand."""

DEPENDENT = 1e-10
"""A row whose part outside the working set is a smaller share of it than this counts as dependent; chosen, no trial is
on record."""


def append(m: Vector, d: float, count: int, nu: int, Q: Matrix, R: Matrix, rhs: Vector, scratch: Vector) -> bool:
    """Add row ``m`` (nu,) with bound ``d`` to the working set; m is left with its part outside of it.

    Returns:
        False if the row depends on the working set; then ``R[:, count]`` holds its coefficients ``Q m``.
    """
    size = math.sqrt(dot(m, m, nu))
    for k in range(count):
        R[k, count] = 0.0
    # Twice is enough: after the second pass m is orthogonal to machine precision.
    for _ in range(2):
        for k in range(count):
            scratch[k] = dot(Q[k], m, nu)
        for k in range(count):
            add_scaled(m, -scratch[k], Q[k], nu)
            R[k, count] += scratch[k]
    rest = math.sqrt(dot(m, m, nu))
    if not rest > DEPENDENT * size:
        return False
    R[count, count] = rest
    for k in range(nu):
        Q[count, k] = m[k] / rest
    rhs[count] = d
    return True


def remove(
    at: int, count: int, nu: int, Q: Matrix, R: Matrix, rhs: Vector, lam: Vector, rows: Indices, sides: Vector
) -> None:
    """Take row ``at`` out of the working set of ``count`` rows, Q (nu + 1, nu); the others move up."""
    for k in range(at, count - 1):
        rows[k], sides[k], rhs[k], lam[k] = rows[k + 1], sides[k + 1], rhs[k + 1], lam[k + 1]
        for i in range(k + 2):
            R[i, k] = R[i, k + 1]
    for k in range(at, count - 1):
        a, b = R[k, k], R[k + 1, k]
        size = math.hypot(a, b)
        c, s = a / size, b / size
        for j in range(k, count - 1):
            x, y = R[k, j], R[k + 1, j]
            R[k, j], R[k + 1, j] = c * x + s * y, c * y - s * x
        for j in range(nu):
            x, y = Q[k, j], Q[k + 1, j]
            Q[k, j], Q[k + 1, j] = c * x + s * y, c * y - s * x


def multipliers(count: int, R: Matrix, rhs: Vector, y: Vector, wanted: Vector) -> None:
    """``y = R'^-1 rhs`` (count,) and the multipliers ``-R^-1 y`` of the working set."""
    for k in range(count):
        total = rhs[k]
        for i in range(k):
            total -= R[i, k] * y[i]
        y[k] = total / R[k, k]
    for k in range(count - 1, -1, -1):
        total = -y[k]
        for j in range(k + 1, count):
            total -= R[k, j] * wanted[j]
        wanted[k] = total / R[k, k]


def settle(
    count: int, nu: int, Q: Matrix, R: Matrix, rhs: Vector, lam: Vector, rows: Indices, sides: Vector, y: Vector,
    wanted: Vector
) -> int:  # fmt: skip
    """Drop rows until all multipliers of the working set are those of its boundary and none is negative.

    Returns:
        Number of rows left.
    """
    while True:
        multipliers(count, R, rhs, y, wanted)
        step, blocking = 1.0, -1
        for k in range(count):
            if wanted[k] < 0.0:
                fraction = lam[k] / (lam[k] - wanted[k])
                # Of several that block at once, the most negative one goes.
                if fraction < step or (fraction == step and (blocking < 0 or wanted[k] < wanted[blocking])):
                    step, blocking = fraction, k
        if blocking < 0:
            for k in range(count):
                lam[k] = wanted[k]
            return count
        for k in range(count):
            lam[k] = max(lam[k] + step * (wanted[k] - lam[k]), 0.0)
        remove(blocking, count, nu, Q, R, rhs, lam, rows, sides)
        count -= 1


def exchange(count: int, R: Matrix, lam: Vector, coefficients: Vector) -> tuple[int, float]:
    """Longest dual step along a dependent row: which row it drives out, and how far, ``(-1, 0)`` if none.

    ``coefficients`` (count,) are overwritten with the row in terms of those of the working set.
    """
    for k in range(count - 1, -1, -1):
        total = coefficients[k]
        for j in range(k + 1, count):
            total -= R[k, j] * coefficients[j]
        coefficients[k] = total / R[k, k]
    leaving, step = -1, 0.0
    for k in range(count):
        if coefficients[k] > 1e-12:
            fraction = lam[k] / coefficients[k]
            if leaving < 0 or fraction < step:
                leaving, step = k, fraction
    if leaving >= 0:
        for k in range(count):
            lam[k] = max(lam[k] - step * coefficients[k], 0.0)
    return leaving, step


def point_of(count: int, nu: int, Q: Matrix, y: Vector, u: Vector) -> None:
    """``u = Q y``, u (nu,), y (count,)."""
    for j in range(nu):
        u[j] = 0.0
    for k in range(count):
        add_scaled(u, y[k], Q[k], nu)


def step_back(count: int, R: Matrix, left: Vector, Q: Matrix, u: Vector) -> None:
    """Take out of ``u`` what is ``left`` (count,) of the violation of its rows: ``u -= Q R'^-1 left``."""
    for k in range(count):
        total = left[k]
        for i in range(k):
            total -= R[i, k] * left[i]
        left[k] = total / R[k, k]
        add_scaled(u, -left[k], Q[k], u.shape[0])


def search(tick: Packed, evaluate_point: Callable, transform: Callable) -> int:
    """Iterate to the solution, from the working set of the last time; a code.

    Leaves the point, the values of the rows there, the working set and its multipliers.
    """
    count = start(tick, evaluate_point, transform)
    for iteration in range(tick.iteration_limit):
        tick.iterations = iteration + 1
        if count > 0:
            count = settle(
                count, tick.u.shape[0], tick.Q, tick.T, tick.rhs, tick.lam, tick.rows, tick.sides, tick.y_dual,
                tick.lam_boundary,
            )  # fmt: skip
            point_of(count, tick.u.shape[0], tick.Q, tick.y_dual, tick.u)
            evaluate_point(tick)
        tick.n_working = count
        row = worst(tick, count)
        if row < 0:
            refine(tick, count, evaluate_point)
            row = worst(tick, count)
            if row < 0:
                return SOLVED
        count = enter_or_exchange(tick, row, count, transform)
        if count < 0:
            return INFEASIBLE
    return TOO_MANY_ITERATIONS


def start(tick: Packed, evaluate_point: Callable, transform: Callable) -> int:
    """The working set of the last time, at the free minimiser; its size. Rows below zero are gone since."""
    u, rows, sides, upper, count = tick.u, tick.rows, tick.sides, tick.upper, 0
    for k in range(u.shape[0]):
        u[k] = 0.0
    evaluate_point(tick)
    for k in range(tick.n_working):
        row, side = rows[k], sides[k]
        if row < 0 or (side > 0.0 and not upper[row] < NO_BOUND):
            continue
        if enter(tick, row, side, count, 0.0, transform):
            count += 1
    return count


def enter(tick: Packed, row: int, side: float, count: int, multiplier: float, transform: Callable) -> bool:
    """Try to add a row to the working set of ``count`` rows; False if it depends on it. Its bound is that at ``u = 0``.

    The value at ``u = 0`` is the value now less what ``u`` changed, so no second point has to be kept.
    """
    transform(tick, row)
    m = tick.m
    nu = m.shape[0]
    limit = tick.upper[row] if side > 0.0 else -tick.lower[row]
    now = side * (tick.value[row] - dot(m, tick.u, nu))
    for k in range(nu):
        m[k] *= side
    if not append(m, limit - now, count, nu, tick.Q, tick.T, tick.rhs, tick.coefficients):
        return False
    tick.rows[count], tick.sides[count], tick.lam[count] = row, side, multiplier
    return True


def enter_or_exchange(tick: Packed, row: int, count: int, transform: Callable) -> int:
    """Add a violated row; rows that it depends on leave. Size of the working set, -1 if no row can leave."""
    coefficients, T, side, multiplier = tick.coefficients, tick.T, 1.0, 0.0
    if not tick.value[row] > tick.upper[row]:
        side = -1.0
    while not enter(tick, row, side, count, multiplier, transform):
        for k in range(count):
            coefficients[k] = T[k, count]
        leaving, step = exchange(count, T, tick.lam, coefficients)
        if leaving < 0:
            return -1
        multiplier += step
        remove(leaving, count, tick.u.shape[0], tick.Q, T, tick.rhs, tick.lam, tick.rows, tick.sides)
        count -= 1
    return count + 1


def refine(tick: Packed, count: int, evaluate_point: Callable) -> None:
    """Correct the boundary point for what rounding left of the violation of its rows, as long as it gets less.

    The correction is added to ``u``: a large penalty makes ``y`` so large that ``Q y`` is rounded at 1e-12, and forces
    are 300 times that.
    """
    left, largest = tick.coefficients, math.inf
    for _ in range(REFINEMENTS):
        before, largest = largest, violation(tick, count, left)
        if not EXACT < largest < 0.5 * before:
            return
        step_back(count, tick.T, left, tick.Q, tick.u)
        evaluate_point(tick)


def violation(tick: Packed, count: int, left: Vector) -> float:
    """How far the rows of the working set are beyond their sides, into ``left`` (count,); the largest amount."""
    value, lower, upper, rows, sides, largest = tick.value, tick.lower, tick.upper, tick.rows, tick.sides, 0.0
    for k in range(count):
        i = rows[k]
        left[k] = value[i] - upper[i] if sides[k] > 0.0 else lower[i] - value[i]
        largest = max(largest, abs(left[k]))
    return largest


def worst(tick: Packed, count: int) -> int:
    """Row that is violated most, in units of ``row_scale``; -1 if none is, or one of the working set.

    What is left of the violation of a row of the working set is rounding.
    """
    value, lower, upper, scale, tolerance = tick.value, tick.lower, tick.upper, tick.row_scale, tick.tolerance
    row, amount = -1, 0.0
    for i in range(value.shape[0]):
        over = max(value[i] - upper[i], lower[i] - value[i])
        if over > tolerance and over * scale[i] > amount:
            row, amount = i, over * scale[i]
    rows = tick.rows
    for k in range(count):
        if rows[k] == row:
            return -1
    return row
