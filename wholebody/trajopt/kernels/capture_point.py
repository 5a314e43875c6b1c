"""Bounds on where a motion leads: distances until the next knot, and the capture point.

Distances are measured at the knots, which are control points; where the motion bends, its curve passes beside them, by
a sixth of the second difference. Bounds on distances are those of the curve where bodies are nearest to each other, or
to the floor, within ``approach_time`` of the knot, to second order: they hold between knots too. Otherwise arms that
swing past each other go through each other by 30 mm between knots that are far enough apart. The capture point
``com + v / omega`` may move towards an edge of the support no faster than would take it there in ``capture_time``,
which is the controller's own bound on it (`wholebody.limits.balance`).
"""

from __future__ import annotations

from wholebody.jit.arrays import Matrix, Vector
from wholebody.jit.vectors import dot
from wholebody.robot.kernels.pendulum import natural_frequency
from wholebody.trajopt.arrays import KnotTargets, Tables
from wholebody.trajopt.kernels.spline import knot_rate
from wholebody.trajopt.layout import COM, DISTANCE, FREE_LOWER, LOWER, N_BODY, N_FREE, VERTICAL, ZMP
from wholebody.trajopt.workspace import KnotMotion

CURVE_OFFSET = 1.0 / 6.0
"""Of the cubic B-spline from its control point at a knot, in terms of their second difference [no unit]; derived."""


def approach_margin(k: int, robot: Tables, m: KnotMotion, dt: float) -> None:
    """Bring the bounds DISTANCE of a knot to the curve, where that is nearest within the approach time of the knot.

    The time from the knot to there, to second order, goes into ``m.sign`` [s].
    """
    for c in range(m.n_near[k]):
        row, rate, bend = m.approach[k, c], 0.0, 0.0
        for j in range(N_BODY):
            rate += row[j] * m.v[k, j]
            bend += row[j] * m.a[k, j]
        time = robot.approach_time
        if abs(rate) < -bend * time:
            time = abs(rate) / -bend
        m.violation[k, DISTANCE + c] += abs(rate) * time + (0.5 * time * time + CURVE_OFFSET * dt * dt) * bend
        m.sign[k, DISTANCE + c] = time if rate > 0.0 else -time


def approach_weights(c: int, k: int, m: KnotMotion, dt: float) -> tuple[float, float]:
    """Weights [s] of the velocities before and after a knot in what `approach_margin` adds to bound DISTANCE + c."""
    time = m.sign[k, DISTANCE + c]
    bend = 0.5 * time * time / dt + CURVE_OFFSET * dt
    return 0.5 * time - bend, 0.5 * time + bend


def pendulum(k: int, robot: Tables, m: KnotMotion) -> float:
    """Natural frequency of the pendulum under the centre of mass [1/s]."""
    height = m.q[k, 2] + m.I_composite[k, 0, 3] / robot.mass
    return natural_frequency(height)


def capture_point(k: int, robot: Tables, task: KnotTargets, m: KnotMotion) -> None:
    """The bounds on the capture point; the state of the first knot is given.

    What pushes the palms moves the weight as the floor does; derivatives leave out how that changes with the motion.
    """
    E, omega, tau = robot.normals.shape[0], pendulum(k, robot, m), robot.capture_time
    x, y = m.r[k, COM] + robot.com_stance[0], m.r[k, COM + 1] + robot.com_stance[1]
    vx = vy = 0.0
    for j in range(N_BODY):
        vx += m.F[k, j, 0] * m.v[k, j] / robot.mass
        vy += m.F[k, j, 1] * m.v[k, j] / robot.mass
    row = m.dynamics[k]
    fx, fy, fz = row[0], row[1], row[VERTICAL]
    if task.pushed:
        fx, fy, fz = fx - m.pushed[k, 0], fy - m.pushed[k, 1], fz - m.pushed[k, VERTICAL]
    px = x + vx / omega + tau * (vx + omega * (x * fz - fx))
    py = y + vy / omega + tau * (vy + omega * (y * fz - fy))
    for e in range(E):
        normal = robot.normals[e]
        violation = normal[0] * px + normal[1] * py - robot.capture_offsets[e]
        m.violation[k, ZMP + 2 * E + e] = violation if k > 0 else -1.0


