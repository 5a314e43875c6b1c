"""Causes in a sentence that a person understands, and as data."""

from __future__ import annotations

from dataclasses import dataclass, replace

from wholebody.planning.judgement.cause import Cause
from wholebody.planning.judgement.limits import Limit, Margin
from wholebody.verdict.quantity import quantity

SAID = {
    Limit.START: "it begins {value} from the hands",
    Limit.FINGER_RANGE: "{subject} is asked to be at {value}, its range ends at {bound}",
    Limit.HAND_SPEED: "the {subject} would have to move at {value}, it can {bound}",
    Limit.HAND_ACCELERATION: "the {subject} would have to be sped up by {value}, it can {bound}",
    Limit.HAND_JERK: "the {subject} would have to be jerked by {value}, it can {bound}",
    Limit.TURN_SPEED: "the {subject} would have to turn at {value}, it can {bound}",
    Limit.TURN_ACCELERATION: "the turn of the {subject} would have to be sped up by {value}, it can {bound}",
    Limit.TURN_JERK: "the turn of the {subject} would have to be jerked by {value}, it can {bound}",
    Limit.INTO_FLOOR: "it would be {value} too low for the floor",
    Limit.SCENE_DISTANCE: "{subject} would be {value} deep in each other",
    Limit.REACH: "it is {value} further than any posture reaches",
    Limit.ORIENTATION: "no posture turns it so, {value} are missing",
    Limit.TILT: "the {subject} is tilted as far as it may be",
    Limit.PELVIS_HEIGHT: "the pelvis is as low as it may be",
    Limit.JOINT_POSITION: "{subject} is at the end of its range, {bound}",
    Limit.WAIST_TORQUE: "{subject} holds as much as it may, {bound}",
    Limit.SELF_DISTANCE: "{subject} are as close as they may be, {bound}",
    Limit.FLOOR_DISTANCE: "{subject} is as near to the floor as it may be, {bound}",
    Limit.BALANCE: "the centre of mass is as near to the {subject} as it may be, {bound}",
    Limit.LOAD: "the soles press on the floor with no more than {bound}",
    Limit.JOINT_TORQUE: "{subject} gives as much as it may, {bound}",
    Limit.ZMP: "the pressure is as near to the {subject} as it may be, {bound}",
    Limit.CAPTURE_POINT: "the robot would tip over the {subject}",
    Limit.JOINT_ACCELERATION: "{subject} speeds up as fast as it may, {bound}",
    Limit.JOINT_SPEED: "{subject} is as fast as it may be, {bound}",
    Limit.FRICTION: "the soles would slide",
}
"""What each bound says where it stands in the way."""
STRAIGHT = "the {side} arm is straight"
"""What the end of an elbow's range is called."""


@dataclass(frozen=True)
class WouldDo:
    """A single change that makes a chunk feasible, the smallest of its kind that was found.

    Attributes:
        kind: ``slower``, ``moved``, ``turned``, ``lighter`` or ``bound``.
        slower: Factor on its time; 1 is unslowed.
        moved, turned: How far a palm is at most from where it was asked to be [m], [rad].
        lighter: Mass less in the hands, both together [kg].
        bound: A bound of the robot, and the value that a plan with all others kept has instead; it need not be the
            least one.
    """

    kind: str
    slower: float = 1.0
    moved: float = 0.0
    turned: float = 0.0
    lighter: float = 0.0
    bound: Margin | None = None


@dataclass(frozen=True, kw_only=True)
class Tick:
    """What the tick's program says at one instant.

    Attributes:
        proven: Whether it has no solution, which ``A``, ``lower``, ``upper`` and ``weights`` prove.
        time: Since the first step of the input [s]. step: The same in steps.
        rows: Names of the rows that forbid or, where there is a solution, of those that limit the hands most.
        weights: Of each row: the Farkas vector, or the multipliers.
        A, lower, upper: Of a proof ``lower <= A x <= upper``, x the accelerations of base and joints, then the forces
            at the corners of the soles; infinite sides are None.
    """

    proven: bool
    time: float
    step: int
    rows: list[str]
    weights: list[float]
    A: list[list[float]]
    lower: list[float | None]
    upper: list[float | None]


@dataclass(frozen=True, kw_only=True)
class Why:
    """One cause of a verdict.

    Attributes:
        codes: Kinds of bounds that together forbid the chunk.
        members: Where each is met, at times since the first step of the input.
        irreducible: Whether no plan is found with them alone, and one without any one of them.
        sentence: The same for a person.
    """

    codes: tuple[Limit, ...]
    members: tuple[Margin, ...]
    irreducible: bool
    sentence: str


def why(cause: Cause, since: float = 0.0, fps: float = 0.0) -> Why:
    """A cause for a verdict, its times moved on by ``since`` [s]."""
    members = tuple(replace(one, time=one.time + since, step=one.step + round(since * fps)) for one in cause.members)
    return Why(codes=cause.kinds, members=members, irreducible=cause.irreducible, sentence=sentence(cause, since))


def sentence(cause: Cause, since: float = 0.0) -> str:
    """Which hand, where, when, and what stands in the way."""
    time, side, (x, y, z) = cause.where
    ahead = f"{abs(x):.2f} m {'ahead' if x >= 0.0 else 'behind'}"
    aside = f"{abs(y):.2f} m to the {'left' if y >= 0.0 else 'right'}"
    hand = "right hand" if side else "left hand"
    reasons = " and ".join(dict.fromkeys(map(_said, cause.members)))
    return f"{hand} {ahead}, {aside}, {z:.2f} m high at {time + since:.2f} s: {reasons}"


def _said(one: Margin) -> str:
    if one.code is Limit.JOINT_POSITION and "elbow" in one.subject and one.bound > 1.0:
        return STRAIGHT.format(side=one.subject.partition("_")[0])
    subject = one.subject.replace("_joint", "").replace("_link", "").replace("_", " ")
    if one.code in (Limit.SELF_DISTANCE, Limit.SCENE_DISTANCE):
        subject = subject.replace(" - ", " and ")
    excess = -one.margin if one.code in (Limit.REACH, Limit.ORIENTATION, Limit.SCENE_DISTANCE) else one.value
    return SAID[one.code].format(subject=subject, value=quantity(excess, one.unit), bound=quantity(one.bound, one.unit))
