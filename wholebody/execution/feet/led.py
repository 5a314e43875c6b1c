"""A chunk that hands follow while the robot steps: with the base or in world, and as fast as it says, or is told.

A layout in pelvis, torso or stance says where hands are about a robot that moves on; one in world says it of the room.
The first kind was anchored where that frame was at the observation, in the midst of a step that tilts and sways: hands
are where they were in it, about a base that moves without either.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from dataclasses import replace

import numpy as np

from policy.action_spec.anchor import Anchor, between_soles
from policy.action_spec.codec import WALK
from policy.action_spec.slot_values import NOT_FOLLOWED
from policy.chunk import ActionChunk
from policy.geometry.se3 import inverse, make_transform, yaw_frame
from policy.kinematics.forward import kinematics
from wholebody.execution.feet.carried import about_z
from wholebody.execution.feet.wanted import FASTEST, shares_of_fastest, velocity
from wholebody.planning.plan import PlanReport
from wholebody.walking.places import Place, Velocity

REMEMBERED = 2.0
"""How long it is known where the base was [s]; chosen: older observations are refused, or of a robot that stood."""


class StateLog:
    """Where the robot was, a tick at a time.

    Args:
        dt: Control period [s].
    """

    def __init__(self, dt: float) -> None:
        self._log: deque[tuple[float, np.ndarray]] = deque(maxlen=int(REMEMBERED / dt))

    def begin(self, time: float, q: np.ndarray) -> None:
        """Forget what was before: the robot stood there."""
        self._log.clear()
        self.add(time, q)

    def add(self, time: float, q: np.ndarray) -> None:
        """Take note of a configuration (nq,) at a time [s]."""
        self._log.append((time, q.copy()))

    def at(self, time: float) -> np.ndarray | None:
        """Configuration (nq,) at a time [s], the earliest that is known before that; None where nothing is."""
        k = bisect_right(self._log, time, key=lambda one: one[0])
        return self._log[max(k - 1, 0)][1] if self._log else None

    def covers(self, time: float) -> bool:
        """Whether it goes back to a time [s]."""
        return bool(self._log) and self._log[0][0] <= time


class LedChunk:
    """A chunk that leads the hands of a walk, and the base by its velocity unless somebody else tells where to walk.

    Args:
        chunk: The chunk.
        T_seen: Its hands' frame in world at its observation, shape (4, 4).
        now: Present time [s].
        seen_low: Whether the robot walked then, and so had its pelvis lower than as it stands.
        rides: Whether somebody else tells where to walk.

    Attributes:
        height: Of that frame [m].
        report: What following it from now on changes in it: nothing is planned.
        T_base_frame: That frame about a base that walks, or stands, without sway, shape (4, 4).
    """

    def __init__(
        self, chunk: ActionChunk, T_seen: np.ndarray, now: float, *, seen_low: bool = False, rides: bool = False
    ) -> None:
        self.chunk, self._T_frame_seen, self.T_base_frame = chunk, inverse(T_seen), np.eye(4)
        self.height, self.seen_low, self.rides = float(T_seen[2, 3]), seen_low, rides
        steps, still = np.arange(len(chunk)) / chunk.fps, np.zeros((len(chunk), 2))
        self.report = PlanReport(np.maximum(steps, now - chunk.t_obs), still, 1.0, still[:, 0])

    @property
    def in_world(self) -> bool:
        """Whether its hands stay in world."""
        return self.chunk.hands_in == "world"

    def velocity(self, now: float) -> Velocity:
        """Velocity of the base at a time [s], as far as it is walked; at rest past the end of the chunk."""
        k = max(int((now - self.chunk.t_obs) * self.chunk.fps + 1e-6), 0)
        if self.rides or k >= len(self.chunk) or not moves(self.chunk.base_velocity[k]):
            return Velocity()
        return velocity(self.chunk.base_velocity[k])

    def moved(self, base: Place) -> np.ndarray:
        """How its poses have moved, by now, with a base that is there, shape (4, 4); not at all in world."""
        return np.eye(4) if self.in_world else planar(base) @ self.T_base_frame @ self._T_frame_seen

    def carried(self, base: Place) -> ActionChunk:
        """The chunk about a base that is there."""
        return moved_by(self.chunk, self.moved(base))


def seen_frame(hands_in: str, anchor: Anchor) -> np.ndarray:
    """Frame of a chunk's hands in world at its observation, shape (4, 4)."""
    if hands_in == "stance":
        return anchor.T_world_stance
    if hands_in == "soles":
        soles = kinematics(anchor.robot).soles(anchor.q_body[None])
        return anchor.T_world_base @ between_soles(soles)[0]
    return yaw_frame(anchor.T_world_base) if hands_in == "pelvis_yaw" else anchor.T_world_base


def asks_to_walk(chunk: ActionChunk) -> bool:
    """Whether a chunk says that the base is to move."""
    return chunk.base_velocity is not None and moves(chunk.base_velocity)


def moves(velocity: np.ndarray) -> bool:
    """Whether velocities are more than networks scatter by."""
    return bool(np.abs(velocity).max() > WALK)


def moved_by(chunk: ActionChunk, T: np.ndarray) -> ActionChunk:
    """A chunk whose hands are moved by a transform of the world (4, 4)."""
    return replace(chunk, T_world_lhand=T @ chunk.T_world_lhand, T_world_rhand=T @ chunk.T_world_rhand)


def notes(chunk: ActionChunk, *, walked: bool, not_led: str | None = None) -> tuple[str, ...]:
    """What is noted of a chunk: of one that is walked not that its base stays, but where it is slower than asked.

    ``not_led`` is why its hands are none that a walk can have.
    """
    if not walked:
        return chunk.notes if not_led is None else (*chunk.notes, f"base_velocity {NOT_FOLLOWED}: {not_led}")
    kept = tuple(note for note in chunk.notes if not note.startswith("base_velocity"))
    if shares_of_fastest(chunk.base_velocity).max() <= 1.0:
        return kept
    back, ahead, aside, turn = FASTEST
    most = f"{ahead:g} ahead, {-back:g} back, {aside:g} m/s aside, {turn:g} rad/s"
    speed = float(np.abs(chunk.base_velocity).max())
    asked = f"base_velocity asks for up to {speed:.2g} m/s or rad/s"
    return (*kept, f"{asked}, and what of it is beyond {most} {NOT_FOLLOWED}: the robot walks slower")


def planar(base: Place) -> np.ndarray:
    """Pose of a base in world (4, 4)."""
    return make_transform(about_z(base.heading), np.array([base.point.real, base.point.imag, 0.0]))
