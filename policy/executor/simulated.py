"""A policy beside a simulated control loop: time passes as the simulation says, whatever the computation takes."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter

import numpy as np

from policy.base import Policy
from policy.clock import Clock, SimulatedClock
from policy.executor.executor import Executor, ExecutorConfig
from policy.executor.worker import Job, JobOutcome

LATENCY_MAX = 3600.0
"""Largest latency that is drawn [s]."""
Latency = Callable[[], float]
"""Duration of the next call of a policy [s]; ``inf`` is a call that never returns."""


class SimulatedWorker:
    """Runs a policy at once and hands its answer over later, as a thread on a simulated clock would.

    Args:
        policy: The policy.
        clock: A simulated clock.
        latency: Called once an inference; if None, an inference takes as long as it really took to compute.
    """

    def __init__(self, policy: Policy, clock: Clock, latency: Latency | None = None) -> None:
        self.policy, self.clock, self.latency = policy, clock, latency
        self._pending: list[JobOutcome] = []

    def submit(self, job: Job) -> None:
        """Run a job now; its outcome is there after the jobs before it and its own latency."""
        chunk = error = None
        started = perf_counter()
        try:
            chunk = job.run(self.policy)
        except (Exception, SystemExit) as raised:  # noqa: BLE001 - as in ThreadWorker; an interrupt ends the simulation
            error = raised
        took = perf_counter() - started
        if self.latency is not None:
            took = self.latency() if job.observation is not None else 0.0
        begin = max([self.clock.now(), *(outcome.done for outcome in self._pending)])
        dead = error is not None and not isinstance(error, Exception)
        self._pending.append(JobOutcome(job, begin + took, chunk, error, dead))

    def poll(self) -> JobOutcome | None:
        """The oldest outcome whose time has come."""
        # A billionth of a second of grace: ticks are sums of periods that are no binary fractions.
        if self._pending and self._pending[0].done <= self.clock.now() + 1e-9:
            return self._pending.pop(0)
        return None

    def close(self) -> None:
        """Forget what is pending."""
        self._pending = []


def simulated_executor(
    policy: Policy, *, latency: Latency | float | None = 0.0, config: ExecutorConfig | None = None
) -> Executor:
    """An executor on a simulated clock of its own.

    Args:
        policy: The policy.
        latency: Of every inference [s], or a function that says it; None: as long as it really takes to compute.
        config: How chunks are asked for and judged.

    Raises:
        ValueError: If the latency is negative.
    """
    clock = SimulatedClock()
    if isinstance(latency, (int, float)):
        latency = uniform_latency(latency, latency)
    return Executor(policy, clock, config=config, worker=SimulatedWorker(policy, clock, latency))


def uniform_latency(low: float, high: float, *, seed: int = 0) -> Latency:
    """Latencies drawn evenly between two bounds [s], the same ones for the same seed.

    Raises:
        ValueError: If the bounds are not ``0 <= low <= high``.
    """
    if not 0.0 <= low <= high:
        raise ValueError(f"latency from {low} s to {high} s: 0 <= low <= high is expected")
    if low == high:
        return lambda: low
    if not high <= LATENCY_MAX:
        raise ValueError(f"latency from {low} s to {high} s: at most {LATENCY_MAX:g} s are expected")
    rng = np.random.default_rng(seed)
    return lambda: float(rng.uniform(low, high))
