"""The step that minimises the linearised cost. Layouts as in `cost`.

It is convex and piecewise quadratic: squares, and penalties on the bounds that are exceeded. Newton's method on that
active set with an exact line search ends at the minimum after finitely many steps. Panels of the Cholesky factor before
the first knot at which the active set changes stay as they are.
"""

from __future__ import annotations

import math

from wholebody.jit.blas import gram
from wholebody.planning.trajopt.kernels.inequalities import add_active, changes
from wholebody.planning.trajopt.layout import COM_EDGE, N_FREE

FULL_STEP = 0.99
"""Share of Newton's step from which on it counts as a whole one; chosen: the line search is exact to 1e-6."""


def step(robot, task, m, penalties, system, work, damping, limit, largest) -> tuple[float, float, bool]:
    """Fill ``system.z`` with the step.

    Args:
        robot: `arrays.Tables`.
        task: `arrays.Task`.
        m: `workspace.Motion`.
        penalties: Of the bounds (n_inequalities,).
        system: `workspace.System`, assembled.
        work: `workspace.AssemblyScratch`.
        damping: Added to the Hessian, as a share of its diagonal and by itself.
        limit: Most Newton steps, each on the active set that the one before led to.
        largest: Entry of the step above which the search is given up: the caller damps more.

    Returns:
        The decrease of the cost that the linear program promises, the largest entry, -1 if it is singular, and whether
        the step is the program's exact one.
    """
    s = system
    K, dt = m.q.shape[0], task.dt
    s.z[:] = 0.0
    s.Hz[:] = 0.0
    s.along[:] = 0.0
    for k in range(1, K):
        for i in range(N_FREE):
            s.damping[k + 1, i] = damping * (s.H[k + 1, i, i] + 1.0)
    find_active(robot, m, s)
    first, size, exact = 1, 0.0, False
    for _ in range(limit):
        newton(first, robot, m, dt, penalties, s, work)
        if not factor(first, K, s, work):
            return 0.0, -1.0, False
        solve(K, s)
        for k in range(2, K + 1):
            for i in range(N_FREE):
                s.direction[k, i] = s.y[k, i] - s.z[k, i]
        changes(robot, m, dt, s.direction, s.change, work)
        times(K, s.H, s.damping, s.direction, s.Hd)
        t = line_search(K, m, penalties, s)
        size = advance(K, t, s)
        if size > largest:
            return 0.0, size, False
        for k in range(K):
            for i in range(penalties.shape[0]):
                s.along[k, i] += t * s.change[k, i]
        first = find_active(robot, m, s)
        exact = first == K and t > FULL_STEP
        if exact:
            break
        first = max(1, first - 1)
    return decrease(K, m, penalties, s), size, exact


def advance(K, t, s) -> float:
    """Go along the direction; the largest entry of the step."""
    size = 0.0
    for k in range(2, K + 1):
        for i in range(N_FREE):
            s.z[k, i] += t * s.direction[k, i]
            s.Hz[k, i] += t * s.Hd[k, i]
            size = max(size, abs(s.z[k, i]))
    return size


def find_active(robot, m, s) -> int:
    """List the bounds that are exceeded; the first knot at which the list changes, else the number of knots."""
    K, n = s.active.shape
    start, first = COM_EDGE + robot.normals.shape[0], K
    for k in range(K):
        for i in range(0 if k > 0 else start, n):
            now = m.violation[k, i] + s.along[k, i] > 0.0
            if now != s.active[k, i]:
                s.active[k, i] = now
                first = min(first, k)
    return first


def newton(first, robot, m, dt, penalties, s, work) -> None:
    """Hessian and gradient with the bounds that are exceeded, from panel ``first + 1`` on."""
    K = m.q.shape[0]
    for k in range(first + 1, K + 2):
        for i in range(N_FREE):
            s.gradient[k, i] = s.g[k, i]
            for j in range(3 * N_FREE):
                s.panels[k, i, j] = s.H[k, i, j]
    for k in range(first - 1, K):
        add_active(k, first + 1, robot, m, dt, penalties, s.active, s.panels, s.gradient, work.row)
    for k in range(first, K):
        for i in range(N_FREE):
            s.panels[k + 1, i, i] += s.damping[k + 1, i]


def factor(first, K, s, work) -> bool:
    """Cholesky factor ``U' U`` of the panels from knot ``first`` on; False if they are singular."""
    n = N_FREE
    for k in range(first, K):
        U, tail = s.panels[k + 1], s.tails[k + 1]
        if k > 1:
            before = s.tails[k]
            for i in range(n):
                for j in range(2 * n):
                    U[i, j] -= before[i, j]
        if k > 2:
            before = s.tails[k - 1]
            for i in range(n):
                for j in range(n):
                    U[i, j] -= before[n + i, n + j]
        if not factor_panel(U):
            return False
        rest = work.rest
        for i in range(n):
            for j in range(2 * n):
                rest[i, j] = U[i, n + j]
        gram(rest, tail)
    return True


