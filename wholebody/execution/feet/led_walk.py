"""A chunk that leads a walk, or the hands of one that somebody else tells where to go: when it does."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import replace

import numpy as np
import pinocchio as pin

from policy.action_spec.anchor import Anchor
from policy.chunk import ActionChunk
from policy.geometry.rotations import quaternion_to_matrix
from policy.geometry.se3 import make_transform
from wholebody.config import ControllerConfig, PlannerConfig
from wholebody.control.base import Controller
from wholebody.execution import standing, statuses
from wholebody.execution.feet.carried import at_rest, hands_carried
from wholebody.execution.feet.elsewhere import base_of
from wholebody.execution.feet.hands_of_walks import HandsOfWalks
from wholebody.execution.feet.led import LedChunk, StateLog, asks_to_walk, planar, seen_frame
from wholebody.execution.feet.walker import Walker
from wholebody.execution.kernels.plan_follower import TRUST_MIN
from wholebody.execution.plan_follower import PlanFollower
from wholebody.execution.planted_feet import PlantedFeet
from wholebody.execution.states import Machine, State
from wholebody.planning.changes import MOVED_MIN, PlanChange
from wholebody.planning.preparation import PreparedChunk, prepare
from wholebody.planning.trajectory import SampledTrajectory
from wholebody.reference import HandLimits, ReferenceSmoother
from wholebody.types import Reason, RobotState, Status, StatusReport
from wholebody.walking.gait import Phase
from wholebody.walking.places import Place, Velocity

CALM = (0.4, 0.2, 0.2)
"""Shares of their usual speed, acceleration and jerk that hands have while the robot steps [no unit]; measured: calm
led walks then keep their palms within 10 mm RMS of the layout from the first step on; slower they do not."""
HARDLY, LOST, LET_GO = 0.5, 0.2, 0.1
"""Shares of its weight below which a hand gives way so that it is said, below which the robot comes to a stand for it,
and below which it is let go of, and held again where it is [no unit]; chosen: calm walks keep all of it."""
TAKEN_UP = 0.5
"""Time in which a hand that was let go of is held again [s]; measured by the prototype."""


class LedWalk(ABC):
    """The part of `wholebody.execution.feet.stepping.Stepping` that a chunk leads."""

    led: LedChunk | None
    status: StatusReport
    active: bool
    coming: bool
    base: Place
    _wanted: Place | Velocity
    _log: StateLog
    _walks: StatusReport
    _trusts: np.ndarray
    _room: float
    _gave_up: bool
    _is_told: bool
    _controller: Controller
    _config: ControllerConfig
    _planted: PlantedFeet
    not_led: str | None
    _hands: HandsOfWalks
    _there: np.ndarray | None
    _calm: tuple[HandLimits, ...]
    _states: Machine
    _smoother: ReferenceSmoother
    _follower: PlanFollower
    _walker: Walker

    @abstractmethod
    def refusal(self) -> StatusReport | None:
        """Why no walk can be begun or changed now; None if one can."""

    @abstractmethod
    def _tell(self) -> None:
        """Hand what is wanted to the walk."""

    @abstractmethod
    def stop(self) -> None:
        """Come to a stand, within three steps."""

    def take(self, chunk: ActionChunk, state: RobotState, now: float, *, may: bool) -> None:
        """Note a chunk that says how the base is to move, or that the newest one does not; ``may``: walk with it.

        One that says so while the robot walks with another one is walked with, whatever it says. The hands of one that
        does not ride along where somebody else tells where to walk.
        """
        before, self.led, self.not_led = self.led, None, None
        self._gave_up = self._gave_up and self.active
        may = may and not self._gave_up and self.refusal() is None
        rides = self.active and self._is_told and not self.begins and not asks_to_walk(chunk)
        goes_on = self.active and before is not None and chunk.base_velocity is not None
        if may and (rides or goes_on or asks_to_walk(chunk)):
            q = self._log.at(chunk.t_obs) if self.active else None
            T = seen_frame(chunk.hands_in, self._anchor(state.q if q is None else q))
            low = self.active and self._log.covers(chunk.t_obs - self._walker.gait.shift)
            led = LedChunk(chunk, T, now, seen_low=low, rides=rides)
            self.led = self._followable(led) if self._there is None or not rides else self._on_the_way(now)
        if self.led is None and before is not None and self.active:
            self._let_be() if self._is_told else self.stop()

    def _followable(self, led: LedChunk) -> LedChunk | None:
        """A chunk that leads the base, if its hands are such as a robot that steps can follow, None if not."""
        led.T_base_frame = self._frame_in_base(led)
        here = self._walker.walk.guide.place if self.active else self.base
        height = self._walker.pelvis_height if self.active else float(self._planted.stance[2])
        pelvis = planar(here) @ self._pelvis_in_base(height)
        fault = self._hands.why_not(led.carried(here), pelvis, self._calm)
        self.not_led = None if led.rides else fault
        return led if fault is None else None

    def _on_the_way(self, now: float) -> LedChunk:
        """What a walk to where a chunk is in reach does with the hands meanwhile, now [s]."""
        T_pelvis = planar(self.base) @ self._pelvis_in_base(float(self._planted.stance[2]))
        there = standing.staying(T_pelvis @ self._there, self._smoother.motion.q_finger, now)
        return LedChunk(replace(there, hands_in="pelvis"), T_pelvis, now, rides=True)

    @property
    def begins(self) -> bool:
        """Whether a walk shifts the weight before its first step: hands come to rest, and ride along from there on."""
        walk = self._walker.walk if self.active and self._walker is not None else None
        return walk is not None and walk.made == 0 and walk.state in (Phase.STAND, Phase.SHIFT)

    def _look_at_riding(self) -> None:
        """Let hands be that ride along in world once the base has gone too far from them."""
        here = planar(self._walker.walk.guide.place) @ self._pelvis_in_base(self._walker.pelvis_height)
        if self.led.in_world and self._hands.why_not_there(self._smoother.motion.p[:, None], here) is not None:
            self._let_be()

    def _let_be(self) -> None:
        """Follow no chunk's hands while somebody else tells where to walk: they are held about the base."""
        self.led = None
        self._hold_hands()
        self._tell()

    def due(self, now: float) -> bool:
        """Whether the chunk that leads the base asks for a walk now [s], or goes on with one."""
        if self.led is None or self.refusal() is not None:
            return False
        return self.coming or not self.led.velocity(now).is_rest

    @property
    def follows(self) -> bool:
        """Whether hands are led along a chunk, and not on the way to where one is in reach."""
        return self.led is not None and not standing.is_hold(self.led.chunk)

    @property
    def holds_hands(self) -> bool:
        """Whether hands are held where they are about the robot while it steps: without a chunk that leads it."""
        return self.active and (self.led is None or self._states.now is not State.WALKING)

    @property
    def carried(self) -> np.ndarray | None:
        """How the poses of the chunk that is walked with have moved with the base, shape (4, 4); None for no such."""
        if not self.follows or self._states.now is not State.WALKING:
            return None
        return self.led.moved(self._walker.walk.guide.place)

    def stood(self, newest: ActionChunk | None) -> ActionChunk | None:
        """The newest chunk, or what it is about a base that has come to a stand, if it led that."""
        led = self.led
        self.led = None if led is not None and led.rides else led
        return newest if led is None or newest is not led.chunk else led.carried(self.base)

    def _lead_hands(self, state: RobotState, now: float) -> None:
        """Lead the hands along the chunk's own paths, from what they do now [s]."""
        led, walker, chunk = self.led, self._walker, self.led.chunk
        here, there = walker.base, walker.walk.guide.place
        if walker.in_world is not led.in_world:
            way = (there, here) if walker.in_world else (here, there)
            self._smoother.reset(at_rest(hands_carried(self._smoother.motion.rows, *way)))
            walker.in_world = led.in_world
        led.T_base_frame = self._frame_in_base(led)
        prepared = prepare(led.carried(walker.base), self._calm)
        paths, projected = prepared.paths(now, self._smoother.motion, 1.0)
        led.report.changes.update(_changes(prepared, projected, self._config.planner))
        self._follower.carry(paths, now - chunk.t_obs, float(chunk.times[-1] - chunk.t_obs))
        self._follower.ride()

    def _give_way(self, elapsed: float, now: float) -> None:
        """Let hands give way that keep the body from its steps, take them up again, and say so [s]."""
        walker, safety = self._walker, self._config.safety
        self._room = walker.room()
        off = np.linalg.norm([row[9:12] for row in walker.palms] - self._controller.palm_positions(), axis=1)
        near = (safety.error_stop - off) / (safety.error_stop - safety.error_slow)
        self._trusts = np.clip(np.minimum(near, self._room), TRUST_MIN, self._trusts + elapsed / TAKEN_UP)
        if self.led is not None and float(self._trusts.min()) < LOST:
            self._give_up()
        elif self.led is None and float(self._trusts.min()) < LET_GO:
            self._hold_hands()
        self._controller.trust_hands(*self._trusts.tolist())
        if self.led is not None:
            self.status = self._status(now, float(self._trusts.min()))

    def _give_up(self) -> None:
        """Come to a stand, unless somebody else tells where to walk, hands where they are.

        From there they are planned with all of the body.
        """
        rides, self._walker.low, self._gave_up = self.led.rides, True, True
        self._let_be()
        if rides:
            return
        self.stop()
        self.status = statuses.HANDS_YIELD

    def _hold_hands(self) -> None:
        """Hold the hands where they are about the base, the trunk upright."""
        robot, walker = self._controller.robot, self._walker
        walker.in_world = False
        here = walker.walk.guide.place
        rows = hands_carried(standing.hands_at_rest(robot, robot.q.copy()), here, walker.base)
        self._smoother.reset(rows)
        self._follower.stand(self._upright(), rows, holds=True)
        self._follower.ride()

    def _upright(self) -> SampledTrajectory:
        """The stance as one row, on the base that the walk began with."""
        robot, stance = self._controller.robot, self._planted.stance
        pin.framesForwardKinematics(robot.model, robot.scratch, stance)
        still, names = np.zeros((1, 3)), (robot.spec.base_body, robot.spec.torso_body)
        pelvis, torso = (robot.scratch.oMf[robot.frame_id(name)].rotation[None].copy() for name in names)
        row = SampledTrajectory.still(robot, stance)
        return replace(row, pelvis=(pelvis, still, still), torso=(torso, still, still))

    @property
    def allowed(self) -> float:
        """Share of their speed at which hands go along their paths: they wait while the body is off its walk."""
        if self.holds_hands:
            return 0.0
        return self._room if self.led is not None and self._states.now is State.WALKING else 1.0

    def _status(self, now: float, trust: float) -> StatusReport:
        """What a person sees of hands that are trusted so far, now [s]."""
        led = self.led
        if trust < HARDLY:
            return statuses.HANDS_YIELD
        seen = led.report.seen_at(now - led.chunk.t_obs)
        return self._walks if seen is None else StatusReport(Status.SLOWED, seen, led.report.changes[seen].detail)

    def moved_for(self, now: float) -> Reason | None:
        """Why a hand of a chunk that is walked with is led elsewhere than it has it now [s], if one is."""
        if self.carried is None:
            return None
        return self.led.report.moved_at(now - self.led.chunk.t_obs)

    def _frame_in_base(self, led: LedChunk) -> np.ndarray:
        """Frame of a led chunk's hands about the base (4, 4), the pelvis where the stance has it."""
        if led.chunk.hands_in in ("stance", "soles"):
            floor = float(self._planted.feet.floor(self._controller.spec).point[2])
            return make_transform(np.eye(3), np.array([0.0, 0.0, floor]))
        return self._pelvis_in_base(self._walker.pelvis_height if led.seen_low else led.height)

    def _pelvis_in_base(self, height: float) -> np.ndarray:
        """The pelvis about the base (4, 4) where the stance has it, at a height [m]."""
        x, y, heading = base_of(self._planted.feet, self._controller.spec)
        seen = Place(complex(x, y), heading).seen(complex(*self._planted.stance[:2]))
        return make_transform(np.eye(3), np.array([seen.real, seen.imag, height]))

    def _anchor(self, q: np.ndarray) -> Anchor:
        """A configuration (nq,) as what chunks are anchored to."""
        robot, spec = self._controller.robot, self._controller.spec
        T = make_transform(quaternion_to_matrix(q[3:7], "xyzw"), q[:3])
        return Anchor(T, q[7:][robot.pin_to_motor][: len(spec.body_joints)], *spec.by_hand(spec.hand_neutral), spec)


