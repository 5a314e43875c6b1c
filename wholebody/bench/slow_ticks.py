"""Which ticks were slow, and whether that was the tick or the machine."""

from __future__ import annotations

import resource
from time import thread_time_ns

import numpy as np

SLOW = 1_000_000
"""Thread CPU time from which a tick counts as slow [ns]."""
SHOWN = 20
"""Most slow ticks that are listed one by one."""


class SlowTicks:
    """Watches a loop of ticks from outside the clock.

    After every tick an empty loop of about the same length is timed as the control: what happens to it is the machine's
    doing. Of slow ticks it is noted what the kernel counted meanwhile for this thread: page faults (memory touched for
    the first time: ours) and involuntary switches (another program wanted the processor: not ours).
    """

    def __init__(self) -> None:
        self._loops, self._samples = 0, []
        self._control: list[int] = []
        self._slow: list[dict] = []
        self._before = _counters()

    def begin(self) -> None:
        """A tick comes next."""
        self._before = _counters()

    def end(self, tick: int, nanoseconds: int) -> None:
        """The tick is over.

        Args:
            tick: Its number within the script.
            nanoseconds: Its thread CPU time.
        """
        if nanoseconds > SLOW:
            faults, switches = _counters() - self._before
            us = round(1e-3 * nanoseconds)
            self._slow.append({"tick": tick, "us": us, "page_faults": int(faults), "switches": int(switches)})
        if self._loops:
            self._control.append(_spin(self._loops))
        else:
            self._calibrate(nanoseconds)

    def _calibrate(self, nanoseconds: int) -> None:
        """Size the control by the median of the first ticks."""
        self._samples.append(nanoseconds)
        if len(self._samples) == 200:
            trial = min(_spin(10_000) for _ in range(20))
            self._loops = max(int(10_000 * float(np.median(self._samples)) / trial), 1)

    def summary(self) -> dict:
        """Slow ticks one by one, and the times of the control [us]."""
        control = np.array(self._control or [0])
        return {
            "slow_ticks": self._slow[:SHOWN],
            "slow_with_page_faults": sum(tick["page_faults"] > 0 for tick in self._slow),
            "control_us": quantiles(control),
            "control_over_1ms": int((control > SLOW).sum()),
            "control_loops": len(self._control),
        }


def quantiles(nanoseconds: np.ndarray) -> dict[str, float]:
    """Median, 99 % quantile and largest of times [us]."""
    p50, p99, most = np.percentile(1e-3 * nanoseconds, [50, 99, 100])
    return {"p50": round(p50, 1), "p99": round(p99, 1), "max": round(float(most), 1)}


def _spin(loops: int) -> int:
    """Thread CPU time of an empty loop [ns]."""
    begin = thread_time_ns()
    for _ in range(loops):
        pass
    return thread_time_ns() - begin


def _counters() -> np.ndarray:
    """Page faults that needed no disk, and involuntary switches, of this thread."""
    usage = resource.getrusage(resource.RUSAGE_THREAD)
    return np.array([usage.ru_minflt, usage.ru_nivcsw])
