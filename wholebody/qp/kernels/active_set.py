r"""A dual active-set method for the reduced program; compiles with numba as it stands.

With ``H = U'U`` and ``x = x_0 + U^-1 u``, ``x_0`` the free minimiser, the program is to find the shortest ``u``
with ``m_i u <= d_i``. The rows of the working set are kept as ``[m_1 ... m_k] = Q R`` with orthonormal columns of Q, so
the shortest ``u`` on their boundary is ``Q y`` with ``R' y = d`` and its multipliers are ``-R^-1 y``: no squared
condition number, and only rows that were active once are ever transformed. A start from the last working set costs its
size, not the iterations that led there.

Q is stored by rows: ``Q[k]`` is the column k above.

Source:
    Goldfarb and Idnani 1983, "A numerically stable dual method for solving strictly convex quadratic programs",
    Mathematical Programming 27; Arnstroem, Bemporad and Axehill 2022, "A Dual Active-Set Solver for Embedded Quadratic
    Programming Using Recursive LDL' Updates", IEEE TAC 67(8).
"""

import math

from wholebody.qp.kernels.linear_algebra import add_scaled, dot

DEPENDENT = 1e-10
"""A row whose part outside the working set is smaller than this share of it counts as dependent."""


def append(m, d, count, nu, Q, R, rhs, scratch):
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


def remove(at, count, nu, Q, R, rhs, lam, rows, sides):
    """Take row ``at`` out of the working set of ``count`` rows; the others move up."""
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


def multipliers(count, R, rhs, y, wanted):
    """``y = R'^-1 rhs`` and the multipliers ``-R^-1 y`` of the working set."""
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


def settle(count, nu, Q, R, rhs, lam, rows, sides, y, wanted):
    """Drop rows until all multipliers of the working set are those of its boundary and none is negative.

    Returns:
        Number of rows left.
    """
    while True:
        multipliers(count, R, rhs, y, wanted)
        step, blocking = 1.0, -1
        for k in range(count):
            if wanted[k] < 0.0:
                share = lam[k] / (lam[k] - wanted[k])
                # Of several that block at once, the most negative one goes.
                if share < step or (share == step and (blocking < 0 or wanted[k] < wanted[blocking])):
                    step, blocking = share, k
        if blocking < 0:
            for k in range(count):
                lam[k] = wanted[k]
            return count
        for k in range(count):
            lam[k] = max(lam[k] + step * (wanted[k] - lam[k]), 0.0)
        remove(blocking, count, nu, Q, R, rhs, lam, rows, sides)
        count -= 1


def exchange(count, R, lam, coefficients):
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
            share = lam[k] / coefficients[k]
            if leaving < 0 or share < step:
                leaving, step = k, share
    if leaving >= 0:
        for k in range(count):
            lam[k] = max(lam[k] - step * coefficients[k], 0.0)
    return leaving, step


def point_of(count, nu, Q, y, u):
    """``u = Q y``."""
    for j in range(nu):
        u[j] = 0.0
    for k in range(count):
        add_scaled(u, y[k], Q[k], nu)


def step_back(count, R, left, Q, u):
    """Take out of ``u`` what is ``left`` (count,) of the violation of its rows: ``u -= Q R'^-1 left``."""
    for k in range(count):
        total = left[k]
        for i in range(k):
            total -= R[i, k] * left[i]
        left[k] = total / R[k, k]
        add_scaled(u, -left[k], Q[k], u.shape[0])


def worst(value, lower, upper, size, n, tolerance):
    """Row that is violated most, measured in units of ``size``; -1 if none is violated by more than ``tolerance``."""
    row, amount = -1, 0.0
    for i in range(n):
        over = max(value[i] - upper[i], lower[i] - value[i])
        if over > tolerance and over * size[i] > amount:
            row, amount = i, over * size[i]
    return row
