"""Steps of a supervised robot: a walk leads it while there is one, what was planned for a stand is carried along."""

from __future__ import annotations

from dataclasses import replace
from math import inf

import numpy as np

from policy.chunk import ActionChunk
from wholebody.config import ControllerConfig
from wholebody.control.base import Controller
from wholebody.control.reference_packet import COM, PackedReference
from wholebody.execution import standing, statuses
from wholebody.execution.feet.carried import at_rest, hands_carried
from wholebody.execution.feet.elsewhere import base_of, ends
from wholebody.execution.feet.hands_of_walks import HandsOfWalks
from wholebody.execution.feet.led import StateLog, planar
from wholebody.execution.feet.led_walk import TAKEN_UP, LedWalk, calm
from wholebody.execution.feet.loss import Loss
from wholebody.execution.feet.ready_to_walk import ReadyToWalk
from wholebody.execution.feet.walker import walker_for
from wholebody.execution.feet.wanted import in_words, refused
from wholebody.execution.kernels.plan_follower import TRUST_MIN
from wholebody.execution.plan_follower import PlanFollower
from wholebody.execution.planted_feet import PlantedFeet
from wholebody.execution.standing import Reflex
from wholebody.execution.states import STEPPING, Event, Machine, State
from wholebody.planning.trajectory import SampledTrajectory
from wholebody.reference import HandLimits, ReferenceSmoother
from wholebody.robot.contact_schedule import ContactSchedule
from wholebody.types import RobotState, StatusReport
from wholebody.walking.footsteps import CLOSED
from wholebody.walking.gait import Phase
from wholebody.walking.places import Place, Velocity

LASTS = 1.0
"""Time for which a velocity is followed that is not told again [s]; chosen: who leads the robot may be gone."""
WALKS_FROM = (State.HOLDING, State.FOLLOWING, State.WALKING, State.RISING)
"""States in which a walk can be begun or changed; a step that catches the robot is not led elsewhere."""
CAUGHT_FROM = (State.HOLDING, State.FOLLOWING, State.STANDING, State.RETURNING)
"""States from which a step catches the robot: it stands, whatever it does with its hands."""
NEAR = 0.05
"""Difference of two ends of chunks, place [m] or axes [no unit], up to which what was found for one holds for the
other; chosen: a search among standing places takes a second."""


