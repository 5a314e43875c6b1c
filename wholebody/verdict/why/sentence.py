"""Causes in a sentence that a person understands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import degrees, inf

from wholebody.planning.judgement.chunk_margins import AT_START
from wholebody.planning.judgement.limits import Limit, Margin
from wholebody.verdict.causes import Why, WouldDo
from wholebody.verdict.quantity import MOVED_MIN, TURNED_MIN, quantity, size_text, when
from wholebody.verdict.why.cause import Cause

SAID = {
    Limit.START: "it begins there, {value} from where the hand is by then ({bound} allowed)",
    Limit.FINGER_RANGE: "{subject} is asked to be at {value}, its range ends at {bound}",
    Limit.HAND_SPEED: "it moves at {value}, can at {bound}",
    Limit.HAND_ACCELERATION: "it speeds up by {value}, can by {bound}",
    Limit.HAND_JERK: "it jerks by {value}, can by {bound}",
    Limit.TURN_SPEED: "it turns at {value}, can at {bound}",
    Limit.TURN_ACCELERATION: "its turn speeds up by {value}, can by {bound}",
    Limit.TURN_JERK: "its turn jerks by {value}, can by {bound}",
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
    Limit.BALANCE: "the centre of mass would come nearer than {bound} to the {subject}",
    Limit.LOAD: "the soles press on the floor with no more than {bound}",
    Limit.JOINT_TORQUE: "{subject} gives as much as it may ({bound})",
    Limit.ZMP: "the pressure under the soles would come nearer than {bound} to the {subject}",
    Limit.CAPTURE_POINT: "the robot would tip over the {subject}",
    Limit.JOINT_ACCELERATION: "{subject} speeds up as fast as it may ({bound})",
    Limit.JOINT_SPEED: "{subject} is as fast as it may be ({bound})",
    Limit.FRICTION: "the soles would slide",
}
"""Sentence for each bound that forbids a chunk."""
BEGUN = "begun with the hands at its row 0 (--start first)"
"""What would do for an input whose way to its first row is all that is wrong."""
IN_THE_WAY = {
    **dict.fromkeys((Limit.BALANCE, Limit.ZMP, Limit.CAPTURE_POINT), "it would tip over the {subject}"),
    Limit.REACH: "no posture gets there",
    Limit.ORIENTATION: "no posture turns it so",
    Limit.TILT: "the {subject} leans as far as it may",
    Limit.PELVIS_HEIGHT: "the pelvis is as low as it may be",
    Limit.JOINT_POSITION: "{subject} is at the end of its range",
    **dict.fromkeys((Limit.WAIST_TORQUE, Limit.JOINT_TORQUE), "the motor of {subject} is at its limit"),
    Limit.SELF_DISTANCE: "{subject} would hit {other}",
    Limit.FLOOR_DISTANCE: "{subject} would hit the floor",
    Limit.LOAD: "the soles would lift off",
    Limit.JOINT_ACCELERATION: "{subject} cannot speed up so fast",
    Limit.JOINT_SPEED: "{subject} cannot turn so fast",
    Limit.FRICTION: "the soles would slide",
}
"""The same in few words, for bounds of the body."""
STRAIGHT = "the {side} arm is straight"
"""What the end of an elbow's range is called."""


def why(cause: Cause, since: float = 0.0, fps: float = 0.0, end: float = inf, rows: float = 0.0) -> Why:
    """A cause for a verdict, its times moved on by ``since`` [s], none after the ``end`` [s].

    Args:
        cause: Of a chunk.
        since: When that begins, since row 0 of the input [s].
        fps: Its steps a second [Hz].
        end: Time of the last row [s].
        rows: Rows of the input a second, where those are not the steps [Hz].
    """
    members = tuple(replace(one, time=one.time + since, step=one.step + round(since * fps)) for one in cause.members)
    text, time = sentence(cause, since, rows or fps, end), min(cause.where[0] + since, end)
    return Why(codes=cause.kinds, members=members, time=time, irreducible=cause.irreducible, sentence=text)


