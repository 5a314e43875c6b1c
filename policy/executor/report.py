"""What an executor saw: deliveries, and everything that went wrong."""

from __future__ import annotations

import logging
from collections import Counter, deque
from dataclasses import dataclass, field

import numpy as np

from policy.errors import printable
from policy.sparing_log import SparingLog

logger = logging.getLogger("policy.executor.executor")

DETAIL_MAX = 600
"""Most characters of an event's sentence."""
EVENTS_MAX = 1000
"""Events kept; older ones are only counted."""


@dataclass(frozen=True)
class ExecutorEvent:
    """Something that went wrong, or came right again: time [s], stable code, and a sentence."""

    time: float
    code: str
    detail: str


@dataclass(frozen=True)
class Delivery:
    """A chunk that was handed to the controller.

    Attributes:
        seq: Its number.
        t_obs: When its observation was taken [s].
        done: When the policy had it ready [s].
        time: When it was handed over [s].
        skipped: Steps that were over by then.
    """

    seq: int
    t_obs: float
    done: float
    time: float
    skipped: int

    @property
    def latency(self) -> float:
        """Time from the observation to the answer [s]."""
        return self.done - self.t_obs


@dataclass
class ExecutionReport:
    """One episode of an executor.

    Attributes:
        deliveries: Chunks handed over.
        events: The last `EVENTS_MAX` events.
        counts: Events by code, all of them.
        waited: Time before the first chunk [s].
        starved: Time after the end of a chunk without a new one [s].
        starvations: How often that happened.
    """

    deliveries: list[Delivery] = field(default_factory=list)
    events: deque[ExecutorEvent] = field(default_factory=lambda: deque(maxlen=EVENTS_MAX))
    counts: Counter[str] = field(default_factory=Counter)
    waited: float = 0.0
    starved: float = 0.0
    starvations: int = 0
    _told: set[str] = field(default_factory=set, repr=False)
    _log: SparingLog = field(default_factory=lambda: SparingLog(logger), repr=False, compare=False)

    def add(self, time: float, code: str, detail: str) -> None:
        """Note an event; logged once until `recovered`, then counted."""
        detail = printable(detail, DETAIL_MAX)
        self.events.append(ExecutorEvent(time, code, detail))
        self.counts[code] += 1
        if code not in self._told:
            self._told.add(code)
            self._log.warning("%.3f s: %s: %s", time, code, detail)

    def recovered(self) -> None:
        """Let the next event of every code be logged again."""
        self._told.clear()

    @property
    def latencies(self) -> np.ndarray:
        """Latencies of every delivery, shape (n,), [s]."""
        return np.array([delivery.latency for delivery in self.deliveries])

    def summary(self) -> str:
        """One line for people."""
        parts = [f"{len(self.deliveries)} chunks"]
        if self.deliveries:
            worst, typical = 1e3 * self.latencies.max(), 1e3 * float(np.median(self.latencies))
            parts.append(f"latency {typical:.0f} ms median, {worst:.0f} ms at most")
        if self.starvations:
            times = "once" if self.starvations == 1 else f"{self.starvations} times"
            parts.append(f"starved {times}, {self.starved:.2f} s")
        parts += [f"{code} {count} times" for code, count in sorted(self.counts.items()) if code != "starved"]
        return ", ".join(parts)
