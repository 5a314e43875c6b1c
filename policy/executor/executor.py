"""Between a policy that takes its time and a control loop that has none."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from math import ceil, inf

from policy.base import Policy
from policy.chunk import ActionChunk
from policy.clock import Clock
from policy.errors import ChunkError, PolicyError
from policy.executor.ensemble import TemporalEnsemble
from policy.executor.report import Delivery, ExecutionReport
from policy.executor.worker import Job, JobOutcome, ThreadWorker, Worker
from policy.observation import Observation
from policy.prefix import Prefix, PrefixPolicy
from policy.reading import HORIZON_MAX
from policy.recorded.resample import resampled

Executing = Callable[[float, int, float], ActionChunk | None]
"""What is commanded from a time on [s], for a number of steps at a rate [Hz]; None if nothing is."""

TIME_TOLERANCE = 1e-6
"""Rounding that a chunk's time may have against its observation's [s]."""


@dataclass(frozen=True, kw_only=True)
class ExecutorConfig:
    """How chunks are asked for and judged."""

    replace_every: int = 25
    """Steps of a chunk after which the next one is asked for; earlier where the chunk is over sooner."""
    lead: float = 0.0
    """Time that the controller takes to plan a chunk, which has to be there so much earlier [s]; see `Executor`."""
    age_max: float | None = None
    """Oldest observation that a chunk may answer when it arrives [s]; None: any, until its last step is over."""
    hang_after: float = 1.0
    """Duration of a call after which the policy counts as hung [s]."""
    retry_after: float = 0.25
    """Pause after a chunk that could not be used [s]."""
    ensemble: float | None = None
    """Average chunks with ACT's weights exp(-value i), oldest first (ACT: 0.01); None does not."""
    real_time: bool = False
    """Real-time chunking: tell the policy what will be executed before its chunk arrives."""
    execution_horizon: int = 10
    """Real-time chunking: step from which on a chunk is free, LeRobot's default; later if the delay is longer."""
    delay_window: int = 10
    """Real-time chunking: the largest of so many last latencies is expected; a slow first call is forgotten."""

    def __post_init__(self) -> None:
        counts = ("replace_every", "execution_horizon", "delay_window")
        for name in (*counts, "lead", "hang_after", "retry_after", "age_max"):
            value = getattr(self, name)
            if value is not None and not value >= (1 if name in counts else 0.0):
                raise ValueError(f"{name} is {value}; at least {1 if name in counts else 0} is expected")
            if value is not None and value > (HORIZON_MAX if name in counts else inf):
                raise ValueError(f"{name} is {value}; at most {HORIZON_MAX} steps or latencies are expected")


