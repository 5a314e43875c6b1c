"""Who plans beside the control loop: a simulation of it, whose plans come when simulated time says so, or a thread."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from math import inf
from queue import Empty, SimpleQueue
from threading import Thread
from time import thread_time
from typing import Protocol

import numpy as np

from policy.chunk import ActionChunk
from wholebody.config import ControllerConfig, PlanningConfig
from wholebody.errors import ConfigError, PlanningError
from wholebody.estimation.prediction import ROUNDING
from wholebody.execution.ahead.foreseen import Foreseen
from wholebody.execution.feet.elsewhere import StandElsewhereError, require_reach
from wholebody.planning.chunk_planner import ChunkPlanner
from wholebody.planning.plan import ChunkPlan
from wholebody.planning.reachability.standing_place import StandingPlace
from wholebody.reference.surface import Surface, kept_out
from wholebody.robot.contact_schedule import ContactSchedule
from wholebody.robot.hand_loads import Loads


@dataclass(frozen=True)
class PlanRequest:
    """A plan that is wanted.

    Attributes:
        chunk: A valid chunk.
        asked: When it is asked for [s].
        due: When it is to take over [s].
        start: What will be followed then.
        before: Configurations of the present plan from then on, one knot apart, shape (k, nq), or None.
        again: Whether the chunk is being followed already, and only a quicker plan is of use.
        cpu_limit: CPU time in which the plan is wanted [s]; infinite where planning takes a simulated time.
        loads: What the hands carry.
        contacts: Which feet stand where; both, where the stance has them, if not given.
        surfaces: What the left and the right hand have met, and are not led further into.
        walks: Settings of a robot that may walk to where the chunk is in reach; None for one that stays.
        torques: Shares of the model's torques that motors have, motor order, shape (n_joints,); all if not given.
    """

    chunk: ActionChunk
    asked: float
    due: float
    start: Foreseen
    before: np.ndarray | None = None
    again: bool = False
    cpu_limit: float = inf
    loads: Loads = field(default_factory=Loads)
    contacts: ContactSchedule | None = None
    surfaces: tuple[Surface | None, Surface | None] = (None, None)
    torques: np.ndarray | None = None
    walks: ControllerConfig | None = None

    def plan_with(self, planner: ChunkPlanner) -> ChunkPlan:
        """The plan, computed now.

        Raises:
            InputError, PlanningError: If there is none, or one whose numbers are not finite; a `StandElsewhereError`
                where the robot is to walk first.
        """
        start, chunk = self.start, kept_out(self.chunk, self.surfaces, planner.offsets)
        if self.contacts is not None:
            planner.stand_on(self.contacts)
        planner.carry(self.loads, self.torques)
        plan = planner.plan(chunk, self.due, start.body, start.hands, self.before, self.cpu_limit, hold=True)
        if not plan.is_finite:
            raise PlanningError("the plan has numbers that are not finite")
        if self.walks is not None:
            require_reach(chunk, plan, planner.spec, self.walks)
        return plan


@dataclass(frozen=True)
class PlanAnswer:
    """What became of a request: a plan, or the error that there was instead, and the CPU time that it took [s]."""

    request: PlanRequest
    plan: ChunkPlan | None = None
    error: Exception | None = None
    took: float = 0.0

    @property
    def elsewhere(self) -> StandingPlace | None:
        """Where the robot is to stand for the chunk instead; None if here, or nowhere."""
        return self.error.place if isinstance(self.error, StandElsewhereError) else None


Compute = Callable[[PlanRequest], ChunkPlan]
"""Plans; raises `PlanningError` or `InputError` where there is no plan."""


class BackgroundPlanner(Protocol):
    """Takes requests, one at a time, and hands out answers without ever waiting.

    Attributes:
        measured: Whether its plans take the time that computing them takes, so that they have to be done in time.
    """

    measured: bool

    def submit(self, request: PlanRequest) -> None:
        """Begin to plan; an earlier request is cancelled."""

    def poll(self, now: float) -> PlanAnswer | None:
        """The answer to the last request, once, if it is there at this time [s]."""

    def close(self) -> None:
        """End; the plan under way is cancelled."""


class SimulatedPlanner:
    """Plans when asked, and hands the plan out after a simulated time.

    Whatever goes wrong there, the control loop goes on: any error is an answer.

    Args:
        compute: Plans.
        config: How long it takes.
    """

    def __init__(self, compute: Compute, config: PlanningConfig) -> None:
        if config.latency not in ("fixed", "measured"):
            raise ConfigError(f"planning.latency is '{config.latency}'; it must be 'fixed' or 'measured'")
        self._compute, self._config, self.measured = compute, config, config.latency == "measured"
        self._answer: PlanAnswer | None = None
        self._done = inf

    def submit(self, request: PlanRequest) -> None:
        """Plan now; the answer is there once its time has passed."""
        self._answer = _answer(self._compute, request)
        took = self._answer.took if self.measured else self._config.lead
        self._done = request.asked + self._config.factor * took

    def poll(self, now: float) -> PlanAnswer | None:
        """The answer, if its simulated time has passed."""
        if self._answer is None or now < self._done - ROUNDING:
            return None
        answer, self._answer = self._answer, None
        return answer

    def close(self) -> None:
        """Forget the answer."""
        self._answer = None


class ThreadPlanner:
    """Plans in a thread of its own, on the wall clock. Compiled planning holds no interpreter lock, the rest does.

    Whatever goes wrong there, the control loop goes on: any error is an answer.

    Args:
        compute: Plans; called by the thread only.
    """

    measured = True

    def __init__(self, compute: Compute) -> None:
        self._compute = compute
        self._requests: SimpleQueue[PlanRequest | None] = SimpleQueue()
        self._answers: SimpleQueue[PlanAnswer] = SimpleQueue()
        self._wanted: PlanRequest | None = None
        self._thread = Thread(target=self._work, name="planner", daemon=True)
        self._thread.start()

    def submit(self, request: PlanRequest) -> None:
        """Hand a request to the thread, which begins once the request before is done."""
        self._wanted = request
        self._requests.put(request)

    def poll(self, now: float) -> PlanAnswer | None:
        """The answer to the last request if the thread has it; earlier ones are dropped."""
        try:
            while (answer := self._answers.get_nowait()).request is not self._wanted:
                pass
        except Empty:
            return None
        return answer

    def close(self) -> None:
        """Let the thread end after its present plan."""
        self._wanted = None
        self._requests.put(None)

    def _work(self) -> None:
        while (request := self._requests.get()) is not None:
            if request is not self._wanted:
                continue
            self._answers.put(_answer(self._compute, request))


def _answer(compute: Compute, request: PlanRequest) -> PlanAnswer:
    """What becomes of a request."""
    begin, plan, failed = thread_time(), None, None
    try:
        plan = compute(request)
    except Exception as error:  # noqa: BLE001 - the robot must not fall because of it; `wholebody.execution.gate` logs it
        failed = error
    return PlanAnswer(request, plan, failed, thread_time() - begin)