def calm(limits: tuple[HandLimits, ...]) -> tuple[HandLimits, ...]:
    """Limits of the hands of a robot that steps."""
    return tuple(
        replace(one, position=one.position.scaled(*CALM), orientation=one.orientation.scaled(*CALM)) for one in limits
    )


def _changes(prepared: PreparedChunk, projected: np.ndarray, config: PlannerConfig) -> dict[Reason, PlanChange]:
    """What was changed in a chunk so that a robot that steps can follow it, the most important first.

    Args:
        prepared: The chunk.
        projected: How far its steps were moved to keep the limits, shape (H,), [m].
        config: Distance and angle from which a person sees that a hand is elsewhere.
    """
    lift, moved, turned, near = prepared.lift, prepared.moved, prepared.turned, config.clamp_tolerance
    found = {}
    if lift.any():
        text = f"the hands were to go into the floor: targets lifted by {lift.max():.3f} m"
        found[Reason.INTO_FLOOR] = PlanChange(lift, lift > 0.0, text)
    if projected.max() > MOVED_MIN:
        text = f"hands of a robot that steps are not so fast: targets moved by up to {projected.max():.3f} m"
        found[Reason.STEPS_JUMP] = PlanChange(projected, projected > near, text)
    if prepared.smoothed:
        text = f"steps scatter: followed the curve through them in {', '.join(prepared.smoothed)}"
        found[Reason.NOISY_CHUNK] = PlanChange(moved, (moved > near) | (turned > config.turn_tolerance), text)
    return found
