"""The path parameter as a function of time, one tick: how far along a path, and how fast along it.

Slowing down along the path keeps its shape. With ``s(t)`` the parameter, ``p(s(t))`` has the derivatives ``p' s_dot``
and ``p'' s_dot^2 + p' s_ddot``; they are continuous because the rate of ``s_ddot`` is bounded.
"""

from __future__ import annotations

import math

from wholebody.jit.arrays import Vector

CHANGE_MAX, JERK_MAX = 4.0, 40.0
"""Largest |d2s/dt2| [1/s] and |d3s/dt3| [1/s^2]; chosen: a full stop takes 0.4 s."""
SETTLE_TICKS = 5.0
"""The last part of a change of rate is exponential with this time constant in ticks; chosen: instead of bang-bang."""
JERK_SHARE = 0.5
"""Share of the jerk that the braking law counts on; chosen: the rest keeps it on the law."""


def advanced(s: float, rate: float, change: float, dt: float, wanted: float) -> tuple[float, float, float]:
    """The clock one tick later, on its way to another rate.

    Args:
        s: Path parameter [s].
        rate: ds/dt, 1 at the path's own speed, never negative.
        change: d2s/dt2 [1/s].
        dt: Tick [s].
        wanted: Rate to come to; a negative one is taken as 0.

    Returns:
        Parameter, rate and change of rate.
    """
    gap = max(wanted, 0.0) - rate
    fastest = min(CHANGE_MAX, math.sqrt(2.0 * JERK_SHARE * JERK_MAX * abs(gap)), abs(gap) / (SETTLE_TICKS * dt))
    jerk = min(max((math.copysign(fastest, gap) - change) / dt, -JERK_MAX), JERK_MAX)
    after = rate + change * dt + 0.5 * jerk * dt**2
    if after < 0.0:  # the last tick of a stop
        return s + 0.5 * rate * dt, 0.0, 0.0
    return s + rate * dt + 0.5 * change * dt**2 + jerk * dt**3 / 6.0, after, change + jerk * dt


def scale(row: Vector, rate: float, change: float) -> None:
    """`wholebody.reference.layout.time_scaled` of one row, in place."""
    for first, second, n in ((3, 6, 3), (13, 16, 3), (26, 33, 7)):
        for k in range(n):
            row[second + k] = row[second + k] * rate**2 + row[first + k] * change
            row[first + k] *= rate
