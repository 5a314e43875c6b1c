"""Scripted policies that meet the world with their hands; each is made for a scene of `models.scenes`.

The forces that they expect go with the motion (`ScriptedMotion.f_world_lpalm`): what the world does to a palm [N].
"""

from __future__ import annotations

from dataclasses import replace
from typing import Literal, get_args

import numpy as np

from models.places import (
    BAR,
    BOARD,
    BUTTON,
    BUTTON_FORCE,
    BUTTON_TRAVEL,
    CRATE_WIDTH,
    DRAWER_FRICTION,
    LEVER,
    LEVER_LENGTH,
    LEVER_RADIUS,
    LEVER_TORQUE,
    LEVER_TURN,
    ON_TABLE,
    SHELF_HEIGHTS,
    TABLE_HEIGHT,
    WALL_AHEAD,
    WALL_BESIDE,
)
from policy.action_spec.hands import Side
from policy.errors import PolicyError
from policy.scripted.policy import ScriptedMotion, ScriptedPolicy, minimum_jerk
from policy.scripted.waypoints import Waypoint, one_hand, waypoint_policy

Direction = Literal["down", "ahead", "side", "up"]
Hands = Literal["left", "right", "both"]

MIRROR_Y = np.array([1.0, -1.0, 1.0])
FIST_AHEAD, FINGERS_AHEAD = 0.014, 0.086
"""How far a closed hand, and one as in the stance, goes beyond its palm point along its x axis [m]; of the hulls."""
HAND_HALF, HAND_BACK = 0.044, 0.027
"""Distances from the palm point to the edge of the hand, up as down, and to its back [m]; of the hulls, hand as in
the stance."""
PALM_FACE = 0.021
"""Distance from the palm point to the inside of straight fingers [m]; of the hulls."""
FLAT_HAND = np.array([0.0, -0.55, 0.05, 0.0, 0.0, 0.0, 0.0])
"""Fingers of the left hand straight, the thumb away from the palm [rad]; right: with the other sign."""
INWARDS = np.array([0.0, 0.0, 0.15])
"""Rotation vector by which the right hand is turned to the left, so that the fingers meet a box and not the heel of the
hand, which is behind the middle of the box [rad]; measured: without it a box of 2 kg turns between the hands."""
BAR_IN_HAND = np.array([-0.02, 0.038, 0.0])
"""Axis of a bar that the right hand's fingers have closed around, from the palm point in hand axes [m]."""

WIPE_FORCE, WIPE_DEPTH = 10.0, 0.017
"""Force of `wipe` on the table [N], and depth to which the hand is commanded into it [m]: the force over a hand's
600 N/m."""
PUSH_SPEED_PEAK = 1.875
"""Largest speed of a minimum-jerk motion over its mean one."""
SURFACES: dict[Direction, tuple[np.ndarray, np.ndarray]] = {
    "down": (np.array([0.0, 0.0, -1.0]), np.array([0.36, 0.20, TABLE_HEIGHT + HAND_HALF])),
    "ahead": (np.array([1.0, 0.0, 0.0]), np.array([WALL_AHEAD, 0.18, 0.95])),
    "side": (np.array([0.0, 1.0, 0.0]), np.array([0.30, WALL_BESIDE - HAND_BACK, 0.95])),
    "up": (np.array([0.0, 0.0, 1.0]), np.array([0.40, 0.20, SHELF_HEIGHTS[2] - BOARD - HAND_HALF])),
}
"""Direction in which a left hand is led, and place of its palm point when the hand touches [m]; ``ahead`` without
what the hand goes beyond its palm point."""


