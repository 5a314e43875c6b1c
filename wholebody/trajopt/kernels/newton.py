"""The step that minimises the linearised cost. Layouts as in `cost`.

It is convex and piecewise quadratic: squares, and penalties on the bounds that are exceeded. Newton's method on that
active set with an exact line search ends at the minimum after finitely many steps. Panels of the Cholesky factor before
the first knot at which the active set changes stay as they are.
"""

from __future__ import annotations

from wholebody.jit.arrays import Vector
from wholebody.trajopt.arrays import KnotTargets, Tables
from wholebody.trajopt.kernels.banded import factor, solve, times
from wholebody.trajopt.kernels.inequalities import add_active, changes
from wholebody.trajopt.layout import COM_EDGE, N_FREE, N_PANEL, RIGHT
from wholebody.trajopt.workspace import AssemblyScratch, KnotMotion, System

FULL_STEP = 0.99
"""Share of Newton's step from which on it counts as a whole one; chosen: the line search is exact to 1e-6."""


def step(
    robot: Tables, task: KnotTargets, m: KnotMotion, penalties: Vector, system: System, work: AssemblyScratch,
    damping: float, limit: int, largest: float
) -> tuple[float, float, bool]:  # fmt: skip
    """Fill ``system.z`` with the step.

    Args:
        robot: `arrays.Tables`.
        task: `arrays.KnotTargets`.
        m: `workspace.KnotMotion`.
        penalties: Of the bounds that count (n_inequalities,), with those between knots (n_rows,).
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
        if not factor(first, K, s.panels):
            return 0.0, -1.0, False
        solve(K, s.panels, s.y)
        for k in range(2, K + 1):
            for i in range(N_FREE):
                s.direction[k, i] = s.y[k, i] - s.z[k, i]
        changes(robot, m, dt, s.direction, task.between, s.change, work)
        times(K, s.H, s.y, s.Hy)
        for k in range(2, K + 1):
            for i in range(N_FREE):
                s.Hd[k, i] = s.Hy[k, i] + s.damping[k, i] * s.y[k, i] - s.Hz[k, i]
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


def advance(K: int, t: float, s: System) -> float:
    """Go along the direction; the largest entry of the step."""
    size = 0.0
    for k in range(2, K + 1):
        for i in range(N_FREE):
            s.z[k, i] += t * s.direction[k, i]
            s.Hz[k, i] += t * s.Hd[k, i]
            size = max(size, abs(s.z[k, i]))
    return size


def find_active(robot: Tables, m: KnotMotion, s: System) -> int:
    """List the bounds that are exceeded; the first knot at which the list changes, else the number of knots."""
    K, n = s.active.shape
    first = K
    for k in range(K):
        start = 0 if k > 0 else COM_EDGE + robot.normals.shape[0]
        if list_exceeded(k, start, n, m.violation[k], s.along[k], s):
            first = min(first, k)
    return first


def list_exceeded(k: int, start: int, stop: int, violation: Vector, change: Vector, s: System) -> bool:
    """List the bounds of a knot from ``start`` on that are exceeded after a change; whether that changes the list."""
    active, before, count, changed = s.active[k], s.n_active[k], 0, False
    for i in range(start, stop):
        if violation[i] + change[i] > 0.0:
            changed = changed or count >= before or active[count] != i
            active[count] = i
            count += 1
    s.n_active[k] = count
    return changed or count != before


def newton(
    first: int, robot: Tables, m: KnotMotion, dt: float, penalties: Vector, s: System, work: AssemblyScratch
) -> None:
    """Hessian and minus the gradient (K + 2 panels) with the bounds that are exceeded, from panel ``first + 1`` on."""
    K = m.q.shape[0]
    for k in range(first + 1, K + 2):
        for i in range(N_FREE):
            row, H = s.panels[k, i], s.H[k, i]
            for j in range(N_PANEL):
                row[j] = H[j]
            row[i] += s.damping[k, i]
            row[RIGHT] = -s.g[k, i]
    for k in range(first - 1, K):
        add_active(k, first + 1, robot, m, dt, penalties, s, work)


def line_search(K: int, m: KnotMotion, penalties: Vector, s: System) -> float:
    """Step, 0 to 1, at which the cost along ``direction`` (K + 2, N_FREE) is least."""
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


def decrease(K: int, m: KnotMotion, penalties: Vector, s: System) -> float:
    """Fall of the cost from 0 to z by the quadratic model, without its damping."""
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
