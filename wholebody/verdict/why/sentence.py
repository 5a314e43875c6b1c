"""Causes in a sentence that a person understands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import inf

from wholebody.planning.judgement.chunk_margins import AT_START
from wholebody.planning.judgement.limits import Limit, Margin
from wholebody.verdict.causes import Why, WouldDo
from wholebody.verdict.quantity import MOVED_MIN, quantity, size_text
from wholebody.verdict.why.cause import Cause

SAID = {
    Limit.START: "it begins there, {value} from where it is by then (bound {bound})",
    Limit.FINGER_RANGE: "{subject} is asked to be at {value}, its range ends at {bound}",
    Limit.HAND_SPEED: "it would have to move at {value}, and can at {bound}",
    Limit.HAND_ACCELERATION: "it would have to speed up by {value}, and can by {bound}",
    Limit.HAND_JERK: "its acceleration would have to change by {value}, and can by {bound}",
    Limit.TURN_SPEED: "it would have to turn at {value}, and can at {bound}",
    Limit.TURN_ACCELERATION: "its turn would have to speed up by {value}, and can by {bound}",
    Limit.TURN_JERK: "the acceleration of its turn would have to change by {value}, and can by {bound}",
    Limit.INTO_FLOOR: "it would be {value} too low for the floor",
    Limit.SCENE_DISTANCE: "{subject} would be {value} inside {other}",
    Limit.REACH: "no posture is found that has it there as asked, the nearest motion is {value} away",
    Limit.ORIENTATION: "no posture is found that turns it as asked, the nearest motion is {value} away",
    Limit.HAND_FORCE: "it is to push with {value}, {bound} is what balance, its arm or its limit allow",
    Limit.TILT: "the {subject} is tilted as far as it may be ({bound})",
    Limit.PELVIS_HEIGHT: "the pelvis is as low as it may be ({bound})",
    Limit.JOINT_POSITION: "{subject} is at the end of its range ({bound})",
    Limit.WAIST_TORQUE: "{subject} holds as much as it may ({bound})",
    Limit.SELF_DISTANCE: "{subject} and {other} are as close as they may be ({bound})",
    Limit.FLOOR_DISTANCE: "{subject} is as near to the floor as it may be ({bound})",
    Limit.BALANCE: "the centre of mass is at the {subject} ({bound} inside)",
    Limit.LOAD: "the soles press on the floor with no more than {bound}",
    Limit.JOINT_TORQUE: "{subject} gives as much as it may ({bound})",
    Limit.ZMP: "the pressure is at the {subject} ({bound} inside)",
    Limit.CAPTURE_POINT: "the robot would tip over the {subject}",
    Limit.JOINT_ACCELERATION: "{subject} speeds up as fast as it may ({bound})",
    Limit.JOINT_SPEED: "{subject} is as fast as it may be ({bound})",
    Limit.FRICTION: "the soles would slide",
}
"""Sentence for each bound that forbids a chunk."""
STRAIGHT = "the {side} arm is straight"
"""What the end of an elbow's range is called."""


def why(cause: Cause, since: float = 0.0, fps: float = 0.0, end: float = inf) -> Why:
    """A cause for a verdict, its times moved on by ``since`` [s], none after the ``end`` [s]."""
    members = tuple(replace(one, time=one.time + since, step=one.step + round(since * fps)) for one in cause.members)
    text, time = sentence(cause, since, fps, end), min(cause.where[0] + since, end)
    return Why(codes=cause.kinds, members=members, time=time, irreducible=cause.irreducible, sentence=text, text=text)


def sentence(cause: Cause, since: float = 0.0, fps: float = 0.0, end: float = inf) -> str:
    """Which hand, where, when, in steps where their rate [Hz] is known, and what stands in the way."""
    time, side, (x, y, z) = cause.where
    time = min(time + since, end)
    ahead = f"{abs(x):.2f} m {'ahead' if x >= 0.0 else 'behind'}"
    aside = f"{abs(y):.2f} m to the {'left' if y >= 0.0 else 'right'}"
    hand = "right hand" if side else "left hand"
    *reasons, last = dict.fromkeys(map(bound_text, cause.members))
    text = f"{', '.join(reasons)} and {last}" if reasons else last
    step = f" (step {round(time * fps)})" if fps else ""
    return f"{hand} {ahead}, {aside}, {z:.2f} m high at {time:.2f} s{step}: {text}"


def with_changes(one: Why, changes: Sequence[WouldDo]) -> Why:
    """The only cause of a chunk with the changes of the chunk that would do."""
    text = [change_text(x) for x in changes if x.bound is None]
    return replace(one, sentence=f"{one.sentence}; it would do {', or '.join(text)}") if text else one


def change_text(one: WouldDo) -> str:
    """A single change for people."""
    if one.bound is not None:
        value, bound = (quantity(number, one.bound.unit) for number in (one.bound.value, one.bound.bound))
        return f"with {one.bound.code} of {one.bound.subject} at {value} where the bound is {bound}"
    text = size_text(one.slower, one.moved, one.turned, one.lighter, one.force)
    if not one.hand:
        return text
    text = text.replace("with a hand", f"with the {one.hand}", 1)
    return f"{text} ({_way(one.by)} at step {one.step})" if one.moved > MOVED_MIN else text


def _way(by: Sequence[float]) -> str:
    """A displacement in words, its main direction first."""
    words = (("forward", "back"), ("left", "right"), ("up", "down"))
    parts = sorted(((abs(x), word[x < 0.0]) for x, word in zip(by, words, strict=True)), reverse=True)
    return " and ".join(f"{quantity(size, 'm')} {word}" for size, word in parts if size > 0.3 * parts[0][0])


def bound_text(one: Margin) -> str:
    """Sentence for a bound that forbids a chunk."""
    if one.code is Limit.JOINT_POSITION and "elbow" in one.subject and one.bound > 1.0:
        return STRAIGHT.format(side=one.subject.partition("_")[0])
    subject, _, other = one.subject.replace("_joint", "").replace("_link", "").replace("_", " ").partition(" - ")
    excess = -one.margin if one.code in (Limit.REACH, Limit.ORIENTATION) else one.value
    excess = -excess if one.code is Limit.SCENE_DISTANCE else excess
    value, bound = quantity(excess, one.unit), quantity(one.bound, one.unit)
    text = SAID[one.code].format(subject=subject, other=other, value=value, bound=bound)
    return f"{text}, since its first steps move already" if subject.endswith(AT_START) else text