def touch(
    direction: Direction = "down",
    hands: Hands = "left",
    *,
    speed: float = 0.1,
    depth: float = 0.02,
    along: tuple[float, float] = (0.0, 0.0),
    fist: bool = False,
    begin: float = 2.5,
    hold: float = 1.5,
) -> ScriptedPolicy:
    """One hand or both are led into the table, a wall or a board, held there, and led away again.

    Args:
        direction: ``down`` on the table, ``ahead`` into the wall, to the ``side`` into the corridor's, ``up`` under
            the shelf's board.
        hands: Which.
        speed: Fastest of the way in and out [m/s].
        depth: How far past the touch the hand is commanded [m].
        along: Where on the surface: its two other coordinates, x before y before z, from the usual place [m].
        fist: With fingers closed.
        begin: When the way in begins [s].
        hold: How long it stays in [s].

    Raises:
        PolicyError: If there is no such direction or hand, or a number makes no sense.
    """
    for name, value, known in (("direction", direction, get_args(Direction)), ("hands", hands, get_args(Hands))):
        if value not in known:
            raise PolicyError(f"touch {name} {value!r} is unknown; it is one of {', '.join(known)}")
    if not (speed > 0.0 and depth > 0.0 and begin > 0.0 and hold > 0.0):
        raise PolicyError("touch: speed, depth, begin and hold must be above 0")
    u, at = SURFACES[direction]
    at = at.copy()
    at[u == 0.0] += along
    if direction == "ahead":
        at[0] -= FIST_AHEAD if fist else FINGERS_AHEAD
    gap = float(np.clip(depth, 0.05, 0.10))
    before, inside, way = at - gap * u, at + depth * u, PUSH_SPEED_PEAK * (gap + depth) / speed
    which = ("left", "right") if hands == "both" else (hands,)
    times = begin, begin + way, begin + way + hold, begin + 2.0 * way + hold, begin + 2.0 * way + hold + 2.0
    closing = 1.0 if fist else None
    places = before, inside, inside, before, before
    points = [_hands(which, time, place, closing) for time, place in zip(times, places, strict=True)]
    return waypoint_policy("touch", points)


def wipe(*, seconds: float = 20.0, force: float = WIPE_FORCE, side: Side = "left") -> ScriptedPolicy:
    """One hand rests on the table and wipes it in ellipses.

    Args:
        seconds: How long [s].
        force: Expected on the table [N].
        side: Which hand.
    """
    sign, u = (1.0 if side == "left" else -1.0), np.array([0.0, 0.0, -1.0])
    over = np.array([0.36, 0.20 * sign, TABLE_HEIGHT + HAND_HALF + 0.05])
    pressed, begin = over + u * (0.05 + WIPE_DEPTH), 4.0
    push = np.array([0.0, 0.0, force])
    end = begin + seconds
    points = [one_hand(side, 2.5, over, 1.0), one_hand(side, begin, pressed, force=push), one_hand(side, end)]
    points += [one_hand(side, end + 1.5, over, force=np.zeros(3)), one_hand(side, end + 2.5)]
    still = waypoint_policy("wipe", points)
    palm = "p_world_lpalm" if side == "left" else "p_world_rpalm"

    def script(t: np.ndarray) -> ScriptedMotion:
        motion, since = still.script(t), t - begin
        fade = minimum_jerk(since) * minimum_jerk(seconds - since)
        phase = 2.0 * np.pi * 0.25 * since
        circle = np.stack([0.05 * np.sin(phase), 0.08 * sign * (np.cos(phase) - 1.0), np.zeros_like(t)], axis=1)
        return replace(motion, **{palm: getattr(motion, palm) + fade[:, None] * circle})

    return ScriptedPolicy("wipe", script, still.duration)


def press(*, force: float = BUTTON_FORCE[1], hold: float = 0.5) -> ScriptedPolicy:
    """The right fist presses the button until it clicks, and lets it go.

    Args:
        force: Expected of the button where it clicks [N].
        hold: How long it is held in [s].
    """
    x, y, z = BUTTON
    out = np.array([x - FIST_AHEAD, y, z])
    before, pressed = (out + np.array([ahead, 0.0, 0.0]) for ahead in (-0.06, BUTTON_TRAVEL + 0.03))
    push = np.array([-force, 0.0, 0.0])
    return waypoint_policy(
        "press",
        [
            one_hand("right", 2.5, before, 1.0),
            one_hand("right", 3.3, out, force=np.zeros(3)),
            one_hand("right", 4.3, pressed, force=push),
            one_hand("right", 4.3 + hold, None),
            one_hand("right", 5.3 + hold, out, force=np.zeros(3)),
            one_hand("right", 6.3 + hold, before),
            one_hand("right", 7.3 + hold, None),
        ],
    )