def factor_panel(U) -> bool:
    """The upper triangle of the own block and the rows to its right, in place.

    Loops begin at zero and run along rows: only those become vector instructions.
    """
    n = U.shape[0]
    for i in range(n):
        row, k = U[i, i:], 0
        m = row.shape[0]
        while k + 4 <= i:
            r0, r1, r2, r3 = U[k, i:], U[k + 1, i:], U[k + 2, i:], U[k + 3, i:]
            c0, c1, c2, c3 = r0[0], r1[0], r2[0], r3[0]
            for j in range(m):
                row[j] -= c0 * r0[j] + c1 * r1[j] + c2 * r2[j] + c3 * r3[j]
            k += 4
        while k < i:
            r0 = U[k, i:]
            subtract(r0[0], r0, row, m)
            k += 1
        if not row[0] > 0.0:
            return False
        size = 1.0 / math.sqrt(row[0])
        for j in range(m):
            row[j] *= size
    return True


def subtract(c, row, out, n) -> None:
    """``out -= c row`` of the first n entries."""
    for j in range(n):
        out[j] -= c * row[j]


def dot(a, b, n) -> float:
    """Scalar product of the first n entries, in eight interleaved sums."""
    s0 = s1 = s2 = s3 = s4 = s5 = s6 = s7 = 0.0
    for i in range(n // 8):
        j = 8 * i
        s0 += a[j] * b[j]
        s1 += a[j + 1] * b[j + 1]
        s2 += a[j + 2] * b[j + 2]
        s3 += a[j + 3] * b[j + 3]
        s4 += a[j + 4] * b[j + 4]
        s5 += a[j + 5] * b[j + 5]
        s6 += a[j + 6] * b[j + 6]
        s7 += a[j + 7] * b[j + 7]
    for j in range(n - n % 8, n):
        s0 += a[j] * b[j]
    return ((s0 + s1) + (s2 + s3)) + ((s4 + s5) + (s6 + s7))


def solve(K, s) -> None:
    """``y = - (U' U)^-1 gradient``."""
    n, y = N_FREE, s.y
    for k in range(K + 2):
        for i in range(n):
            y[k, i] = -s.gradient[k, i] if 1 < k <= K else 0.0
    flat = y.reshape(y.size)
    for k in range(2, K + 1):
        m = min(3, K + 1 - k) * n
        for i in range(n):
            row, rest = s.panels[k, i, i:], flat[n * k + i :]
            c = rest[0] / row[0]
            subtract(c, row, rest, m - i)
            rest[0] = c
    for k in range(K, 1, -1):
        m = min(3, K + 1 - k) * n
        for i in range(n - 1, -1, -1):
            row, rest = s.panels[k, i, i:], flat[n * k + i :]
            rest[0] = (rest[0] - dot(row[1:], rest[1:], m - i - 1)) / row[0]


def times(K, H, extra, x, out) -> None:
    """``out = (H + extra) x``."""
    n = N_FREE
    flat, result = x.reshape(x.size), out.reshape(out.size)
    for i in range(result.size):
        result[i] = 0.0
    for k in range(2, K + 1):
        m = min(3, K + 1 - k) * n
        for i in range(n):
            row, here, there = H[k, i], flat[n * k :], result[n * k :]
            c = here[i]
            there[i] += extra[k, i] * c + dot(row[n:], here[n:], m - n)
            subtract(-c, row, there, m)


def line_search(K, m, penalties, s) -> float:
    """Where between 0 and 1 the cost along the direction is least."""
    slope, curvature = 0.0, 0.0
    for k in range(2, K + 1):
        for i in range(N_FREE):
            slope += s.direction[k, i] * (s.g[k, i] + s.Hz[k, i])
            curvature += s.direction[k, i] * s.Hd[k, i]
    count, n = 0, penalties.shape[0]
    for k in range(K):
        for i in range(n):
            x, c = m.violation[k, i] + s.along[k, i], s.change[k, i]
            if c != 0.0 and (x > 0.0 or x + c > 0.0):
                s.rows[count, 0], s.rows[count, 1], s.rows[count, 2] = x, c, penalties[i] * c
                count += 1
    low, high, t = 0.0, 1.0, 1.0
    for _ in range(30):
        value, rate = slope + t * curvature, curvature
        for i in range(count):
            x = s.rows[i, 0] + t * s.rows[i, 1]
            if x > 0.0:
                value += s.rows[i, 2] * x
                rate += s.rows[i, 2] * s.rows[i, 1]
        if value <= 0.0:
            low = t
        else:
            high = t
        if low == 1.0 or high - low < 1e-6:
            break
        t -= value / rate
        if not low < t < high:
            t = 0.5 * (low + high)
    return max(low, 1e-3)


def decrease(K, m, penalties, s) -> float:
    """By how much the cost falls at z, without the damping."""
    total = 0.0
    for k in range(2, K + 1):
        for i in range(N_FREE):
            z = s.z[k, i]
            total -= z * (2.0 * s.g[k, i] + s.Hz[k, i] - s.damping[k, i] * z)
    for k in range(K):
        for i in range(penalties.shape[0]):
            x = m.violation[k, i]
            y = x + s.along[k, i]
            if x > 0.0:
                total += penalties[i] * x * x
            if y > 0.0:
                total -= penalties[i] * y * y
    return total