def approach_and_capture_changes(
    k: int, robot: Tables, m: KnotMotion, dt: float, dv_mid: Matrix, x: Vector, dynamics: Vector, out: Vector
) -> None:
    """How a step changes both: ``x`` (N_FREE,) of this knot, ``dynamics`` (N_DYNAMICS,) of its rows of the dynamics."""
    for c in range(m.n_near[k]):
        before, after = approach_weights(c, k, m, dt)
        row = m.approach[k, c]
        out[DISTANCE + c] += before * dot(row, dv_mid[k], N_BODY) + after * dot(row, dv_mid[k + 1], N_BODY)
    E, omega, tau = robot.normals.shape[0], pendulum(k, robot, m), robot.capture_time
    for e in range(E):
        out[ZMP + 2 * E + e] = 0.0
    for a in range(2):
        place, speed = dot(m.J[k, COM + a], x, N_FREE), 0.0
        for j in range(N_BODY):
            speed += m.F[k, j, a] * (dv_mid[k, j] + dv_mid[k + 1, j])
        com = m.r[k, COM + a] + robot.com_stance[a]
        d = (1.0 + tau * omega * m.dynamics[k, VERTICAL]) * place + (1.0 / omega + tau) * 0.5 * speed / robot.mass
        d += tau * omega * (com * dynamics[VERTICAL] - dynamics[a])
        for e in range(E):
            out[ZMP + 2 * E + e] += robot.normals[e, a] * d


def approach_derivative(c: int, k: int, m: KnotMotion, dt: float, out: Vector) -> None:
    """Add the derivative of what `approach_margin` adds to a bound DISTANCE, (3 N_FREE,)."""
    before, after = approach_weights(c, k, m, dt)
    for j in range(N_BODY):
        add_speeds(j, m.approach[k, c, j] * before, m.approach[k, c, j] * after, k, m, dt, out)


def capture_derivative(e: int, k: int, robot: Tables, m: KnotMotion, dt: float, out: Vector) -> None:
    """Derivative (3 N_FREE,) of the bound on the capture point at one edge."""
    omega, tau, n = pendulum(k, robot, m), robot.capture_time, N_FREE
    for a in range(2):
        normal, J = robot.normals[e, a], m.J_dynamics[k]
        com, place = m.r[k, COM + a] + robot.com_stance[a], 1.0 + tau * omega * m.dynamics[k, VERTICAL]
        for j in range(n):
            out[n + j] += normal * place * m.J[k, COM + a, j]
        for j in range(3 * n):
            out[j] += normal * tau * omega * (com * J[VERTICAL, j] - J[a, j])
        for j in range(N_BODY):
            half = 0.5 * normal * (1.0 / omega + tau) * m.F[k, j, a] / robot.mass
            add_speeds(j, half, half, k, m, dt, out)


def add_speeds(j: int, before: float, after: float, k: int, m: KnotMotion, dt: float, out: Vector) -> None:
    """Add the derivative of the velocities j before and after a knot, by their weights, in the directions of three."""
    f, n, K = FREE_LOWER, N_FREE, m.q.shape[0]
    if j >= LOWER:
        u, here, there = f + j - LOWER, before * knot_rate(k, K, dt), after * knot_rate(k + 1, K, dt)
        out[u] -= here
        out[n + u] += here - there
        out[2 * n + u] += there
        return
    for r in range(f):
        out[r] -= before * m.dv_dprev[k, r, j]
        out[n + r] += before * m.dv_dnext[k, r, j] - after * m.dv_dprev[k + 1, r, j]
        out[2 * n + r] += after * m.dv_dnext[k + 1, r, j]
