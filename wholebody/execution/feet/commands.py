"""What a supervisor is told beside chunks: to walk, to crouch and to stand up."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from policy.chunk import ActionChunk
from wholebody.control.touch import Touch
from wholebody.execution import standing, statuses
from wholebody.execution.ahead.hands_ahead import HandsAhead
from wholebody.execution.ending.lowering import Lowering
from wholebody.execution.ending.stiff_legs import StiffLegs
from wholebody.execution.feet import wanted
from wholebody.execution.feet.stepping import Stepping
from wholebody.execution.handover import Handover
from wholebody.execution.planted_feet import PlantedFeet
from wholebody.execution.standing import Reflex
from wholebody.execution.states import State
from wholebody.planning.reachability.standing_place import StandingPlace
from wholebody.robot.contact_schedule import ContactSchedule
from wholebody.types import Reason, RobotState, StatusReport
from wholebody.walking.places import Place, Velocity


class Commands(statuses.Following):
    """The part of a supervisor that is led; plans wait meanwhile, and are made anew once the robot stands."""

    handover: Handover
    touch: Touch
    contacts: ContactSchedule
    _stepping: Stepping
    _planted: PlantedFeet
    _lowering: Lowering
    _ahead: HandsAhead
    _reflex: Reflex
    _legs: StiffLegs
    _retry: float
    _gated: bool

    @property
    def lowered(self) -> bool:
        """Whether the last command may be kept for ever: the robot crouches on stiff legs."""
        return self.state is State.LOWERED and self._legs.share == 1.0

    def lower(self) -> StatusReport:
        """Go into a crouch that needs no controller, whatever the robot does now; `lowered` says when it is there.

        One that walks comes to a stand first.
        """
        return self._leave(down=True)

    def raise_(self) -> StatusReport:
        """Stand up from the crouch, or on the way to it: chunks are taken again once the stance is reached."""
        return self._leave(down=False)

    def _leave(self, *, down: bool) -> StatusReport:
        self._following()
        if self._stepping.active:
            self._stepping.stop()
            self._stepping.then = down
        elif self.state not in (State.DESCENDING, State.FALLEN):
            self._ahead.leave(self.plan)
            self._lowering.begin(self._last_state, down=down)
            self.handover.cancel()
            self.plan = self.chunk = self._newest = self._waiting = self._refused = None
            self.status = self._reflex.status
        return self.status

    @property
    def base(self) -> tuple[float, float, float]:
        """Where the robot stands, midway between its soles, or its walk has it: x, y [m] and heading [rad]."""
        self._following()
        here = self._stepping.base
        return here.point.real, here.point.imag, here.heading

    def walk_to(self, base: Sequence[float]) -> StatusReport:
        """Walk to a base: x, y [m] and heading [rad] midway between the soles.

        Hands go on along their chunks, as long as they are such as a walk can have; else they are held where they are
        about the robot. What is not over then is planned once the robot stands there. Told again, the newest goal
        counts.

        Returns:
            ``walking``, or ``walk_refused`` with the reason: then nothing changes.

        Raises:
            StateError: Before the first `reset`.
            InputError: For a base that is no numbers.
        """
        self._following()
        return self._walk(self._no_walk() or wanted.goal(base, self._stepping.base))

    def _walk_for(self, there: StandingPlace) -> StatusReport:
        """Walk to where a chunk is in reach, arms on their way to the posture that reaches it there."""
        told = self._no_walk() or wanted.goal(there.base, self._stepping.base)
        return self._walk(told, there.posture.q)

    def walk(self, velocity: Sequence[float]) -> StatusReport:
        """Walk with a velocity of the base: ahead, to the left [m/s] and about the vertical [rad/s], in its own axes.

        It is followed for `stepping.LASTS`, and longer if it is told again; then the robot comes to a stand. One that
        is too fast is followed slower, in the same direction. Otherwise as `walk_to`.
        """
        self._following()
        return self._walk(self._no_walk() or wanted.velocity(velocity))

    def _no_walk(self) -> StatusReport | None:
        """Why no walk can be begun or changed now; None if one can."""
        if self.touch.active and not self._stepping.active:
            held = "a hand touches something, and steps do not lean against it; walk once it is let go of"
            return statuses.refused(Reason.WALK_REFUSED, held)
        return self._stepping.refusal()

    @property
    def walks(self) -> bool:
        """Whether the base velocity of the newest chunk is followed, now or once it is due."""
        self._following()
        return self._stepping.led is not None and not self._stepping.led.rides

    @property
    def not_led(self) -> str | None:
        """Why a walk is not made with the newest chunk's hands, in words, though it says a base velocity."""
        self._following()
        return self._stepping.not_led

    @property
    def carried(self) -> np.ndarray | None:
        """How the poses of the chunk have moved with the base of a walk that it leads, shape (4, 4); None for none."""
        self._following()
        return self._stepping.carried

    @property
    def moved_for(self) -> Reason | None:
        """Why a hand is commanded elsewhere than the chunk has it, however little a person would see of that."""
        return self._stepping.moved_for(self._now) or super().moved_for

    def _walk(self, told: Place | Velocity | StatusReport, q_there: np.ndarray | None = None) -> StatusReport:
        return told if isinstance(told, StatusReport) else self._go(partial(self._stepping.walk, told, q_there))

    def _go(self, walk: Callable[[RobotState, float], StatusReport]) -> StatusReport:
        """Begin or change a walk; the plan is left for it."""
        stepped = self._stepping.coming
        if not stepped:
            self._ahead.leave(self.plan)
        report = walk(self._last_state, self._now)
        if not self._stepping.coming:
            return self.status
        if not stepped:
            self.handover.cancel()
            self.plan = None
        self.status = report
        return report

    def _walks_with(self, chunk: ActionChunk) -> bool:
        """Whether a chunk leads the base from now on; others, and what a gate judges, are planned for a stand."""
        self._stepping.take(chunk, self._last_state, self._now, may=not self._gated)
        return self._walk_along()

    def _look_at_feet(self, state: RobotState, now: float, blind: bool) -> Stepping:
        """Notice what a state, now [s], means for a walk; it leads the robot instead of a plan."""
        begins = self._stepping.begins
        if self._stepping.look(state, now, blind):
            self._stood()
        if begins and not self._stepping.begins and self._newest is not None and self._newest.end > now:
            self._walks_with(self._newest)
        if not self._stepping.coming:
            self._walk_along()
        if self._stepping.active:
            self._ahead.leave(None)
            self.plan = None
        return self._stepping

    def _walk_along(self) -> bool:
        """Walk with the newest chunk where it asks for that now; whether it does."""
        stepping = self._stepping
        if not stepping.due(self._now) or (self.touch.active and not stepping.active):
            return False
        self._go(stepping.go_along)
        if not stepping.follows:
            return False
        chunk = stepping.led.chunk
        self.chunk, self.plan_report, self._chunk_end = chunk, stepping.led.report, float(chunk.times[-1])
        self._waiting = self._refused = None
        return True

    def _stood(self) -> None:
        """Go on from where a walk has come to a stand: a chunk that is not over is planned anew, or hands are held."""
        self.contacts, down = self._planted.contacts, self._stepping.then
        newest = self._newest if self._newest is not None and self._newest.times[-1] > self._now else None
        if newest is not None:
            newest = self._newest = self._stepping.stood(newest)
        self._waiting, self._retry = standing.to_hold(newest, self._smoother.motion, self._now), self._now
        if self._newest is not newest:
            self._newest = self.chunk = None
        if down is not None:
            self._stepping.then = None
            self._leave(down=down)
