"""Clocks: the robot's or a simulation's, and the episode time of a source that does not see the robot."""

from __future__ import annotations

from math import isfinite
from time import monotonic
from typing import Protocol, runtime_checkable

from policy.errors import ObservationError


class EpisodeClock:
    """Counts chunks, and time from the first observation after `reset`."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """The next observation is at episode time 0 and gets chunk 0."""
        self._start: float | None = None
        self._last = float("-inf")
        self._seq = -1

    def tick(self, time: float) -> tuple[int, float]:
        """Number of the next chunk and episode time [s] at an observation.

        Raises:
            ObservationError: If the time is not finite or goes back.
        """
        if not isfinite(time):
            raise ObservationError(f"observation time is {time}; a finite number of seconds is expected")
        if time < self._last:
            raise ObservationError(
                f"observation time {time:.4f} s is before the last one, {self._last:.4f} s; "
                "call reset for a new episode"
            )
        self._start = time if self._start is None else self._start
        self._last = time
        self._seq += 1
        return self._seq, time - self._start


@runtime_checkable
class Clock(Protocol):
    """Where time comes from: the robot's own, or a simulation's."""

    def now(self) -> float:
        """Present time on the robot's clock [s]; never goes back."""
        ...


class MonotonicClock:
    """Real time since it was made [s], untouched by changes of the date."""

    def __init__(self) -> None:
        self._start = monotonic()

    def now(self) -> float:
        """Seconds since the clock was made."""
        return monotonic() - self._start


class SimulatedClock:
    """Time that the loop of the simulation sets."""

    def __init__(self, time: float = 0.0) -> None:
        self.restart(time)

    def now(self) -> float:
        """The time that was set last [s]."""
        return self._now

    def restart(self, time: float = 0.0) -> None:
        """Begin anew, at any time [s]: a new episode."""
        self._now = float(time)

    def set(self, time: float) -> None:
        """Go on to a time [s].

        Raises:
            ValueError: If it is before the present, or no number.
        """
        if not time >= self._now:
            raise ValueError(f"time {time} s is before {self._now} s; use restart for a new episode")
        self._now = float(time)