class Executor:
    """Runs a policy beside a control loop.

    `poll`, once a control period, never waits: it asks the policy for the next chunk when one is due, and hands out a
    chunk that has arrived and can be used. Whatever a policy does wrong, hanging, raising, dying, returning not a
    number or another layout, ends up in the `report`, and no chunk comes; what the robot then does is the controller's
    part.

    Args:
        policy: Called by the worker only.
        clock: The robot's clock, that of the observations.
        config: How chunks are asked for and judged.
        worker: Who runs the policy; a thread if None.

    Attributes:
        running: The chunk that was handed out last, as it was handed out.
        lead: Time that the controller takes to plan a chunk [s]; that of the settings until the loop that it
            serves knows better.

    Raises:
        PolicyError: If real-time chunking is wanted from a policy that cannot do it.
    """

    def __init__(
        self, policy: Policy, clock: Clock, *, config: ExecutorConfig | None = None, worker: Worker | None = None
    ) -> None:
        self.policy, self.clock, self.config = policy, clock, config or ExecutorConfig()
        if self.config.real_time and not isinstance(policy, PrefixPolicy):
            raise PolicyError(
                f"real-time chunking needs a policy with infer_after(observation, prefix); {type(policy).__name__} has "
                "none: switch real_time off, or average chunks with ensemble"
            )
        self.lead = self.config.lead
        self.worker = ThreadWorker(policy, clock) if worker is None else worker
        self._ensemble = None if self.config.ensemble is None else TemporalEnsemble(self.config.ensemble)
        self._episode = -1
        self._latencies: deque[float] = deque(maxlen=self.config.delay_window)
        self.report = ExecutionReport()

    def reset(self, task: str = "") -> None:
        """Begin an episode: chunks that were asked for before it will be refused, and the policy is reset."""
        self.report = ExecutionReport()
        self.task, self._episode = task, self._episode + 1
        self._spec_id = self.policy.spec.id
        self._last: ActionChunk | None = None
        self.running: ActionChunk | None = None
        self._before: tuple[ActionChunk | None, ActionChunk | None] = (None, None)
        self._asked: float | None = None
        self._hung = self._dead = self._starving = self._hastened = False
        self._not_before = -inf
        self._polled = self.clock.now()
        if self._ensemble is not None:
            self._ensemble.reset()
        self.worker.submit(Job(self._episode, self.clock.now(), task=task))

    def poll(
        self, observe: Callable[[], Observation], executing: Executing | None = None, until: float = inf
    ) -> ActionChunk | None:
        """A new chunk to execute from now on, or None: go on with the one before.

        Args:
            observe: Called if a chunk is asked for.
            executing: What is really commanded; the last chunk itself if not given. Used by real-time chunking.
            until: Time after which nothing is needed [s]: a chunk that goes so far is the last one.
        """
        now = self.clock.now()
        self._account(now)
        chunk = self._collect(now)
        if self._due(now, until):
            self._ask(now, observe(), executing)
            chunk = self._collect(now) or chunk
        return chunk

    def refused(self, code: str, detail: str) -> None:
        """Take note that the controller did not accept the chunk handed out last: the one before goes on."""
        now = self.clock.now()
        self.running, self._last = self._before
        if self._ensemble is not None:
            self._ensemble.drop_newest()
        if self.report.deliveries:
            self.report.deliveries.pop()
        self._fail(now, code, detail)

    def hasten(self) -> None:
        """Ask for the next chunk as soon as no other request is under way: the task has changed."""
        self._hastened = True

    def close(self) -> None:
        """End the worker; does not wait for a running call."""
        self.worker.close()

    def _account(self, now: float) -> None:
        """Waiting, starvation and hanging since the last poll."""
        passed, self._polled = now - self._polled, now
        if self.running is None:
            self.report.waited += passed
        elif now > self.running.end + TIME_TOLERANCE:
            self.report.starved += passed
            if not self._starving:
                self._starving = True
                self.report.starvations += 1
                self.report.add(now, "starved", f"the last chunk ended at {self.running.end:.3f} s")
        if self._asked is not None and not self._hung and now - self._asked > self.config.hang_after:
            self._hung = True
            self.report.add(now, "policy_hung", f"no answer since {self._asked:.3f} s")

    def _due(self, now: float, until: float) -> bool:
        if self._asked is not None or self._dead or now < self._not_before - TIME_TOLERANCE:
            return False
        if self.running is None or self._hastened:
            return True
        goes_on = self.running.end < until - TIME_TOLERANCE
        return goes_on and now >= self.running.t_obs + self._asked_after(self.running) - TIME_TOLERANCE

    def _asked_after(self, chunk: ActionChunk) -> float:
        """Age of a chunk at which the next one is asked for, so that it is there before the last step [s]."""
        step, expected = 1.0 / chunk.fps, max(self._latencies, default=0.0)
        covered = step * (len(chunk) - 1) - expected - self.lead
        return max(step, min(step * self.config.replace_every, step * (len(chunk) // 2), covered))

    def _ask(self, now: float, observation: Observation, executing: Executing | None) -> None:
        self._asked, self._hastened = now, False
        prefix = self._prefix(observation, executing) if self.config.real_time else None
        self.worker.submit(Job(self._episode, now, observation, prefix))

    def _prefix(self, observation: Observation, executing: Executing | None) -> Prefix | None:
        """What will be executed from the observation on; None before the first chunk."""
        running = self.running
        if running is None:
            return None
        steps, t = len(running), observation.time
        executed = executing(t, steps, running.fps) if executing else resampled(running, t, steps, running.fps)
        left = int((running.times[-1] - t) * running.fps + TIME_TOLERANCE) + 1
        if executed is None or left < 1:
            return None
        delay = ceil(max(self._latencies, default=0.0) * running.fps)
        # A prefix that ends before the chunk arrives would leave the join free.
        horizon = min(max(self.config.execution_horizon, delay + self.config.execution_horizon // 2), left)
        return Prefix(executed, left, min(delay, horizon), horizon)

    def _collect(self, now: float) -> ActionChunk | None:
        """The newest usable chunk among the outcomes that are there."""
        chunk = None
        while (outcome := self.worker.poll()) is not None:
            chunk = self._judged(outcome, now) or chunk
        return chunk

    def _judged(self, outcome: JobOutcome, now: float) -> ActionChunk | None:
        """The chunk of an outcome, if it can be used."""
        job, chunk = outcome.job, outcome.chunk
        if job.episode == self._episode and job.observation is not None:
            self._asked, self._hung = None, False
        if outcome.dead:
            self._dead = job.episode == self._episode
        if (failure := self._failure(outcome, now)) is not None:
            self._fail(now, *failure)
        elif isinstance(chunk, ActionChunk):
            return self._hand_out(chunk, outcome.done, now)
        return None

    def _failure(self, outcome: JobOutcome, now: float) -> tuple[str, str] | None:
        """Why there is nothing to use: code and sentence."""
        job = outcome.job
        if outcome.dead or outcome.error is not None:
            code = "policy_dead" if outcome.dead else "policy_raised"
            return code, f"{type(outcome.error).__name__}: {outcome.error}"
        if job.observation is None:
            return None
        if job.episode != self._episode:
            return "chunk_from_before_reset", f"asked for at {job.asked:.3f} s in the episode before"
        return self._fault(outcome.chunk, job.observation, now)

    def _fault(self, chunk: object, observation: Observation, now: float) -> tuple[str, str] | None:
        """Why an answer cannot be used: code and sentence."""
        if not isinstance(chunk, ActionChunk):
            return "chunk_invalid", f"the policy returned {type(chunk).__name__}; an ActionChunk is expected"
        if len(chunk) > HORIZON_MAX:
            return "chunk_invalid", f"the chunk has {len(chunk)} steps; at most {HORIZON_MAX} are taken"
        if chunk.spec_id != self._spec_id:
            return "chunk_wrong_spec", f"the chunk has layout '{chunk.spec_id}'; '{self._spec_id}' is expected"
        try:
            chunk.validate(robot=self.policy.spec.robot)
        except (ChunkError, ValueError, TypeError) as error:
            return "chunk_invalid", str(error)
        return self._fault_of_time(chunk, observation, now)

    def _fault_of_time(self, chunk: ActionChunk, observation: Observation, now: float) -> tuple[str, str] | None:
        lead = observation.time - chunk.t_obs
        if not -TIME_TOLERANCE <= lead <= 1.0 / chunk.fps + TIME_TOLERANCE:
            text = f"the chunk begins at {chunk.t_obs:.4f} s, its observation is of {observation.time:.4f} s"
            return "chunk_wrong_time", f"{text}; at most one step earlier is expected"
        try:
            chunk.validate(after=self._last, robot=self.policy.spec.robot)
        except ChunkError as error:
            return "chunk_out_of_order", str(error)
        age = now - chunk.t_obs
        age_max = inf if self.config.age_max is None else self.config.age_max
        if chunk.times[-1] <= now or age > age_max:
            length = len(chunk) / chunk.fps
            return "chunk_stale", f"its observation is {age:.3f} s old; it is {length:.3f} s long, age_max {age_max} s"
        return None

    def _hand_out(self, chunk: ActionChunk, done: float, now: float) -> ActionChunk:
        self._latencies.append(done - chunk.t_obs)
        skipped = int((chunk.times < now - TIME_TOLERANCE).sum())
        self.report.deliveries.append(Delivery(chunk.seq, chunk.t_obs, done, now, skipped))
        self.report.recovered()
        self._starving = False
        self._before = (self.running, self._last)
        self._last = chunk
        self.running = running = chunk if self._ensemble is None else self._ensemble.add(chunk)
        return running

    def _fail(self, now: float, code: str, detail: str) -> None:
        self.report.add(now, code, detail)
        self._not_before = now + self.config.retry_after
