"""How punctual the control loop is: histogram of lateness, gaps with their cause, missed ticks."""

from __future__ import annotations

import resource
from dataclasses import dataclass, field
from time import thread_time

import numpy as np

EDGES_MS = (0.1, 0.2, 0.5, 1.0, 2.0, 4.0, 8.0, 20.0, 100.0)
"""Upper edges of the histogram's bins [ms]; a last one holds what is later; chosen."""
GAP_LISTED = 4e-3
"""Time between two ticks from which it is listed [s]; chosen: two control periods."""
GAPS_MAX = 1000
"""How many gaps are kept."""


@dataclass(frozen=True)
class LoopGap:
    """A time in which the control loop did not run when it should have.

    Attributes:
        time: When it ended [s].
        seconds: Between both ticks [s].
        cpu: CPU time of the control loop in it [s]: little of it means that it was not let run.
        preempted, waited: How often the system took the core away, and how often the loop gave it up.
    """

    time: float
    seconds: float
    cpu: float
    preempted: int
    waited: int


@dataclass
class Lateness:
    """Times of the ticks of a loop.

    Args:
        period: Between two ticks [s].

    Attributes:
        ticks, missed: How many there were, and how many periods went by without one.
        gaps: The first `GAPS_MAX` times above `GAP_LISTED` between two ticks.
        n_gaps: How many there were in all.
        last_tick: How long the last tick took [s].
    """

    period: float
    ticks: int = 0
    missed: int = 0
    n_gaps: int = 0
    gaps: list[LoopGap] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._edges = np.array(EDGES_MS)
        self._late = np.zeros(len(EDGES_MS) + 1, dtype=int)
        self._busy: list[float] = []
        self._last: tuple[float, float, int, int] | None = None
        self._worst = self.last_tick = 0.0

    def began(self, time: float, due: float) -> None:
        """A tick begins at a time, and was due at another [s]."""
        usage = resource.getrusage(resource.RUSAGE_THREAD)
        now = (time, thread_time(), usage.ru_nivcsw, usage.ru_nvcsw)
        late = max(time - due, 0.0)
        self._worst = max(self._worst, late)
        self._late[np.searchsorted(self._edges, 1e3 * late)] += 1
        self.ticks += 1
        if self._last is not None and time - self._last[0] > GAP_LISTED:
            self.n_gaps += 1
            if len(self.gaps) < GAPS_MAX:
                seconds, cpu, preempted, waited = (a - b for a, b in zip(now, self._last, strict=True))
                self.gaps.append(LoopGap(time, seconds, cpu, int(preempted), int(waited)))
        self._last = now

    def ended(self, seconds: float) -> None:
        """The tick took so long [s]."""
        self._busy.append(seconds)
        self.last_tick = seconds

    def pause(self) -> None:
        """The loop is not to run for a while: what comes next is no gap."""
        self._last = None

    def summary(self) -> dict[str, object]:
        """Numbers of the loop, times in milliseconds; gaps as lists of time [s], length, CPU time [ms], switches."""
        busy = 1e3 * np.array(self._busy or [0.0])
        bins = [f"<={edge:g}" for edge in EDGES_MS] + [f">{EDGES_MS[-1]:g}"]
        return {
            "period_ms": 1e3 * self.period,
            "ticks": self.ticks,
            "missed_ticks": self.missed,
            "late_ms": {name: int(count) for name, count in zip(bins, self._late, strict=True)},
            "late_max_ms": 1e3 * self._worst,
            "tick_ms": {"p50": float(np.median(busy)), "p99": float(np.quantile(busy, 0.99)), "max": float(busy.max())},
            "gaps": self.n_gaps,
            "gap_list": [
                [round(g.time, 4), round(1e3 * g.seconds, 2), round(1e3 * g.cpu, 2), g.preempted, g.waited]
                for g in self.gaps
            ],
        }
