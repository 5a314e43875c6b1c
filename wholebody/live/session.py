"""A run on the wall clock from beginning to end: everything is started, warmed up, run, and ended."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from functools import partial
from queue import Empty, SimpleQueue
from time import monotonic

import numpy as np

from models.spec import RobotSpec
from policy.base import Policy
from policy.executor.executor import Executor, ExecutorConfig
from policy.joints import layout_robot
from policy.scripted.library import scripted_policy
from wholebody.config import ControllerConfig
from wholebody.config.description import describe
from wholebody.episode.warm_up import compile_plan
from wholebody.errors import InputError, StateError, WholebodyError
from wholebody.execution.background_planner import ThreadPlanner
from wholebody.execution.gate import Gate, judged_elsewhere
from wholebody.execution.planner_process import PlannerProcess
from wholebody.execution.supervisor import Supervisor
from wholebody.live import pacing
from wholebody.live.loop import ControlLoop, StaticRobot, palm_error
from wholebody.live.page_process import PageProcess
from wholebody.live.person import Person
from wholebody.live.robot_link import SessionRobot
from wholebody.types import RobotState, StatusReport

WARM_UP = 1.0
"""Time for which the loop first runs on a robot that stands still [s]; chosen: it loads what is compiled."""
LOWER_MAX = 12.0
"""Longest time in which the robot is lowered at the end [s]; measured: from reaches it takes 5.3 s at most."""
START_IN = 0.1
"""Delay from the decision to let time run until it does [s]; chosen: both processes are there by then."""


@dataclass(frozen=True)
class SessionConfig:
    """How long, and when what happens.

    Attributes:
        duration: Time for which chunks are asked for [s]; None: until told to stop.
        settle: Standing before the first chunk [s].
        hold: Standing after the last one [s].
        task: What the policy is told to do.
    """

    duration: float | None = None
    settle: float = 1.0
    hold: float = 4.0
    task: str = ""


class Session:
    """The robot's process, the planner's, the page's, and the control loop, which is this one.

    Args:
        config: Of the controller.
        robot: Started and ended here: a `RobotProcess`, or what behaves like one.
        session: How long.
        page: Where everything is shown, and can be disturbed; nowhere if not given.
        gate: Makes what judges each chunk by its plan, in the planner's process; nothing does if not given.

    Attributes:
        missed: What the system did not grant, in sentences.
    """

    def __init__(
        self,
        config: ControllerConfig,
        robot: SessionRobot,
        session: SessionConfig,
        page: PageProcess | None = None,
        gate: Callable[[], Gate] | None = None,
    ) -> None:
        # Before the processes start: they inherit it.
        os.environ.update(pacing.BLAS_THREADS)
        self._session, self._page, spec = session, page, describe(config.robot)
        self._bases: SimpleQueue[tuple[Sequence[float], Future[StatusReport]]] = SimpleQueue()
        self._over = False
        self._planner = PlannerProcess(spec, config, begin=partial(_planner_begins, spec), gate=gate)
        self._robot = robot
        try:
            state = self._robot.start(page and page.robot_end)
            self._planner.wait()
            # Plans are judged where they are computed: a thread of this process would take its lock from the loop.
            judged = judged_elsewhere if gate else None
            self.supervisor = Supervisor(spec, config, planner=lambda _: ThreadPlanner(self._planner), gate=judged)
            self._warm_up(state)
            self._planner.seconds.clear()
            self.supervisor.reset(state)
        except BaseException:
            self.close()
            raise
        self.loop = ControlLoop(spec, self.supervisor, self._robot, state, session.task)
        self.missed: list[str] = []

    def walk_to(self, base: Sequence[float]) -> Future[StatusReport]:
        """Walk to a base while `run` runs, told from any thread: x, y [m] and heading [rad] midway between the soles.

        The answer of `Supervisor.walk_to` comes after the next tick: ``walking``, or ``walk_refused`` with the reason;
        its `InputError` for a base that is no numbers, and `StateError` where the run is over or ends before. A
        configuration needs ``steps: reach`` for it.
        """
        answer: Future[StatusReport] = Future()
        self._bases.put((base, answer))
        if self._over:
            self._walk()
        return answer

    def _walk(self) -> None:
        """Tell the supervisor where it is to walk, and whoever asked what it says of that, or that the run is over."""
        while True:
            try:
                base, answer = self._bases.get_nowait()
            except Empty:
                return
            if not answer.set_running_or_notify_cancel():
                continue
            try:
                if self._over:
                    raise StateError("the run of this session is over; it walks while `run` runs")
                report = self.supervisor.walk_to(base)
            except WholebodyError as error:
                answer.set_exception(error)
            else:
                answer.set_result(report)

    def _end_walks(self) -> None:
        """Walk no more; whoever still waits for an answer, or asks from now on, is told."""
        self._over = True
        self._walk()

    def _warm_up(self, state: RobotState) -> None:
        """Run the loop once, with everything in it, on a robot that does not move."""
        self.supervisor.reset(state)
        loop = ControlLoop(self.supervisor.spec, self.supervisor, StaticRobot(state), state)
        loop.executor = Executor(scripted_policy("wave", robot=layout_robot(loop.spec)), loop.clock)
        loop.executor.reset()
        loop.run(lambda now: now < WARM_UP)
        loop.executor.close()

    def run(self, sources: Mapping[str, Policy], tell: Callable[[float], None], asking: ExecutorConfig) -> None:
        """Run policies, the first one first; an interrupt (Ctrl-C) ends it in order. Then the robot is lowered.

        Args:
            sources: Sources of chunks, by name; a person can choose another one on the page.
            tell: Called after every tick with the present time [s]; must not wait.
            asking: How chunks are asked for.
        """
        person = Person(self._page, self.loop, self._robot, sources, asking, self._planner.seconds)
        session, end = self._session, self._session.settle + (self._session.duration or np.inf)

        def going(now: float) -> bool:
            person.asking(session.settle <= now < end)
            person.look(now)
            self._walk()
            tell(now)
            return now < end + session.hold

        # An exception in the middle of a tick could be lost in compiled code, or leave the tick half done.
        before = signal.signal(signal.SIGINT, lambda *_: self.loop.stop())
        self.missed = pacing.keep_time()
        self._robot.go(monotonic() + START_IN)
        try:
            self.loop.run(going)
            self._end_walks()
            person.asking(False)
            self._lower(tell)
        finally:
            self._end_walks()
            person.asking(False)
            signal.signal(signal.SIGINT, before)

    def _lower(self, tell: Callable[[float], None]) -> None:
        """Leave the robot in a crouch that its last command holds; another interrupt leaves it on the way there."""
        if (why_not := lower(self.loop, tell)) is not None:
            self.missed.append(why_not)

    def close(self) -> dict[str, float | str]:
        """End the processes; how the robot's kept time, and why it fell."""
        self._end_walks()
        self._planner.close()
        return self._robot.close()

    def summary(self) -> dict[str, object]:
        """Numbers of the run, times in milliseconds, distances in millimetres."""
        statistics, (rms, worst) = self.loop.statistics, palm_error(self.loop)
        plans = 1e3 * np.array(self._planner.seconds or [0.0])
        return {
            "loop": self.loop.lateness.summary(),
            "ticks_without_state": statistics.stale,
            "planning": {
                "plans": len(self._planner.seconds),
                "cpu_p50_ms": float(np.median(plans)),
                "cpu_max_ms": float(plans.max()),
                "late": self.supervisor.handover.late,
            },
            "chunks": {"accepted": statistics.accepted, "refused": dict(statistics.refusals)},
            "palm_error_mm": {"rms": 1e3 * rms, "max": 1e3 * worst},
            "time_factor": self.supervisor.time_factor,
            "seconds": dict(statistics.seconds),
            "reasons": dict(statistics.reasons),
            "fell": statistics.fallen is not None,
            "not_granted": self.missed,
        }


def lower(loop: ControlLoop, tell: Callable[[float], None]) -> str | None:
    """Run a loop until its robot crouches; why it cannot, if it cannot.

    Args:
        loop: Whatever its robot does; chunks are not asked for.
        tell: Called after every tick with the present time [s]; must not wait.
    """
    supervisor, end = loop.supervisor, loop.clock.now() + LOWER_MAX
    try:
        supervisor.lower()
    except InputError as error:
        return str(error)
    loop.stopped = False

    def going(now: float) -> bool:
        tell(now)
        return not supervisor.lowered and loop.statistics.fallen is None and now < end

    loop.run(going)
    return None


def _planner_begins(robot: RobotSpec) -> None:
    """Prepare the planner's process: it gives way, and has planned once before it is asked."""
    pacing.give_way()
    compile_plan(robot)
