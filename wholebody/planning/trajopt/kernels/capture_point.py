"""Bounds on where a motion leads: distances until the next knot, and the capture point.

Bodies that approach each other or the floor keep, besides their margin, what they approach in ``approach_time``: the
bound holds between knots too. The capture point ``com + v / omega`` may move towards an edge of the support no faster
than would take it there in ``capture_time``, which is the controller's own bound on it (`wholebody.limits.balance`).
"""

from __future__ import annotations

from wholebody.planning.trajopt.kernels.spline import knot_rate
from wholebody.planning.trajopt.layout import COM, DISTANCE, FREE_LOWER, LOWER, N_BODY, N_FREE, VERTICAL, ZMP
from wholebody.robot.kernels.pendulum import natural_frequency


def approach_margin(k, robot, m) -> None:
    """Add the approach margin to the bounds DISTANCE of a knot, and its factor to ``m.approach``."""
    for c in range(m.n_near[k]):
        row, rate = m.approach[k, c], 0.0
        for j in range(N_BODY):
            rate += row[j] * m.v[k, j]
        m.violation[k, DISTANCE + c] += robot.approach_time * abs(rate)
        scale = robot.approach_time if rate > 0.0 else -robot.approach_time
        for j in range(N_BODY):
            row[j] *= scale


def pendulum(k, robot, m) -> float:
    """Natural frequency of the pendulum under the centre of mass [1/s]."""
    height = m.q[k, 2] + m.I_composite[k, 0, 3] / robot.mass
    return natural_frequency(height)


def capture_point(k, robot, m) -> None:
    """The bounds on the capture point; the state of the first knot is given."""
    E, omega, tau = robot.normals.shape[0], pendulum(k, robot, m), robot.capture_time
    x, y = m.r[k, COM] + robot.com_stance[0], m.r[k, COM + 1] + robot.com_stance[1]
    vx = vy = 0.0
    for j in range(N_BODY):
        vx += m.F[k, j, 0] * m.v[k, j] / robot.mass
        vy += m.F[k, j, 1] * m.v[k, j] / robot.mass
    row = m.dynamics[k]
    px = x + vx / omega + tau * (vx + omega * (x * row[VERTICAL] - row[0]))
    py = y + vy / omega + tau * (vy + omega * (y * row[VERTICAL] - row[1]))
    for e in range(E):
        normal = robot.normals[e]
        violation = normal[0] * px + normal[1] * py - robot.capture_offsets[e]
        m.violation[k, ZMP + 2 * E + e] = violation if k > 0 else -1.0


def approach_and_capture_changes(k, robot, m, dv_mid, x, dynamics, out) -> None:
    """How a step changes both: ``x`` (N_FREE,) of this knot, ``dynamics`` (N_DYNAMICS,) of its rows of the dynamics."""
    for c in range(m.n_near[k]):
        d = 0.0
        for j in range(N_BODY):
            d += m.approach[k, c, j] * (dv_mid[k, j] + dv_mid[k + 1, j])
        out[DISTANCE + c] += 0.5 * d
    E, omega, tau = robot.normals.shape[0], pendulum(k, robot, m), robot.capture_time
    for e in range(E):
        out[ZMP + 2 * E + e] = 0.0
    for a in range(2):
        place = speed = 0.0
        for j in range(N_FREE):
            place += m.J[k, COM + a, j] * x[j]
        for j in range(N_BODY):
            speed += m.F[k, j, a] * (dv_mid[k, j] + dv_mid[k + 1, j])
        com = m.r[k, COM + a] + robot.com_stance[a]
        d = (1.0 + tau * omega * m.dynamics[k, VERTICAL]) * place + (1.0 / omega + tau) * 0.5 * speed / robot.mass
        d += tau * omega * (com * dynamics[VERTICAL] - dynamics[a])
        for e in range(E):
            out[ZMP + 2 * E + e] += robot.normals[e, a] * d


def approach_derivative(c, k, m, dt, out) -> None:
    """Add the derivative of the approach margin of a bound DISTANCE, (3 N_FREE,)."""
    for j in range(N_BODY):
        add_speed(j, m.approach[k, c, j], k, m, dt, out)


def capture_derivative(e, k, robot, m, dt, out) -> None:
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
            add_speed(j, normal * (1.0 / omega + tau) * m.F[k, j, a] / robot.mass, k, m, dt, out)


def add_speed(j, weight, k, m, dt, out) -> None:
    """Add the derivative of the velocity j of a knot, in the free directions of three."""
    f, n, half, K = FREE_LOWER, N_FREE, 0.5 * weight, m.q.shape[0]
    if j >= LOWER:
        u, here, there = f + j - LOWER, half * knot_rate(k, K, dt), half * knot_rate(k + 1, K, dt)
        out[u] -= here
        out[n + u] += here - there
        out[2 * n + u] += there
        return
    for r in range(f):
        out[r] -= half * m.dv_dprev[k, r, j]
        out[n + r] += half * (m.dv_dnext[k, r, j] - m.dv_dprev[k + 1, r, j])
        out[2 * n + r] += half * m.dv_dnext[k + 1, r, j]
