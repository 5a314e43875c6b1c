"""Bounds that look ahead: distances between knots, and the capture point; compiles with numba as it stands.

Bodies that approach each other or the floor have to be as far away as they need between two knots. The capture point
has to be where the controller's own bound on it lets it go on: no faster towards an edge than would take it there in a
given time.
"""

from __future__ import annotations

import math

from wholebody.planning.trajopt.kernels.spline import pace
from wholebody.planning.trajopt.layout import COM, FREE_LOWER, LOADED, LOWER, N_BODY, N_FREE, NEAR, ZMP

GRAVITY, LOWEST_HEIGHT = 9.81, 0.2
"""Of the pendulum [m/s^2], and its least height [m], as `wholebody.limits.balance`."""


def sweep(k, robot, m):
    """Make the bounds NEAR of a knot hold for a while before and after it; completes ``m.sweeps``."""
    for c in range(m.near[k]):
        row, rate = m.sweeps[k, c], 0.0
        for j in range(N_BODY):
            rate += row[j] * m.v[k, j]
        m.over[k, NEAR + c] += robot.sweep * abs(rate)
        scale = robot.sweep if rate > 0.0 else -robot.sweep
        for j in range(N_BODY):
            row[j] *= scale


def pendulum(k, robot, m):
    """Natural frequency of the pendulum under the centre of mass [1/s]."""
    height = m.q[k, 2] + m.trees[k, 0, 3] / robot.mass
    return math.sqrt(GRAVITY / max(height, LOWEST_HEIGHT))


def capture(k, robot, m):
    """The bounds on the capture point; the state of the first knot is given."""
    E, omega, tau = robot.normals.shape[0], pendulum(k, robot, m), robot.capture_time
    x, y = m.r[k, COM] + robot.com_stance[0], m.r[k, COM + 1] + robot.com_stance[1]
    vx = vy = 0.0
    for j in range(N_BODY):
        vx += m.F[k, j, 0] * m.v[k, j] / robot.mass
        vy += m.F[k, j, 1] * m.v[k, j] / robot.mass
    row = m.m[k]
    px = x + vx / omega + tau * (vx + omega * (x * row[LOADED] - row[0]))
    py = y + vy / omega + tau * (vy + omega * (y * row[LOADED] - row[1]))
    for e in range(E):
        normal = robot.normals[e]
        over = normal[0] * px + normal[1] * py - robot.capture_offsets[e]
        m.over[k, ZMP + 2 * E + e] = over if k > 0 else -1.0


def look_changes(k, robot, m, dh, x, motion, out):
    """How a step changes them: ``x`` (N_FREE,) of this knot, ``motion`` (N_MOTION,) of its rows of the motion."""
    for c in range(m.near[k]):
        d = 0.0
        for j in range(N_BODY):
            d += m.sweeps[k, c, j] * (dh[k, j] + dh[k + 1, j])
        out[NEAR + c] += 0.5 * d
    E, omega, tau = robot.normals.shape[0], pendulum(k, robot, m), robot.capture_time
    for e in range(E):
        out[ZMP + 2 * E + e] = 0.0
    for a in range(2):
        place = speed = 0.0
        for j in range(N_FREE):
            place += m.J[k, COM + a, j] * x[j]
        for j in range(N_BODY):
            speed += m.F[k, j, a] * (dh[k, j] + dh[k + 1, j])
        com = m.r[k, COM + a] + robot.com_stance[a]
        d = (1.0 + tau * omega * m.m[k, LOADED]) * place + (1.0 / omega + tau) * 0.5 * speed / robot.mass
        d += tau * omega * (com * motion[LOADED] - motion[a])
        for e in range(E):
            out[ZMP + 2 * E + e] += robot.normals[e, a] * d


def sweep_derivative(c, k, m, dt, out):
    """Add what `sweep` adds to the derivative of a bound NEAR, (3 N_FREE,)."""
    for j in range(N_BODY):
        add_speed(j, m.sweeps[k, c, j], k, m, dt, out)


def capture_derivative(e, k, robot, m, dt, out):
    """Derivative (3 N_FREE,) of the bound on the capture point at one edge."""
    omega, tau, n = pendulum(k, robot, m), robot.capture_time, N_FREE
    for a in range(2):
        normal, J = robot.normals[e, a], m.J_m[k]
        com, place = m.r[k, COM + a] + robot.com_stance[a], 1.0 + tau * omega * m.m[k, LOADED]
        for j in range(n):
            out[n + j] += normal * place * m.J[k, COM + a, j]
        for j in range(3 * n):
            out[j] += normal * tau * omega * (com * J[LOADED, j] - J[a, j])
        for j in range(N_BODY):
            add_speed(j, normal * (1.0 / omega + tau) * m.F[k, j, a] / robot.mass, k, m, dt, out)


def add_speed(j, weight, k, m, dt, out):
    """Add the derivative of the velocity j of a knot, in the free directions of three."""
    f, n, half, K = FREE_LOWER, N_FREE, 0.5 * weight, m.q.shape[0]
    if j >= LOWER:
        u, here, there = f + j - LOWER, half * pace(k, K, dt), half * pace(k + 1, K, dt)
        out[u] -= here
        out[n + u] += here - there
        out[2 * n + u] += there
        return
    for r in range(f):
        out[r] -= half * m.behind[k, r, j]
        out[n + r] += half * (m.ahead[k, r, j] - m.behind[k + 1, r, j])
        out[2 * n + r] += half * m.ahead[k + 1, r, j]