class Stepping(LedWalk):
    """Decides when a walk leads the robot, and hands over from plan to walk and back.

    Args:
        controller: Of the robot.
        config: Its configuration.
        follower: Has led it so far, and keeps the hands.
        smoother: Of the hands.
        planted: Has the stance on its feet.
        states: What the robot follows.
        reflex: Goes to the stance.
        limits: Of the left and the right hand.

    Attributes:
        contacts: Which feet stand where, while a walk leads it.
        status: What a person sees of it then.
        beyond: Ends of a chunk that was out of reach from everywhere, shape (2, 4, 4), or None.
        then: Whether the robot is to be lowered once it stands, or raised; None if neither.
        led: The chunk whose base velocity is walked, or whose hands are while somebody else tells where; None for none.
    """

    def __init__(
        self,
        controller: Controller,
        config: ControllerConfig,
        follower: PlanFollower,
        smoother: ReferenceSmoother,
        planted: PlantedFeet,
        states: Machine,
        reflex: Reflex,
        limits: tuple[HandLimits, ...],
    ) -> None:
        self._controller, self._config = controller, config
        self._follower, self._smoother, self._planted, self._states = follower, smoother, planted, states
        self._reflex, self._walker = reflex, walker_for(controller, config)
        self._wanted: Place | Velocity = Velocity()
        self._until, self._trust, self._loss = -inf, 1.0, Loss(controller)
        self._calm, self._log, self.led = calm(limits), StateLog(config.dt), None
        self._gave_up = self._is_told = False
        self._hands, self.not_led = HandsOfWalks(controller.robot, planted.stance), None
        self._there: np.ndarray | None = None
        self.beyond: np.ndarray | None = None
        self._ready = ReadyToWalk(controller.robot, planted.stance, self._hands)
        self.contacts, self.then = planted.contacts, None
        self.status = self._walks = statuses.WALKING
        if self._walker is not None:
            self._walker.end()  # whatever the episode before was about

    @property
    def active(self) -> bool:
        """Whether a walk leads the robot."""
        return self._states.now in STEPPING

    @property
    def coming(self) -> bool:
        """Whether it does, or will once the robot has stood up: plans wait."""
        return self.active or self._states.now is State.RISING

    def may_walk_for(self, chunk: ActionChunk) -> bool:
        """Whether the robot walks where a chunk is in reach, unless one that ends as it does is so from nowhere."""
        if self._config.steps != "reach" or standing.is_hold(chunk) or self.refusal() is not None:
            return False
        return self.beyond is None or bool(np.abs(ends(chunk) - self.beyond).max() > NEAR)

    def refusal(self) -> StatusReport | None:
        """Why no walk can be begun or changed now; None if one can."""
        if self._config.steps != "reach":
            return refused(f"`steps` is '{self._config.steps}'; with `steps: reach` the robot walks")
        if self.then is not None or self._states.now not in WALKS_FROM:
            return refused(f"the robot is {self._states.now.value}: it walks once it stands and holds, or follows")
        return None

    @property
    def base(self) -> Place:
        """Where the robot stands: midway between its soles; while it walks, the base that it follows."""
        if self.active and self._walker is not None:
            return self._walker.walk.guide.place
        x, y, heading = base_of(self._planted.feet, self._controller.spec)
        return Place(complex(x, y), heading)

    def walk(self, wanted: Place | Velocity, q_there: np.ndarray | None, state: RobotState, now: float) -> StatusReport:
        """Go to a goal, or follow a velocity, from the present state on, now [s].

        Hands that ride along go on; on the way to a posture ``q_there`` (nq,) arms go towards it.
        """
        self.led = self.led if self.led is not None and self.led.rides else None
        self._there = None if q_there is None else self._hands.towards(q_there)
        self._wanted, self._is_told = wanted, True
        self._until = now + LASTS if isinstance(wanted, Velocity) else inf
        return self._go(state, now)

    def _go(self, state: RobotState, now: float) -> StatusReport:
        if self.active:
            self._tell()
        elif not self._is_there(self._wanted) and not self.coming:
            self._begin(state, now)
        return self.status

    def go_along(self, state: RobotState, now: float) -> StatusReport:
        """Walk as the chunk says, its hands along its own paths, from the present state on, now [s]."""
        if not self.led.rides:
            self._wanted, self._until, self._is_told = self.led.velocity(now), inf, False
        if self.active:
            self._lead_hands(state, now)
        return self._go(state, now)

    def _is_there(self, wanted: Place | Velocity) -> bool:
        if isinstance(wanted, Velocity):
            return wanted.is_rest
        here = self.base
        return abs(wanted.point - here.point) <= CLOSED[0] and abs(here.turn_to(wanted)) <= CLOSED[1]

    def _begin(self, state: RobotState, now: float) -> None:
        """Walk; a robot that leans, squats or has its hands far away goes to its stance first."""
        pelvis = planar(self.base) @ self._pelvis_in_base(float(self._planted.stance[2]))
        if self._states.now is not State.RISING and not self._ready.look(state.q, pelvis):
            self._states.on(Event.WALK_LOW)
            self.status = statuses.RISING
            self._reflex.go_to(state, self._planted.stance, self.status)
            return
        if self._states.now is State.RISING:
            self._reflex.end()
            self._hold(state, standing.hands_at_rest(self._controller.robot, state.q))
        self._states.on(Event.WALK)
        self.status = statuses.WALKING
        self._walker.begin(state)
        self._trusts, self._room, self._gave_up = np.ones(2), 1.0, False
        self._log.begin(now, state.q)
        self._follower.ride()
        self._tell()
        if self.led is not None:
            self._lead_hands(state, now)

    def _tell(self) -> None:
        """Hand what is wanted to the walk."""
        guide, wanted = self._walker.walk.guide, self._wanted
        guide.follow(wanted) if isinstance(wanted, Velocity) else guide.go_to(wanted)
        leads = self.led is not None and not self.led.rides
        says = f"the robot walks {in_words(wanted, leads)}"
        self._walks = replace(statuses.TRACKING, detail=says)
        if not leads:
            self._walks = replace(statuses.RIDING, detail=f"{says}, its hands along the chunk's own paths")
        if not self.follows:
            self._walks = replace(statuses.WALKING, detail=f"{says}; chunks are planned once it stands")
        self.status = self._walks

    def stop(self) -> None:
        """Come to a stand, within three steps."""
        self._wanted, self._until = Velocity(), -inf
        if self._states.now is State.WALKING:
            self._tell()

    def look(self, state: RobotState, now: float, blind: bool) -> bool:
        """Notice what a state, now [s], means for a walk; whether it has just come to a stand."""
        if self._states.now is State.RISING:
            if self._reflex.has_arrived:
                self._begin(state, now)
            return False
        if not blind and self._is_lost(now):
            self._catch(state)
        if not self.active:
            return False
        self._log.add(now, state.q)
        walks = self._states.now is State.WALKING and not blind
        if walks and self.led is not None and self.led.rides:
            self._look_at_riding()
        elif walks and self.led is not None and self.led.velocity(now) != self._wanted:
            self._wanted = self.led.velocity(now)
            self._tell()
        if (blind or now > self._until) and self._wanted != Velocity():
            self.stop()
        if self._walker.stands:
            self._settle(state)
            return True
        return False

    def is_over(self) -> bool:
        """Whether neither soles nor the step that is being made bring the robot back."""
        return self._loss.is_final(self._walker if self.active else None)

    def _is_lost(self, now: float) -> bool:
        """Whether both feet stand, and a step is to catch the robot."""
        if self._walker is None:
            return False
        if self.active:
            walk = self._walker.walk
            looks, planned = walk.state in (Phase.RECOVER, Phase.SETTLE), None if walk.caught else walk.dcm
        else:
            looks, planned = self._states.now in CAUGHT_FROM, self._loss.planned(self._follower.row)
        if not looks:
            self._loss.forget()
            return False
        return self._loss.look(planned, now)

    def _catch(self, state: RobotState) -> None:
        """Take a step that catches the robot, if there is one; hands give way until it has come to rest."""
        step = self._walker.step_that_catches(state)
        if step is None:
            return
        if self._states.now is not State.RECOVERING:
            self._walker.begin(state)
            self._reflex.end()
            self._states.on(Event.PUSHED)
            self._follower.stand(*self._here(state))
            self._follower.ride()
        self._walker.catch(state, step)
        self._loss.forget()
        self.led = None
        self._wanted, self._until, self._trust = Velocity(), -inf, 0.0
        self.status = statuses.RECOVERING

    def _let_go(self, state: RobotState, elapsed: float) -> None:
        """Let the hands give way while a step catches the robot; once it rests, hold them where they are."""
        if not self._walker.walk.caught:
            if self._trust == 0.0:
                still, rows = self._here(state)
                self._smoother.reset(rows)
                self._follower.stand(still, rows, holds=True)
                self._follower.ride()
                self._walker.carry_from_here()
            self._trust = min(self._trust + elapsed / TAKEN_UP, 1.0)
        trust = max(self._trust, TRUST_MIN)
        self._controller.trust_hands(trust, trust)

    def reference(self, state: RobotState, elapsed: float, now: float) -> PackedReference:
        """What the controller follows in a tick, now [s], after the follower, which then has the palms that are led."""
        if self._states.now is State.RECOVERING:
            self._let_go(state, elapsed)
        led = self._walker.reference(state, elapsed, self._follower.row)
        self._follower.row[:COM] = led.row[:COM]
        if (self.led is not None or self._gave_up) and self._states.now is State.WALKING:
            self._give_way(elapsed, now)
        if led.contacts is not None and not led.contacts.same(self.contacts.contacts[0]):
            self.contacts = ContactSchedule((led.contacts,))
        return led

    def _settle(self, state: RobotState) -> None:
        """Stand where the feet are, the hands where the walk has taken them."""
        walker = self._walker
        walker.end()
        self._planted.stand_on(walker.feet(state))
        place = walker.walk.guide.place
        rows = hands_carried(self._smoother.motion.rows, place if walker.in_world else walker.base, place)
        self._hold(state, at_rest(rows))
        if self.led is not None:  # hands that move brake until there is a plan
            self._smoother.reset(rows)
        self._states.on(Event.SETTLED)

    def _here(self, state: RobotState) -> tuple[SampledTrajectory, np.ndarray]:
        """What is followed where the robot is let go of: itself, and hands as they are, rows (2, 40)."""
        robot = self._controller.robot
        return SampledTrajectory.still(robot, state.q), standing.hands_at_rest(robot, state.q)

    def _hold(self, state: RobotState, rows: np.ndarray) -> None:
        """Stand where the robot comes to rest, hands as in rows (2, 40)."""
        robot, support = self._controller.robot, self._controller.support
        robot.update(state.q, state.v)
        self._smoother.reset(rows)
        q = standing.resting_posture(state.q, state.v, self._config.body.posture_kd)
        margin = self._config.planner.posture.com_margin
        self._follower.stand(standing.standing_trajectory(robot, q, support, margin), rows, holds=True)