def pull_drawer(*, force: float = DRAWER_FRICTION, pull: float = 0.30) -> ScriptedPolicy:
    """The right hand closes around the bar of the drawer, pulls it open, lets go and moves aside.

    Args:
        force: Expected of the drawer [N].
        pull: How far [m].
    """
    at_bar = np.array(BAR) - BAR_IN_HAND
    aside, out = np.array([0.0, -0.09, 0.0]), np.array([-pull, 0.0, 0.0])
    ahead = np.array([force, 0.0, 0.0])
    return waypoint_policy(
        "pull_drawer",
        [
            one_hand("right", 2.5, at_bar + aside, 0.0),
            one_hand("right", 3.7, at_bar),
            one_hand("right", 5.0, None, 1.0),
            one_hand("right", 5.4, None, force=ahead),
            one_hand("right", 11.4, at_bar + out),
            one_hand("right", 12.4),
            one_hand("right", 12.9, force=np.zeros(3)),
            one_hand("right", 14.0, None, 0.0),
            one_hand("right", 15.2, at_bar + out + aside),
            one_hand("right", 16.2),
        ],
    )


def turn_handle(*, hold: float = 0.5) -> ScriptedPolicy:
    """The right fist presses the lever of the door down until it unlatches, and lets it go up.

    Args:
        hold: How long it is held down [s].
    """
    arm, rest = LEVER_LENGTH - 0.03, LEVER_RADIUS + HAND_HALF
    over, (low, high) = np.array([0.0, 0.0, 0.06]), LEVER_TORQUE
    angles = np.linspace(0.0, LEVER_TURN + 0.1, 5)
    # The lever turns about x, the hand stays level on it and is pushed across the lever.
    arc = [np.array(LEVER) + np.array([-0.005, arm * np.cos(a), rest - arm * np.sin(a)]) for a in angles]
    # The edge of the palm that is nearer to the axis lies on the lever.
    sizes = (low + (high - low) * angles / LEVER_TURN) / (arm - PALM_FACE)
    pushes = [size * np.array([0.0, np.sin(a), np.cos(a)]) for size, a in zip(sizes, angles, strict=True)]
    points = [one_hand("right", 2.5, arc[0] + over, 1.0), one_hand("right", 3.5, arc[0])]
    points += [one_hand("right", 3.5 + 0.5 * i, arc[i], force=pushes[i]) for i in range(1, 5)]
    end = 5.5 + hold
    points += [one_hand("right", end)]
    points += [one_hand("right", end + 0.5 * (4 - i), arc[i], force=pushes[i]) for i in (3, 2, 1)]
    points += [one_hand("right", end + 2.0, arc[0], force=np.zeros(3)), one_hand("right", end + 3.0, arc[0] + over)]
    return waypoint_policy("turn_handle", [*points, one_hand("right", end + 4.0)])


