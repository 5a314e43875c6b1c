"""Where a target that is told now and then will be: a parabola through its last values, followed no further than said.

Source:
    Discounted least squares, the fading-memory polynomial filter of second degree: Morrison 1969, "Introduction to
    Sequential Smoothing and Prediction"; Brookner 1998, "Tracking and Kalman Filtering Made Easy", section 1.2.
"""

from __future__ import annotations

from collections import deque

import numpy as np

MEMORY = 0.02
"""Time in which the weight of a value falls to 1/e [s]; measured: longer ones are off more where hands turn round,
and at 30 Hz this one passes 3 times the scatter of a value on to where it is extrapolated a step."""
VALUES = 12
"""Values that are kept; derived: six times the memory at 100 Hz."""
GAP = 0.25
"""Time without a value after which the ones before say nothing of its motion [s]; chosen: two values at 10 Hz, and one
lost."""


class FadingParabola:
    """Predicts n numbers from their last values, each at a time of its own.

    Args:
        speed: Fastest change between two values that is a motion; what is faster is a jump, and begins anew [1/s].
        acceleration: Largest one that is believed [1/s^2].
    """

    def __init__(self, speed: float, acceleration: float) -> None:
        self._speed, self._acceleration = speed, acceleration
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
            if time - before > GAP or np.linalg.norm(value - x) > self._speed * (time - before):
                self._values.clear()
        self._values.append((time, np.array(value, dtype=float)))

    def jet(self) -> np.ndarray:
        """Value, velocity and acceleration at the last time, shape (3, n): zero rates where they are not known."""
        times = np.array([time for time, _ in self._values])
        values = np.stack([value for _, value in self._values])
        age, degree = times - times[-1], min(len(times) - 1, 2)
        jet = np.zeros((3, values.shape[1]))
        weights = np.exp(0.5 * age / max(MEMORY, 1e-9))[:, None]
        powers = age[:, None] ** np.arange(degree + 1)
        # Of few values that are far apart only the last ones count: the others are too light for the arithmetic.
        weights = np.maximum(weights, 1e-4)
        found = np.linalg.lstsq(weights * powers, weights * values, rcond=None)[0]
        jet[: degree + 1] = found * np.array([1.0, 1.0, 2.0])[: degree + 1, None]
        for order, most in ((1, self._speed), (2, self._acceleration)):
            jet[order] *= min(1.0, most / max(float(np.linalg.norm(jet[order])), 1e-9))
        return jet


def braked(jet: np.ndarray, ages: np.ndarray, free: float, stop: float) -> np.ndarray:
    """Values of a parabola at ages, that comes to rest after a while.

    Its velocity is faded out with a minimum-jerk blend, so that position, velocity and acceleration are continuous but
    for the acceleration's jump where that begins.

    Args:
        jet: Value, velocity and acceleration at age 0, shape (3, n).
        ages: Shape (H,), [s].
        free: Age up to which it is followed [s].
        stop: Time in which it comes to rest from there on [s].

    Returns:
        Shape (H, n).
    """
    h = np.minimum(ages, free)[:, None]
    u = np.clip((ages - free) / stop, 0.0, 1.0)[:, None]
    leaving = jet[1] + free * jet[2]
    return jet[0] + h * jet[1] + 0.5 * h * h * jet[2] + leaving * stop * (u - u**4 * (2.5 - 3.0 * u + u * u))
