"""A walk that a chunk leads: when it does, and its hands meanwhile."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from policy.action_spec.anchor import Anchor
from policy.chunk import ActionChunk
from policy.geometry.rotations import quaternion_to_matrix
from policy.geometry.se3 import make_transform
from wholebody.control.base import Controller
from wholebody.execution.feet.carried import at_rest, hands_carried
from wholebody.execution.feet.elsewhere import base_of
from wholebody.execution.feet.led import LedChunk, StateLog, asks_to_walk, seen_frame
from wholebody.execution.feet.walker import Walker
from wholebody.execution.plan_follower import PlanFollower
from wholebody.execution.planted_feet import PlantedFeet
from wholebody.execution.states import Machine, State
from wholebody.planning.preparation import prepare
from wholebody.reference import HandLimits, ReferenceSmoother
from wholebody.types import RobotState, StatusReport
from wholebody.walking.places import Place, Velocity


class LedWalk(ABC):
    """The part of `wholebody.execution.feet.stepping.Stepping` that a chunk with a base velocity leads."""

    led: LedChunk | None
    active: bool
    coming: bool
    base: Place
    _wanted: Place | Velocity
    _log: StateLog
    _controller: Controller
    _planted: PlantedFeet
    _limits: tuple[HandLimits, ...]
    _states: Machine
    _smoother: ReferenceSmoother
    _follower: PlanFollower
    _walker: Walker

    @abstractmethod
    def refusal(self) -> StatusReport | None:
        """Why no walk can be begun or changed now; None if one can."""

    @abstractmethod
    def stop(self) -> None:
        """Come to a stand, within three steps."""

    def take(self, chunk: ActionChunk, state: RobotState, now: float, *, may: bool) -> None:
        """Note a chunk that says how the base is to move, or that the newest one does not; ``may``: walk with it.

        One that says so while the robot walks with another one is walked with, whatever it says.
        """
        before, self.led = self.led, None
        goes_on = self.active and before is not None and chunk.base_velocity is not None
        if may and (goes_on or asks_to_walk(chunk)) and self.refusal() is None:
            q = self._log.at(chunk.t_obs) if self.active else None
            T = seen_frame(chunk.hands_in, self._anchor(state.q if q is None else q))
            low = self.active and self._log.covers(chunk.t_obs - self._walker.gait.shift)
            self.led = LedChunk(chunk, T, now, seen_low=low)
        elif before is not None and self.active:
            self.stop()

    def due(self, now: float) -> bool:
        """Whether the chunk that leads the base asks for a walk now [s], or goes on with one."""
        if self.led is None or self.refusal() is not None:
            return False
        return self.coming or not self.led.velocity(now).is_rest

    @property
    def holds_hands(self) -> bool:
        """Whether hands are held where they are about the robot while it steps: without a chunk that leads it."""
        return self.active and (self.led is None or self._states.now is not State.WALKING)

    @property
    def carried(self) -> np.ndarray | None:
        """How the poses of the chunk that is walked with have moved with the base, shape (4, 4); None for no such."""
        if self.led is None or self._states.now is not State.WALKING:
            return None
        return self.led.moved(self._walker.walk.guide.place)

    def stood(self, newest: ActionChunk | None) -> ActionChunk | None:
        """The newest chunk, or what it is about a base that has come to a stand, if it led that."""
        if self.led is None or newest is not self.led.chunk:
            return newest
        return self.led.carried(self.base)

    def _lead_hands(self, now: float) -> None:
        """Lead the hands along the chunk's own paths, from what they do now [s]."""
        led, walker, chunk = self.led, self._walker, self.led.chunk
        if walker.in_world is not led.in_world:
            here, there = walker.base, walker.walk.guide.place
            way = (there, here) if walker.in_world else (here, there)
            self._smoother.reset(at_rest(hands_carried(self._smoother.motion.rows, *way)))
            walker.in_world = led.in_world
        led.T_base_frame = self._frame_in_base(walker.pelvis_height if led.seen_low else led.height)
        prepared = prepare(led.carried(walker.base), self._limits)
        paths, _ = prepared.paths(now, self._smoother.motion, 1.0)
        self._follower.carry(paths, now - chunk.t_obs, float(chunk.times[-1] - chunk.t_obs))
        self._follower.ride()

    def _frame_in_base(self, height: float) -> np.ndarray:
        """Frame of the led chunk's hands about the base (4, 4), the pelvis where the stance has it, at a height [m]."""
        floor = float(self._planted.feet.floor(self._controller.spec).point[2])
        if self.led.chunk.hands_in in ("stance", "soles"):
            return make_transform(np.eye(3), np.array([0.0, 0.0, floor]))
        x, y, heading = base_of(self._planted.feet, self._controller.spec)
        seen = Place(complex(x, y), heading).seen(complex(*self._planted.stance[:2]))
        return make_transform(np.eye(3), np.array([seen.real, seen.imag, height]))

    def _anchor(self, q: np.ndarray) -> Anchor:
        """A configuration (nq,) as what chunks are anchored to."""
        robot, spec = self._controller.robot, self._controller.spec
        T = make_transform(quaternion_to_matrix(q[3:7], "xyzw"), q[:3])
        return Anchor(T, q[7:][robot.pin_to_motor][: len(spec.body_joints)], *spec.by_hand(spec.hand_neutral), spec)
