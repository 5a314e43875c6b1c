"""Episode time and chunk numbers of a source that does not see the robot."""

from __future__ import annotations

from math import isfinite

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
