"""Scripted policies that tell no force: hands are led on until what they hold comes along."""

from __future__ import annotations

import numpy as np

from models.places import TABLE_HEIGHT
from policy.scripted.contact import HAND_HALF, PUSH_SPEED_PEAK, WIPE_DEPTH
from policy.scripted.library import OBJECT_IN_PALM
from policy.scripted.policy import ScriptedPolicy, stance_pose
from policy.scripted.waypoints import Waypoint, one_hand, waypoint_policy

BESIDE = np.array([0.0, 0.12, 0.0])
"""How far to the left of something the open left hand comes and goes [m]; chosen: clear of it with all fingers."""
UP = np.array([0.0, 0.0, 0.12])
"""How far something is lifted from the floor [m]; chosen: twice as far as its task asks for."""
LOW = np.array([0.30, -0.25, 0.40])
"""Where the right palm is while the left one is at the floor [m]; chosen: low as well, so that the body goes down in
place of turning."""
CLEAR = 0.07
"""How high above the boards of a shelf something is carried [m]; chosen: a hand's half and a finger more."""
BEFORE = 0.28
"""How far ahead a palm is that carries something past the edges of the boards [m]; chosen: 0.1 m before them."""
WIPED_PAST, WIPE_SPEED = 0.05, 0.15
"""How far past both ends of a streak the hand is led [m], and its largest speed [m/s]; measured: friction on the table
holds it back by 0.03 to 0.06 m."""


def pick_from_floor(p_world_object: np.ndarray) -> ScriptedPolicy:
    """The left hand goes down to something upright on the floor, closes on it from its side and lifts it.

    Args:
        p_world_object: Its axis at the height to grasp it, (3,) [m].
    """
    at = _palm(p_world_object)
    return waypoint_policy(
        "pick_from_floor",
        [
            Waypoint(2.5, at + BESIDE + [0.0, 0.0, 0.35], LOW, lgrasp=0.0),
            one_hand("left", 4.5, at + BESIDE),
            one_hand("left", 6.2, at),
            one_hand("left", 7.7, None, 1.0),
            one_hand("left", 9.2, at + UP),
            one_hand("left", 10.2),
        ],
    )


def put_on_shelf(p_world_object: np.ndarray, p_world_spot: np.ndarray) -> ScriptedPolicy:
    """The left hand takes something upright from a board of a shelf, and puts it on another one, past their edges.

    Args:
        p_world_object: Its axis at the height to grasp it, (3,) [m].
        p_world_spot: Where that point is to be at the end, (3,) [m].
    """
    at, there, home, up = _palm(p_world_object), _palm(p_world_spot), stance_pose().p_world_lpalm, [0.0, 0.0, CLEAR]
    return waypoint_policy(
        "put_on_shelf",
        [
            one_hand("left", 1.3, np.array([home[0], (at + BESIDE)[1], at[2]]), 0.0),
            one_hand("left", 2.5, at + BESIDE),
            one_hand("left", 4.5, at),
            one_hand("left", 6.0, None, 1.0),
            one_hand("left", 7.0, at + up),
            one_hand("left", 8.2, np.array([BEFORE, *(at + up)[1:]])),
            one_hand("left", 9.8, np.array([BEFORE, *(there + up)[1:]])),
            one_hand("left", 11.2, there + up),
            one_hand("left", 12.4, there),
            one_hand("left", 13.4, None, 0.0),
            one_hand("left", 14.4, there + BESIDE),
            one_hand("left", 15.6, np.array([BEFORE, *(there + BESIDE)[1:]])),
            one_hand("left", 16.2),
        ],
    )


def wipe_off(streak: np.ndarray) -> ScriptedPolicy:
    """The left hand rests on the table at one end of a streak, wipes to the other one and back, and rises.

    Args:
        streak: Both ends, x and y in world, shape (2, 2), [m].
    """
    streak = np.asarray(streak, dtype=float)
    way = streak[1] - streak[0]
    far = WIPED_PAST * way / np.linalg.norm(way)
    ends = [np.array([*xy, TABLE_HEIGHT + HAND_HALF]) for xy in (streak[0] - far, streak[1] + far)]
    over, into = np.array([0.0, 0.0, 0.05]), np.array([0.0, 0.0, -WIPE_DEPTH])
    seconds = PUSH_SPEED_PEAK * float(np.linalg.norm(ends[1] - ends[0])) / WIPE_SPEED
    home, begin = stance_pose().p_world_lpalm, 4.2
    times = begin + seconds, begin + 2.0 * seconds
    return waypoint_policy(
        "wipe_off",
        [
            one_hand("left", 1.3, np.array([home[0], ends[0][1], home[2] + 0.04]), 1.0),
            one_hand("left", 2.5, ends[0] + over),
            one_hand("left", 3.7, ends[0] + into),
            one_hand("left", begin),
            one_hand("left", times[0], ends[1] + into),
            one_hand("left", times[1], ends[0] + into),
            one_hand("left", times[1] + 1.0, ends[0] + over),
            one_hand("left", times[1] + 1.5),
        ],
    )


def _palm(p_world_object: np.ndarray) -> np.ndarray:
    """Left palm point that holds something there, (3,) [m]."""
    return np.asarray(p_world_object, dtype=float) - stance_pose().R_world_lhand @ OBJECT_IN_PALM
