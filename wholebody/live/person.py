"""The person at the page: what they are shown, and what they do to robot, policy and time."""

from __future__ import annotations

import logging
from cmath import exp
from collections.abc import Mapping, Sequence
from dataclasses import replace
from time import monotonic, sleep

import numpy as np

from policy.base import Policy
from policy.chunk import ROTATION_TOLERANCE
from policy.executor.executor import Executor, ExecutorConfig
from policy.executor.worker import ThreadWorker
from policy.geometry.rotations import rotation_residual
from policy.targets.dragged_hands import RESTING_HORIZON, DraggedHands
from wholebody.episode.run import followed
from wholebody.errors import InputError
from wholebody.live.loop import ControlLoop
from wholebody.live.page_process import PageProcess
from wholebody.live.robot_link import Order, SessionRobot
from wholebody.live.robot_process import MASS_MIN
from wholebody.live.snapshot import Snapshot, UserCommand
from wholebody.types import Reason

logger = logging.getLogger(__name__)

FPS = 30.0
"""How often the page is shown an instant [Hz]; chosen, as `wholebody.live.page.FPS`."""
LOOK_AGAIN = 0.02
"""How often a paused loop looks what is wanted [s]; chosen: no person notices it."""
RESET_TIME = 0.1
"""Time for the robot to be put back to its stance [s]; chosen: fifty of its periods."""
DRAG_PERIOD = 0.1
"""How often the way of hands that are being dragged is asked for [s]; chosen: the lead, in which one plan is made."""
BOUNDS: dict[UserCommand, tuple[float, float]] = {
    UserCommand.TARGETS: (-5.0, 5.0),
    UserCommand.PUSH: (-500.0, 500.0),
    UserCommand.PAYLOAD: (MASS_MIN, 10.0),
    UserCommand.FRICTION: (0.05, 2.0),
    UserCommand.LATENCY: (0.0, 2.0),
    UserCommand.CLOSING: (0.0, 1.0),
    UserCommand.WALK: (-2.0, 2.0),
}
"""Bounds of the numbers of a user's command, in its units; the page is not trusted, since whoever reaches it can
send any."""


