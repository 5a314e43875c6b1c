r"""Where a target that is told now and then will be: kriging of its last values.

The velocity of a hand is taken as random, its values at two times correlated the more the nearer these are,
``exp(-(t - s)^2 / 2 L^2)``, and nothing else is known of where it is. Of all weighted sums of the values so far the one
with the least expected square of the error then follows from how far a target goes in a time ``t`` in the mean,

    G(t) = L^2 (x sqrt(pi / 2) erf(x / sqrt(2)) + exp(-x^2 / 2) - 1),    x = |t| / L

It is smooth in the time that is asked about, follows what bends as far as its past says so, and comes to rest where
that says nothing. The weights add up to one, so a target that is repeated stays.

Source:
    Matheron 1963, "Principles of geostatistics", Economic Geology 58; ordinary kriging with the variogram G.
"""

from __future__ import annotations

from collections import deque
from math import erf

import numpy as np

LENGTH = 0.2
"""Time in which a velocity becomes another one, L [s]; measured: of 0.15 to 0.3, this one foretells a wave of 1 Hz, a
lissajous and a reach best by 0.1 to 0.2 s."""
SCATTER = 1e-5
"""Variance of a value's scatter over that of its velocity, and L [s]; measured: with a hundredth of it, scatter of a
millimetre is foretold as centimetres, with more, motions lag."""
VALUES = 16
"""Values that are kept; derived: twice and a half L at 30 Hz."""
GAP = 0.25
"""Time without a value after which the ones before say nothing of its motion [s]; chosen: two values at 10 Hz, and one
lost."""
INTERVAL, SEEN = 1.0 / 30.0, 3
"""Time between two targets for which steps aside are said [s], and values before one is looked for; chosen: a policy's
actions, and never twice in a row: a target that sets off at once is followed from its second value on."""
BENDS, LATELY = 3.0, 4
"""How many times as far beside as a motion led lately a value is a step aside [no unit], and over how many values;
measured on actions of a policy that lifts a carton: where its chunks meet, what comes 0.2 s later is foretold within 16
mm RMS, 45 by a bound of 12 mm, and waves, a lissajous and scatter as before."""

_TIMES = np.linspace(0.0, 8.0, 4001)
_WAYS = np.array([x * np.sqrt(np.pi / 2.0) * erf(x / np.sqrt(2.0)) + np.exp(-0.5 * x * x) - 1.0 for x in _TIMES])
"""G / L^2 by x: a table, as numpy has no error function."""


class Foretelling:
    """Foretells n numbers from their last values, each at a time of its own.

    Args:
        speed: Fastest change between two values that is a motion; what is faster is a jump, and begins anew [1/s].
        far: How far they are foretold to go at most.
        step: How far beside where its last two values lead a value may be a step aside, `INTERVAL` after them; later
            as much more as a motion then bends. It is one where that is `BENDS` times as far as lately, and then begins
            anew: what is foretold from it as a motion leads far away.
    """

    def __init__(self, speed: float, far: float, step: float = np.inf) -> None:
        self._speed, self._far, self._step = speed, far, step
        self._values: deque[tuple[float, np.ndarray]] = deque(maxlen=VALUES)

    @property
    def last(self) -> tuple[float, np.ndarray] | None:
        """Time [s] and values (n,) of the last ones."""
        return self._values[-1] if self._values else None

    @property
    def interval(self) -> float:
        """Mean time between two values [s]; `GAP` where that is not known."""
        times = [time for time, _ in self._values]
        return (times[-1] - times[0]) / (len(times) - 1) if len(times) > 1 else GAP

    def shifted(self, by: np.ndarray) -> None:
        """Take numbers (n,) off all values: another origin."""
        self._values = deque([(time, value - by) for time, value in self._values], maxlen=VALUES)

    def add(self, time: float, value: np.ndarray) -> None:
        """Take values (n,) at a time after the last one [s]."""
        if self.last is not None:
            before, x = self.last
            fast = np.linalg.norm(value - x) > self._speed * (time - before)
            if time - before > GAP or fast or self._steps(time, value):
                self._values.clear()
        self._values.append((time, np.array(value, dtype=float)))

    def _steps(self, time: float, value: np.ndarray) -> bool:
        """Whether a value is a step aside from a motion that has been seen for `SEEN` values."""
        if len(self._values) < SEEN:
            return False
        lately = [*self._values, (time, value)][-LATELY - 3 :]
        beside = [_beside(*three) for three in zip(lately, lately[1:], lately[2:], strict=False)]
        return beside[-1] > max(self._step, BENDS * max(beside[:-1]))

    def at(self, ages: np.ndarray, until: float) -> np.ndarray:
        """Values at ages after the last ones, shape (H, n).

        Args:
            ages: Shape (H,), [s].
            until: Age at which they have come as far as they may [s].
        """
        last, values = self._values[-1][1], np.stack([value for _, value in self._values])
        times = np.array([time for time, _ in self._values]) - self._values[-1][0]
        n, ways = len(times), -_way(times[:, None] - np.concatenate([times, ages, [until]]))
        system = np.ones((n + 1, n + 1))
        system[:n, :n], system[n, n] = ways[:, :n] + SCATTER * LENGTH * np.eye(n), 0.0
        weights = np.linalg.solve(system, np.vstack([ways[:, n:], np.ones(len(ages) + 1)]))[:n]
        way = weights.T @ (values - last)
        return last + way[:-1] * min(1.0, self._far / max(float(np.linalg.norm(way[-1])), 1e-9))


def _beside(first: tuple, second: tuple, third: tuple) -> float:
    """How far a value is beside where the two before it lead, of times and values; less by as much as it is late."""
    (t0, x0), (t1, x1), (t2, x2) = first, second, third
    far = float(np.linalg.norm(x2 - x1 - (x1 - x0) * (t2 - t1) / (t1 - t0)))
    return far / max(1.0, ((t2 - t1) / INTERVAL) ** 2)


def _way(times: np.ndarray) -> np.ndarray:
    """G over times of any sign, [s^2]."""
    x = np.abs(times) / LENGTH
    return LENGTH**2 * np.where(x < _TIMES[-1], np.interp(x, _TIMES, _WAYS), x * np.sqrt(np.pi / 2.0) - 1.0)


def braked(ages: np.ndarray, free: float, stop: float) -> np.ndarray:
    """Ages (H,) of a motion that goes on for a while and then comes to rest, its speed a minimum-jerk blend [s].

    Args:
        ages: Shape (H,), [s].
        free: Age up to which it goes on [s].
        stop: Time in which it comes to rest from there on [s].
    """
    u = np.clip((ages - free) / stop, 0.0, 1.0)
    return np.minimum(ages, free) + stop * (u - u**4 * (2.5 - 3.0 * u + u * u))