def lift_box(*, mass: float = 2.0, squeeze: float = 25.0, depth: float = 0.008) -> ScriptedPolicy:
    """Two palms take the crate from the table, lift it, carry it 0.10 m to the left and put it down again.

    Args:
        mass: Expected of the crate [kg].
        squeeze: Expected of each side of it [N].
        depth: How far into its sides the palms are commanded [m]; so little that their place is still held aside.
    """
    # Straight fingers along its sides under its centre of mass, the open thumbs before it.
    x, y, z = ON_TABLE[0] - 0.04, 0.5 * CRATE_WIDTH + PALM_FACE, TABLE_HEIGHT + 0.09
    middle, aside, up = np.array([x, 0.0, z]), np.array([0.0, 0.10, 0.0]), np.array([0.0, 0.0, 0.10])
    weight = np.array([0.0, 0.0, -0.5 * 9.81 * mass])

    def both(time: float, at: np.ndarray, half: float, push: float = 0.0, load: float = 0.0) -> Waypoint:
        out, aside_push = np.array([0.0, half, 0.0]), np.array([0.0, push, 0.0])
        force = load * weight
        return Waypoint(
            time, at + out, at - out, -INWARDS, INWARDS, lforce=force + aside_push, rforce=force - aside_push
        )

    carried = waypoint_policy(
        "lift_box",
        [
            both(2.5, middle + 0.5 * up, y + 0.08),
            both(3.5, middle, y + 0.04),
            both(4.5, middle, y),
            both(5.5, middle, y - depth, squeeze),
            both(7.0, middle + up, y - depth, squeeze, 1.0),
            both(9.0, middle + up + aside, y - depth, squeeze, 1.0),
            both(11.0, middle + aside, y - depth, squeeze, 1.0),
            both(11.5, middle + aside, y - depth, squeeze),
            both(12.5, middle + aside, y),
            both(13.5, middle + aside, y + 0.08),
            both(14.5, middle + aside + 0.5 * up, y + 0.08),
            both(15.5, middle + aside + 0.5 * up, y + 0.08),
        ],
    )

    return _flat(carried)


def lift_up(
    width: float, mass: float, off: tuple[float, float] = (0.0, 0.0), *, squeeze: float = 30.0, depth: float = 0.03
) -> ScriptedPolicy:
    """Motion of two palms that lift a box from the table by 0.10 m, held above its middle so that it hangs upright.

    Args:
        width: Distance of the palms on it [m].
        mass: Expected of it [kg].
        off: How far ahead and to the left of its usual place it stands [m].
        squeeze: Expected of each side of it [N]; measured, palms led 10 mm aside anew in each chunk, and along with the
            carton where that slips: 18 N lift 0 of 2, 25 N 3 of 4, 35 N 6 of 6.
        depth: How far into its sides the palms are commanded [m]; chosen: more than a policy's places are off, and at
            600 N/m less than the squeeze.
    """
    y = 0.5 * width + PALM_FACE
    middle, up = np.array([ON_TABLE[0] - 0.045 + off[0], off[1], TABLE_HEIGHT + 0.10]), np.array([0.0, 0.0, 0.10])

    def both(time: float, at: np.ndarray, half: float, push: float = 0.0, load: float = 0.0) -> Waypoint:
        out, side, down = np.array([0.0, half, 0.0]), np.array([0.0, push, 0.0]), np.array([0.0, 0.0, -4.905 * load])
        return Waypoint(time, at + out, at - out, -INWARDS, INWARDS, lforce=down + side, rforce=down - side)

    return _flat(
        waypoint_policy(
            "lift_up",
            [
                both(2.5, middle + 0.5 * up, y + 0.08),
                both(3.3, middle, y + 0.04),
                both(4.2, middle, y),
                both(5.2, middle, y - depth, squeeze),
                both(7.2, middle + up, y - depth, squeeze, mass),
                both(8.2, middle + up, y - depth, squeeze, mass),
            ],
        )
    )


def _flat(policy: ScriptedPolicy) -> ScriptedPolicy:
    """Motion of a policy with both hands flat, once they are in front of the robot."""

    def script(t: np.ndarray) -> ScriptedMotion:
        motion, share = policy.script(t), minimum_jerk(t / 2.5)[:, None]
        flat = [q + share * (sign * FLAT_HAND - q) for q, sign in ((motion.q_lhand, 1.0), (motion.q_rhand, -1.0))]
        return replace(motion, q_lhand=flat[0], q_rhand=flat[1])

    return ScriptedPolicy(policy.name, script, policy.duration)


def _hands(which: tuple[str, ...], time: float, left: np.ndarray, closing: float | None) -> Waypoint:
    """Waypoint of one hand or both, given for the left one."""
    palms = {"lpalm": left, "lgrasp": closing} if "left" in which else {}
    if "right" in which:
        palms |= {"rpalm": left * MIRROR_Y, "rgrasp": closing}
    return Waypoint(time, **palms)
