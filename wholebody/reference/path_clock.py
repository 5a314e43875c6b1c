"""The path parameter as a function of time: how far along the chunk the robot is, and how fast it goes along it.

Slowing down along the path keeps its shape. With ``s(t)`` the parameter, ``p(s(t))`` has the derivatives
``p' s_dot`` and ``p'' s_dot^2 + p' s_ddot``; they are continuous because `PathClock` bounds the rate of ``s_ddot``.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import copysign, isfinite, sqrt

import numpy as np

from wholebody.errors import InputError
from wholebody.reference.layout import ALPHA, DDQ_FINGER, DQ_FINGER, A, HandMotion, V, W

_SETTLE_TICKS = 5.0
"""The last part of a change of rate is exponential with this time constant in ticks, instead of bang-bang."""
_SHARE = 0.5
"""Share of the jerk that the braking law counts on; the rest keeps it on the law."""


@dataclass(frozen=True)
class PathClock:
    """Parameter and its derivatives at one instant; `advance` gives the next.

    Attributes:
        s: Path parameter [s].
        rate: ds/dt, 1 at the chunk's own speed, never negative.
        change: d2s/dt2 [1/s].
    """

    s: float
    rate: float = 1.0
    change: float = 0.0

    def advance(self, dt: float, rate: float, *, change_max: float = 4.0, jerk_max: float = 40.0) -> PathClock:
        """The clock one tick later, on its way to another rate.

        Args:
            dt: Tick [s].
            rate: Wanted rate; negative ones are taken as 0.
            change_max: Largest |d2s/dt2| [1/s]: a full stop takes 0.4 s.
            jerk_max: Largest |d3s/dt3| [1/s^2].

        Raises:
            InputError: If the tick is not positive or the rate is not finite.
        """
        if not (dt > 0.0 and isfinite(dt) and isfinite(rate)):
            raise InputError(f"dt {dt} s and rate {rate}: a positive tick and a finite rate are expected", field="dt")
        gap = max(rate, 0.0) - self.rate
        wanted = copysign(
            min(change_max, sqrt(2.0 * _SHARE * jerk_max * abs(gap)), abs(gap) / (_SETTLE_TICKS * dt)), gap
        )
        jerk = min(max((wanted - self.change) / dt, -jerk_max), jerk_max)
        after = self.rate + self.change * dt + 0.5 * jerk * dt**2
        if after < 0.0:  # the last tick of a stop
            return PathClock(self.s + 0.5 * self.rate * dt, 0.0)
        return PathClock(
            self.s + self.rate * dt + 0.5 * self.change * dt**2 + jerk * dt**3 / 6.0, after, self.change + jerk * dt
        )

    def motion(self, motion: HandMotion) -> HandMotion:
        """Derivatives with respect to time of a motion given with respect to ``s``."""
        return time_scaled(motion, self.rate, self.change)


def time_scaled(motion: HandMotion, rate: float | np.ndarray, change: float | np.ndarray) -> HandMotion:
    """A motion's derivatives with respect to time, from those with respect to the path parameter.

    Args:
        motion: Rows ``(..., 40)``.
        rate: ds/dt, scalar or shape ``(...)``.
        change: d2s/dt2 [1/s], scalar or shape ``(...)``.
    """
    rate, change = np.asarray(rate)[..., None], np.asarray(change)[..., None]
    rows = motion.rows.copy()
    for first, second in ((V, A), (W, ALPHA), (DQ_FINGER, DDQ_FINGER)):
        rows[..., second] = motion.rows[..., second] * rate**2 + motion.rows[..., first] * change
        rows[..., first] = motion.rows[..., first] * rate
    return HandMotion(rows)
