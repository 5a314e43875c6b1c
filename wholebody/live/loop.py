"""The control loop on the wall clock: a state in, a command out, every control period."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from time import monotonic, sleep

import numpy as np

from models.spec import RobotSpec
from policy.clock import Clock
from policy.executor.executor import Executor
from wholebody.episode.chunk_seams import commanded_chunk
from wholebody.episode.run import observe
from wholebody.episode.tracking_error import TrackingError
from wholebody.execution.supervisor import Supervisor
from wholebody.live.lateness import Lateness
from wholebody.live.robot_link import RobotLink
from wholebody.types import JointCommand, RobotState, Status, StatusReport

LATE_SHARE = 0.5
"""Share of a control period for which a state may be late before the loop goes on without it; chosen: a tick takes a
sixth."""


class StaticRobot:
    """A robot that does not move."""

    def __init__(self, state: RobotState) -> None:
        self._state, self.origin = state, monotonic()

    def receive(self, timeout: float) -> RobotState:
        """Resting state, stamped with the present time."""
        sleep(timeout)
        return replace(self._state, time=monotonic() - self.origin)

    def send(self, command: JointCommand) -> None:
        """Not heard."""


class RobotClock:
    """The robot's clock: seconds since an instant of `time.monotonic`. A `policy.clock.Clock`."""

    def __init__(self, robot: RobotLink) -> None:
        self._robot = robot

    def now(self) -> float:
        """Present time [s]."""
        return monotonic() - self._robot.origin


@dataclass
class LoopStatistics:
    """What happened in a run of the loop.

    Attributes:
        seconds: Time in each status, by its name [s].
        reasons: The same by reason.
        refusals: How many chunks were refused, by reason.
        accepted: How many chunks were given to the supervisor.
        stale: Ticks that began without a new state.
        fallen: When standing was lost [s], or None.
    """

    seconds: defaultdict[str, float] = field(default_factory=lambda: defaultdict(float))
    reasons: defaultdict[str, float] = field(default_factory=lambda: defaultdict(float))
    refusals: Counter[str] = field(default_factory=Counter)
    accepted: int = 0
    stale: int = 0
    fallen: float | None = None


class ControlLoop:
    """Runs a supervisor on the wall clock. Nothing in it waits but for the robot's state.

    Args:
        spec: The robot.
        supervisor: Reset already.
        robot: Where states come from and commands go.
        state: The one that the supervisor was reset with.
        task: What the policy is told to do.
        clock: The robot's; the wall's since the robot's origin if not given.
        scored: Whether the lateness of ticks and the errors of palms are measured.

    Attributes:
        executor: Where chunks come from, on the robot's clock; None: there are none.
        lateness: Of the ticks so far.
        statistics: What happened so far.
        errors: Of the palms at the steps of the chunks.
        state: The newest one.
        stopped: Whether it is to end.
    """

    def __init__(
        self,
        spec: RobotSpec,
        supervisor: Supervisor,
        robot: RobotLink,
        state: RobotState,
        task: str = "",
        clock: Clock | None = None,
        *,
        scored: bool = True,
    ) -> None:
        self.spec, self.supervisor, self.robot, self.state, self.task = spec, supervisor, robot, state, task
        self.executor: Executor | None = None
        self.dt = supervisor.config.dt
        self.lateness, self.statistics, self.errors = Lateness(self.dt), LoopStatistics(), TrackingError(supervisor)
        self.clock = clock or RobotClock(robot)
        self.stopped, self._scored = False, scored

    def run(self, going: Callable[[float], bool]) -> None:
        """Tick until told to stop.

        Args:
            going: Called after every tick with the present time [s]; whether to go on. It must not wait.
        """
        tick = max(int(self.clock.now() / self.dt), 0) + 1
        more = True
        while more:
            due = tick * self.dt
            state = self.robot.receive(max(due + LATE_SHARE * self.dt - self.clock.now(), 0.0))
            now = self.clock.now()
            if self._scored:
                self.lateness.began(now, due)
            self._tick(state, now)
            if self._scored:
                self.lateness.ended(self.clock.now() - now)
            more = going(now) and not self.stopped
            following = max(tick + 1, int(self.clock.now() / self.dt))
            self.lateness.missed += following - tick - 1
            tick = following

    def stop(self) -> None:
        """End after this tick, a paused loop too."""
        self.stopped = True

    def restart(self, state: RobotState) -> None:
        """Go on with a robot that was put somewhere else."""
        self.state = state
        self.supervisor.reset(state)
        self.errors, self.statistics.fallen = TrackingError(self.supervisor), None
        self.lateness.pause()

    def _tick(self, state: RobotState | None, now: float) -> None:
        statistics, supervisor = self.statistics, self.supervisor
        if state is None:
            statistics.stale += 1
        else:
            self.state = state
        self.robot.send(supervisor.step(self.state, now))
        if self.executor is not None:
            self._poll(now)
        self._refused(supervisor.take_refusal())
        if self._scored and supervisor.plan_report is not None:
            self.errors.follow(supervisor.chunk, supervisor.plan_report)
            if state is not None:
                self.errors.measure(state, supervisor.palm_reference(), supervisor.status.reason, supervisor.carried)
        status = supervisor.status
        statistics.seconds[status.status.value] += self.dt
        if status.reason:
            statistics.reasons[str(status.reason)] += self.dt
        if status.status is Status.DAMPING and statistics.fallen is None:
            statistics.fallen = now

    def _poll(self, now: float) -> None:
        """Ask for a chunk if one is due; give one that has come to the supervisor."""
        seen = partial(observe, self.spec, self.supervisor, self.state, self.task, now=now)
        chunk = None if self.executor is None else self.executor.poll(seen, partial(commanded_chunk, self.supervisor))
        if chunk is not None:
            self.statistics.accepted += 1
            self._refused(self.supervisor.accept(chunk, now))

    def _refused(self, answer: StatusReport | None) -> None:
        if answer is not None and answer.status is Status.HOLD and answer.reason:
            self.statistics.refusals[str(answer.reason)] += 1
            # The last plan can be refused after the last chunk was asked for.
            if self.executor is not None:
                self.executor.refused(answer.reason, answer.detail)


def palm_error(loop: ControlLoop) -> tuple[float, float]:
    """Root mean square and largest distance of the palms from the chunks as given, so far [m]."""
    errors = loop.errors.result().errors
    if not errors.size:
        return 0.0, 0.0
    return float(np.sqrt((errors**2).mean())), float(errors.max())
