"""A worker runs a policy: in a thread, or as simulated in `policy.executor.simulated`."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from queue import Empty, SimpleQueue
from time import sleep
from typing import Protocol

from policy.base import Policy
from policy.chunk import ActionChunk
from policy.clock import Clock
from policy.observation import Observation
from policy.prefix import Prefix


@dataclass(frozen=True)
class Job:
    """One call of a policy.

    Attributes:
        episode: Number of the episode that it belongs to.
        asked: When it was asked for [s].
        observation: What to answer, or None to reset.
        prefix: What is being executed, for policies that continue it.
        task: Task of a reset.
    """

    episode: int
    asked: float
    observation: Observation | None = None
    prefix: Prefix | None = None
    task: str = ""

    def run(self, policy: Policy) -> ActionChunk | None:
        """Call the policy; None from a reset."""
        if self.observation is None:
            policy.reset(self.task)
            return None
        if self.prefix is None:
            return policy.infer(self.observation)
        return policy.infer_after(self.observation, self.prefix)


@dataclass(frozen=True)
class JobOutcome:
    """What became of a job.

    Attributes:
        job: The job.
        done: When it was done [s].
        chunk: Whatever the policy returned; not checked.
        error: What it raised.
        dead: Whether the policy has ended: it raised more than an Exception, SystemExit for one.
    """

    job: Job
    done: float
    chunk: object = None
    error: BaseException | None = None
    dead: bool = False


class Worker(Protocol):
    """Runs one job after the other; no method waits for the policy."""

    def submit(self, job: Job) -> None:
        """Queue a job."""
        ...

    def poll(self) -> JobOutcome | None:
        """The oldest outcome that was not yet taken."""
        ...

    def close(self) -> None:
        """Take no more jobs."""
        ...


class ThreadWorker:
    """Runs a policy in a thread of its own.

    A call that hangs cannot be broken off: its thread is a daemon, so that at least the program can end.

    Attributes:
        latency: Added to every call [s]: what a slower policy would be like.
    """

    latency = 0.0

    def __init__(self, policy: Policy, clock: Clock) -> None:
        self.policy, self.clock = policy, clock
        self._jobs: SimpleQueue[Job | None] = SimpleQueue()
        self._outcomes: SimpleQueue[JobOutcome] = SimpleQueue()
        self._thread: threading.Thread | None = None

    def submit(self, job: Job) -> None:
        """Queue a job; the thread starts with the first one."""
        self._jobs.put(job)
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name="policy", daemon=True)
            self._thread.start()

    def poll(self) -> JobOutcome | None:
        """The oldest outcome that was not yet taken."""
        try:
            return self._outcomes.get_nowait()
        except Empty:
            return None

    def close(self) -> None:
        """End the thread after the running call; does not wait for it."""
        self._jobs.put(None)

    def _run(self) -> None:
        while (job := self._jobs.get()) is not None:
            chunk = error = None
            try:
                chunk = job.run(self.policy)
                sleep(self.latency)
            except BaseException as raised:  # noqa: BLE001 - whatever it is goes to the executor, which logs it
                error = raised
            # Past an Exception the policy itself has ended; the thread stays, for a reset.
            dead = error is not None and not isinstance(error, Exception)
            self._outcomes.put(JobOutcome(job, self.clock.now(), chunk, error, dead))