class Person:
    """Between the page and the loop; without a page it only runs the first source.

    Args:
        page: The page, or None.
        loop: The control loop.
        robot: The robot.
        sources: By name.
        config: How chunks are asked for.
        planned: CPU times of the plans so far [s].
    """

    def __init__(
        self,
        page: PageProcess | None,
        loop: ControlLoop,
        robot: SessionRobot,
        sources: Mapping[str, Policy],
        config: ExecutorConfig,
        planned: Sequence[float],
    ) -> None:
        self._page, self._loop, self._robot, self._sources = page, loop, robot, list(sources.values())
        self._config, self._planned = config, planned
        for policy in self._sources:
            if isinstance(policy, DraggedHands):
                policy.palms = loop.supervisor.palm_reference
        self._source, self._latency, self._shown, self._wanted = 0, 0.0, 0.0, False
        self._dragged, self._hastened, self._sent = False, 0.0, False

    def asking(self, wanted: bool) -> None:
        """Whether chunks are asked for now; none are while the robot walks to where it was sent."""
        self._sent &= self._loop.supervisor.status.reason is Reason.WALKING
        wanted &= not self._sent
        if wanted != self._wanted:
            self._wanted = wanted
            self._choose(self._source)

    def _choose(self, source: int) -> None:
        """Ask this source from now on, from its beginning, or none."""
        loop, self._source = self._loop, source
        if loop.executor is not None:
            loop.executor.close()
            loop.executor = None
        if not self._wanted:
            return
        policy, config = self._sources[source], self._config
        if isinstance(policy, DraggedHands):
            config = ExecutorConfig(replace_every=RESTING_HORIZON)
        worker = ThreadWorker(policy, loop.clock)
        worker.latency = self._latency
        loop.executor = Executor(policy, loop.clock, config=config, worker=worker)
        loop.executor.lead = max(config.lead, loop.supervisor.config.planning.lead)
        loop.executor.reset(loop.task)

    def look(self, now: float) -> None:
        """Show the page an instant if it is time [s], and obey the user's commands; waits only in a pause."""
        if self._page is None:
            return
        paused = self._obey()
        if self._dragged and now - self._hastened >= DRAG_PERIOD and self._loop.executor is not None:
            self._dragged, self._hastened = False, now
            self._loop.executor.hasten()
        if now - self._shown >= 1.0 / FPS:
            self._shown = now
            self._page.show(self._glance(now))
        if paused:
            self._pause()

    def _obey(self) -> bool:
        """Obey the user's commands; True if one of them is a pause."""
        paused = False
        for wish, numbers in self._page.wishes():
            if wish is UserCommand.PAUSE:
                paused = bool(numbers[0])
            else:
                self._do(wish, numbers)
        return paused

    def _do(self, wish: UserCommand, numbers: np.ndarray) -> None:
        """Obey one command within its bounds; NaN is ignored."""
        if not np.isfinite(numbers).all():
            return
        numbers = np.clip(numbers, *BOUNDS.get(wish, (0.0, len(self._sources) - 1.0)))
        if wish is UserCommand.TARGETS:
            self._drag(numbers.reshape(2, 4, 4))
        elif wish is UserCommand.SOURCE:
            self._choose(int(numbers[0]))
        elif wish is UserCommand.LATENCY:
            self._latency = float(numbers[0])
            if self._loop.executor is not None:
                self._loop.executor.worker.latency = self._latency
        elif wish is UserCommand.RESET:
            self._reset()
        elif wish is UserCommand.WALK:
            self._walk(*numbers.tolist())
        elif wish in (UserCommand.PUSH, UserCommand.PAYLOAD, UserCommand.FRICTION):
            body = self._loop.spec.torso_body if wish is UserCommand.PUSH else ""
            self._robot.order(Order(wish.name.lower(), tuple(numbers.tolist()), body))

    def _drag(self, targets: np.ndarray) -> None:
        """Take the palms to where the user drags them, whatever ran before; an invalid pose is ignored."""
        if rotation_residual(targets[:, :3, :3]).max() > ROTATION_TOLERANCE:
            return
        self._choose_hands()
        self._sources[self._source].targets, self._dragged = targets, True

    def _choose_hands(self) -> None:
        """Have the hands dragged from now on, whatever ran before."""
        hands = next(i for i, policy in enumerate(self._sources) if isinstance(policy, DraggedHands))
        if self._source != hands:
            self._choose(hands)

    def _walk(self, ahead: float, left: float, turn: float) -> None:
        """Send the robot somewhere; from there on its hands are dragged, since other sources would call it back."""
        supervisor = self._loop.supervisor
        x, y, heading = supervisor.base
        way = complex(ahead, left) * exp(1j * heading)
        report = supervisor.walk_to((x + way.real, y + way.imag, heading + turn))
        if report.reason is Reason.WALK_REFUSED:
            logger.warning("the robot does not walk: %s", report.detail)
        elif report.reason is Reason.WALKING:
            self._choose_hands()
            self._sent = True

    def _pause(self) -> None:
        """Pause the world until the user goes on; for the robot no time passes."""
        begin = monotonic()
        self._robot.order(Order("pause"))
        while self._still_paused():
            sleep(LOOK_AGAIN)
        shift = monotonic() - begin
        self._robot.order(Order("resume", (shift,)))
        self._robot.origin += shift
        self._loop.lateness.pause()

    def _still_paused(self) -> bool:
        for wish, numbers in self._page.wishes():
            if wish is UserCommand.PAUSE and not numbers[0]:
                return False
            if wish is not UserCommand.PAUSE:
                self._do(wish, numbers)
        return self._page.alive and not self._loop.stopped

    def _reset(self) -> None:
        """The robot in its stance, at rest, and the source from its beginning."""
        loop = self._loop
        self._robot.order(Order("reset"))
        sleep(RESET_TIME)
        state = self._robot.receive(RESET_TIME)
        if state is None:
            raise InputError("the robot did not answer after it was put back to its stance")
        loop.restart(state)
        self._choose(self._source)

    def _glance(self, now: float) -> Snapshot:
        loop, supervisor = self._loop, self._loop.supervisor
        planned = np.full(len(loop.state.q), np.nan) if supervisor.plan is None else supervisor.plan.trajectory.q[-1]
        planning = self._planned[-1] if self._planned else 0.0
        return Snapshot(
            state=loop.state,
            followed=replace(followed(supervisor, now), planning_time=planning),
            planned=planned,
            tick=loop.lateness.last_tick,
            missed=loop.lateness.missed,
            late=supervisor.handover.late,
            source=self._source,
        )