def sentence(cause: Cause, since: float = 0.0, fps: float = 0.0, end: float = inf) -> str:
    """Which hand, where, when, in rows where their rate [Hz] is known, and what stands in the way."""
    time, side, (x, y, z) = cause.where
    time = min(time + since, end)
    row = round(time * fps) if fps else None
    ahead = f"{abs(x):.2f} m {'ahead' if x >= 0.0 else 'behind'}"
    aside = f"{abs(y):.2f} m to the {'left' if y >= 0.0 else 'right'}"
    hand = "right hand" if side else "left hand"
    *reasons, last = dict.fromkeys(map(bound_text, cause.members))
    text = f"{', '.join(reasons)} and {last}" if reasons else last
    return f"{hand} {ahead}, {aside}, {z:.2f} m high at {when(time, row, fps)}: {text}"


def change_text(one: WouldDo) -> str:
    """A single change for people."""
    if one.bound is not None:
        value, bound = (quantity(number, one.bound.unit) for number in (one.bound.value, one.bound.bound))
        return f"with {one.bound.code} of {one.bound.subject} at {value} where the bound is {bound}"
    if one.kind == "start":
        return BEGUN
    if one.steps:
        x, y, heading = one.base
        turn = f", turned by {degrees(heading):.0f} deg" if abs(heading) >= TURNED_MIN else ""
        return f"begun from x {x:.2f} m, y {y:.2f} m{turn}: {one.steps} steps from here"
    text = size_text(one.slower, one.moved, one.turned, one.lighter, one.force)
    if not one.hand:
        return text
    text = text.replace("with a hand", f"with the {one.hand}", 1)
    return f"{text} ({way(one.by)} at row {one.step})" if one.moved > MOVED_MIN else text


def way(by: Sequence[float]) -> str:
    """A displacement in words, its main direction first."""
    words = (("forward", "back"), ("left", "right"), ("up", "down"))
    parts = sorted(((abs(x), word[x < 0.0]) for x, word in zip(by, words, strict=True)), reverse=True)
    return " and ".join(f"{quantity(size, 'm')} {word}" for size, word in parts if size > 0.3 * parts[0][0])


def short_change(one: WouldDo) -> str:
    """A single change in few words: of several directions the main one."""
    if one.kind == "start":
        return "begun at its row 0 (--start first)"
    parts = [f"{one.slower:.2f} times slower"] if one.slower > 1.0 else []
    if one.moved > MOVED_MIN:
        parts.append(f"{one.hand or 'a hand'} {way(one.by) or quantity(one.moved, 'm')}")
    elif one.turned > TURNED_MIN:
        parts.append(f"{one.hand or 'a hand'} turned by {quantity(one.turned, 'rad')}")
    parts += [f"{one.lighter:.2f} kg less in the hands"] if one.lighter else []
    parts += [f"{one.hand} pushing with {int(one.force)} N"] if one.force else []
    return " and ".join(parts) or "its numbers in their range"


def stands_in_the_way(one: Margin) -> str:
    """A bound of the body in few words; of the chunk's own numbers, its sentence."""
    if one.code not in IN_THE_WAY or _is_straight(one):
        return bound_text(one)
    subject, _, other = one.subject.partition(" - ")
    return IN_THE_WAY[one.code].format(subject=body(subject), other=body(other))


def body(name: str) -> str:
    """A joint or a body in words."""
    return name.replace("_joint", "").replace("_link", "").replace("_", " ")


def _is_straight(one: Margin) -> bool:
    return one.code is Limit.JOINT_POSITION and "elbow" in one.subject and one.bound > 1.0


def bound_text(one: Margin) -> str:
    """Sentence for a bound that forbids a chunk."""
    if _is_straight(one):
        return STRAIGHT.format(side=one.subject.partition("_")[0])
    subject, _, other = body(one.subject).partition(" - ")
    excess = -one.margin if one.code in (Limit.REACH, Limit.ORIENTATION) else one.value
    excess = -excess if one.code is Limit.SCENE_DISTANCE else excess
    value, bound = quantity(excess, one.unit), quantity(one.bound, one.unit)
    text = SAID[one.code].format(subject=subject, other=other, value=value, bound=bound)
    return f"{text}, since its first rows move already" if subject.endswith(AT_START) else text
