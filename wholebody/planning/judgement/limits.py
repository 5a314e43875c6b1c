"""Every bound that can say no to a chunk, by a stable code, and the room that a motion leaves to it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

from policy.chunk import ActionChunk
from wholebody.planning.plan import ChunkPlan


class Limit(StrEnum):
    """A kind of bound. A member is its code, also in JSON.

    Attributes:
        unit: Of its values.
        sentence: What it bounds; ``docs/verdict.md`` has the same one.
    """

    unit: str
    sentence: str

    def __new__(cls, code: str, unit: str, sentence: str) -> Limit:
        """A member with its unit and sentence."""
        limit = str.__new__(cls, code)
        limit._value_, limit.unit, limit.sentence = code, unit, sentence
        return limit

    # Of the chunk's own numbers.
    START = "start", "m", "distance of the first step from the hands"
    FINGER_RANGE = "finger_range", "rad", "range of a finger joint"
    HAND_SPEED = "hand_speed", "m/s", "speed of a hand along an axis"
    HAND_ACCELERATION = "hand_acceleration", "m/s^2", "acceleration of a hand along an axis"
    HAND_JERK = "hand_jerk", "m/s^3", "jerk of a hand along an axis"
    TURN_SPEED = "turn_speed", "rad/s", "angular speed of a hand about an axis"
    TURN_ACCELERATION = "turn_acceleration", "rad/s^2", "angular acceleration of a hand about an axis"
    TURN_JERK = "turn_jerk", "rad/s^3", "angular jerk of a hand about an axis"
    INTO_FLOOR = "into_floor", "m", "how far a hand asked into the floor has to be lifted"

    # Of what stands around the robot.
    SCENE_DISTANCE = "scene_distance", "m", "distance of hands as asked, and of the planned robot, from the scene"

    # Of the palms that a plan gets to.
    REACH = "reach", "m", "distance of a planned palm from where it is asked to be"
    ORIENTATION = "orientation", "rad", "angle of a planned palm from how it is asked to be turned"
    HAND_FORCE = "hand_force", "N", "force that a hand is told to push with"

    # Of one configuration.
    TILT = "tilt", "rad", "tilt of torso or pelvis"
    PELVIS_HEIGHT = "pelvis_height", "m", "height of the pelvis"
    JOINT_POSITION = "joint_position", "rad", "position of a joint"
    WAIST_TORQUE = "waist_torque", "N m", "torque of the waist at rest"
    SELF_DISTANCE = "self_distance", "m", "distance of two bodies of the robot"
    FLOOR_DISTANCE = "floor_distance", "m", "height of a hand or forearm over the floor"
    BALANCE = "balance", "m", "centre of mass inside the soles"

    # Of the motion.
    LOAD = "load", "N", "force with which the soles press on the floor"
    JOINT_TORQUE = "joint_torque", "N m", "torque of waist and arms in motion"
    ZMP = "zmp", "m", "zero-moment point inside the soles"
    CAPTURE_POINT = "capture_point", "m", "capture point inside the soles"
    JOINT_ACCELERATION = "joint_acceleration", "rad/s^2", "acceleration of a joint"
    JOINT_SPEED = "joint_speed", "rad/s", "speed of a joint"
    FRICTION = "friction", "", "force along the floor beyond what friction gives, as a share of the weight"


OF_NUMBERS = frozenset(list(Limit)[: list(Limit).index(Limit.REACH)])
"""Bounds on the chunk's own numbers."""


@dataclass(frozen=True, kw_only=True)
class Margin:
    """The least room that a chunk leaves to a bound of one kind, and where.

    Attributes:
        code: Which kind.
        subject: Joint, pair of bodies, edge of the soles, hand or body.
        time: Since the chunk's first step [s].
        step: The same in steps of the chunk.
        value, bound: In the unit.
        unit: Of `Limit`.
        margin: Room in the unit; negative, how far it is exceeded.
        share: The same in terms of what a plan that is followed may exceed the bound by; -1 and less is a no. In a
            verdict, on one scale: 0 is the most that is done as given, and what is negative is not.
    """

    code: Limit
    subject: str
    time: float
    step: int
    value: float
    bound: float
    unit: str
    margin: float
    share: float


class Surroundings(Protocol):
    """What stands around the robot, which no plan sees; hands that are told to touch something may."""

    def asked(self, chunk: ActionChunk) -> Margin | None:
        """Least room of the hands where a chunk asks them to be; None where nothing is near."""

    def planned(self, plan: ChunkPlan, chunk: ActionChunk) -> Margin | None:
        """Least room of the robot along a plan of a chunk; None where nothing is near."""
