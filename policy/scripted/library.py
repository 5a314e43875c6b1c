"""The scripted policies, each a palm motion in world that begins at the stance."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np

from models import g1
from models.places import ON_TABLE
from models.spec import RobotSpec
from policy.action_spec.hands import SIDES, Side, grasp_posture
from policy.errors import PolicyError, did_you_mean
from policy.geometry.rotations import rpy_to_matrix
from policy.scripted.contact import lift_box, press, pull_drawer, touch, turn_handle, wipe
from policy.scripted.policy import ScriptedMotion, ScriptedPolicy, minimum_jerk, stance_pose
from policy.scripted.waypoints import Waypoint, one_hand, waypoint_policy

MIRROR_Y = np.array([1.0, -1.0, 1.0])

LISSAJOUS_CENTRE = np.array([0.24, 0.21, 0.86])
LISSAJOUS_AMPLITUDE = 0.15
LISSAJOUS_RATES = np.array([2.0, 4.0, 6.0])
"""Angular rates of x, y and z [rad/s]: 1.1 m/s and 5.8 m/s^2 at the peak."""
LISSAJOUS_START, LISSAJOUS_SCORED, LISSAJOUS_END = 2.0, 20.0, 2.0
"""Blending in from the stance, the curve itself, coming to rest at the centre [s]."""
LISSAJOUS_TURN = np.deg2rad([9.0, -27.0, -35.0])
"""Constant orientation of the left hand as roll, pitch and yaw [rad]; right: mirrored. Where the palms come to
y = ±60 mm in front of the trunk, hands that point inwards leave room for the forearms; found by a search over
orientations for what the planner can follow."""
LISSAJOUS_THUMB = np.array([-0.63, -0.58, 0.0])
"""Left thumb clear of the closed fingers and of the trunk; the fist ends 52 mm inwards of its palm point [rad]."""

OBJECT_IN_PALM = np.array([-0.025, -0.055, 0.0])
"""Centre of a 60 mm cylinder in the pocket between thumb, palm and fingers of the left hand, from the palm point in
hand axes [m]; right: mirrored in y. Found by closing the hand on it in MuJoCo."""


def lissajous(*, scored: float = LISSAJOUS_SCORED, robot: RobotSpec | None = None) -> ScriptedPolicy:
    """Both palms on a Lissajous curve, orientation and fingers constant.

    The left palm is at ``[0.24, 0.21, 0.86] + 0.15 [sin 2t, sin 4t, sin 6t]``, t being episode time, from 2 s on; the
    right one is mirrored in y. Before, it is blended in from the stance; after ``scored`` seconds it comes to rest.

    Args:
        scored: Time on the curve [s].
        robot: Whose hands; the G1's with Dex3 hands if None.
    """
    robot = robot or g1()
    stance = stance_pose(robot)
    end = LISSAJOUS_START + scored
    fingers = [grasp_posture(side, 1.0, robot) for side in SIDES]
    if robot.fingers == g1().fingers:
        # The thumb's first joint turns the same way on both sides, the others are mirrored.
        fingers[0][:3], fingers[1][:3] = LISSAJOUS_THUMB, LISSAJOUS_THUMB * [1.0, -1.0, -1.0]

    def script(t: np.ndarray) -> ScriptedMotion:
        fade = 1.0 - minimum_jerk((t - end) / LISSAJOUS_END)
        swing = LISSAJOUS_AMPLITUDE * fade[:, None] * np.sin(LISSAJOUS_RATES * t[:, None])
        curve = LISSAJOUS_CENTRE + swing
        share = minimum_jerk(t / LISSAJOUS_START)[:, None]
        turns = [rpy_to_matrix(share * LISSAJOUS_TURN * mirror) for mirror in ([1.0, 1.0, 1.0], [-1.0, 1.0, -1.0])]
        return ScriptedMotion(
            stance.p_world_lpalm + share * (curve - stance.p_world_lpalm),
            stance.p_world_rpalm + share * (curve * MIRROR_Y - stance.p_world_rpalm),
            stance.R_world_lhand @ turns[0],
            stance.R_world_rhand @ turns[1],
            stance.q_lhand + share * (fingers[0] - stance.q_lhand),
            stance.q_rhand + share * (fingers[1] - stance.q_rhand),
        )

    return ScriptedPolicy("lissajous", script, end + LISSAJOUS_END, robot=robot)


def reach(x: float = 0.45, z: float = 0.60, *, y: float = 0.16, robot: RobotSpec | None = None) -> ScriptedPolicy:
    """Both palms to (x, ±y, z): 3 s minimum-jerk from the stance, 4 s hold, orientation of the stance, but free.

    Args:
        x: Ahead of the sole midpoint [m].
        z: Above the floor [m].
        y: To either side [m].
        robot: Whose hands; the G1's with Dex3 hands if None.
    """
    left = np.array([x, y, z])
    points = [Waypoint(3.0, left, left * MIRROR_Y), Waypoint(7.0)]
    return waypoint_policy("reach", points, orientation_free=True, robot=robot)


def walk_reach(
    x: float = 0.90, z: float = 0.75, *, y: float = 0.16, aside: float = 0.0, robot: RobotSpec | None = None
) -> ScriptedPolicy:
    """Both palms out of reach, to (x, aside ± y, z), within 1.5 s by the script, which then waits: one who may walks.

    Args:
        x: Ahead of the sole midpoint [m].
        z: Above the floor [m].
        y: To either side of the middle of both [m].
        aside: That middle, to the left [m].
        robot: Whose hands; the G1's with Dex3 hands if None.
    """
    left, right = np.array([x, aside + y, z]), np.array([x, aside - y, z])
    return waypoint_policy("walk_reach", [Waypoint(1.5, left, right), Waypoint(12.0)], robot=robot)


def two_hand_lift(
    *, x: float = 0.35, z: float = 0.75, width: float = 0.30, lift: float = 0.25, robot: RobotSpec | None = None
) -> ScriptedPolicy:
    """Both palms close on a box from the sides, lift it, put it back and let go.

    Args:
        x: Middle of the box ahead of the sole midpoint [m].
        z: Height of the palms on the box [m].
        width: Distance of the palm points when they touch the box [m].
        lift: How far up [m].
        robot: Whose hands; the G1's with Dex3 hands if None.
    """

    def both(half_width: float, height: float) -> tuple[np.ndarray, np.ndarray]:
        left = np.array([x, half_width, height])
        return left, left * MIRROR_Y

    apart, touching = 0.5 * width + 0.06, 0.5 * width
    return waypoint_policy(
        "two_hand_lift",
        [
            Waypoint(2.5, *both(apart, z)),
            Waypoint(3.5, *both(touching, z)),
            Waypoint(5.5, *both(touching, z + lift)),
            Waypoint(7.5),
            Waypoint(9.5, *both(touching, z)),
            Waypoint(10.5, *both(apart, z)),
            Waypoint(13.0, *_home(robot)),
        ],
        robot=robot,
    )


def pick(
    level: Literal["low", "high"] = "low", *, side: Side = "right", robot: RobotSpec | None = None
) -> ScriptedPolicy:
    """One hand fetches something from knee height or from above the head; the other stays.

    Args:
        level: ``low`` is palm height 0.40 m, ``high`` is 1.40 m, orientation free: well inside the measured reach of
            0.10 to 1.50 m.
        side: Which hand.
        robot: Whose hands; the G1's with Dex3 hands if None.
    """
    if level not in ("low", "high"):
        raise PolicyError(f"pick level {level!r} is unknown; it is 'low' or 'high'")
    sign = 1.0 if side == "left" else -1.0
    there = np.array([0.40, 0.16 * sign, 0.40]) if level == "low" else np.array([0.35, 0.20 * sign, 1.40])
    before = there + (np.array([0.0, 0.0, 0.10]) if level == "low" else np.array([-0.10, 0.0, 0.0]))
    return waypoint_policy(
        f"pick_{level}",
        [
            one_hand(side, 2.5, before, 0.0),
            one_hand(side, 3.5, there, 0.0),
            one_hand(side, 4.5, None, 1.0),
            one_hand(side, 5.5, before, 1.0),
            one_hand(side, 8.0, _home(robot)[side == "right"], 1.0),
            one_hand(side, 9.0, None, 1.0),
        ],
        orientation_free=level == "high",
        robot=robot,
    )


def wave(*, side: Side = "right", swings: int = 4, robot: RobotSpec | None = None) -> ScriptedPolicy:
    """One hand goes up, fingers upwards, and swings from side to side at 1 Hz.

    Args:
        side: Which hand.
        swings: Number of full swings.
        robot: Whose hands; the G1's with Dex3 hands if None.
    """
    sign = 1.0 if side == "left" else -1.0
    middle, swing = np.array([0.25, 0.28 * sign, 1.20]), np.array([0.0, 0.08, 0.0])
    # 60 degrees of pitch: with 90 the elbow would have to leave its range.
    turn = np.array([0.0, -np.pi / 3.0, 0.0])
    points = [one_hand(side, 2.5, middle, turn=turn)]
    points += [one_hand(side, 3.0 + 0.5 * i, middle + swing * (-1.0) ** i) for i in range(2 * swings)]
    end = points[-1].time
    points.append(one_hand(side, end + 2.5, _home(robot)[side == "right"], turn=np.zeros(3)))
    return waypoint_policy("wave", points, robot=robot)


def grasp(
    p_world_object: tuple[float, float, float] = (0.42, 0.15, 0.83),
    *,
    side: Side = "left",
    lift: float = 0.10,
    around: bool = False,
    p_palm_object: np.ndarray = OBJECT_IN_PALM,
    robot: RobotSpec | None = None,
) -> ScriptedPolicy:
    """One hand closes on an upright cylinder from its side, lifts it and holds it for 5 s.

    Args:
        p_world_object: Axis of the cylinder at the height to grasp it [m]; the default is the middle of
            the object of the scene ``table_cylinder``.
        side: Which hand.
        lift: How far up [m].
        around: Whether the hand goes aside before it goes ahead, for an object that is in its way.
        p_palm_object: Object centre from the left palm point in hand axes, (3,), [m]; mirrored for the right hand.
        robot: Whose hands; the G1's with Dex3 hands if None.
    """
    stance = stance_pose(robot)
    R = stance.R_world_lhand if side == "left" else stance.R_world_rhand
    offset = np.asarray(p_palm_object) * (1.0 if side == "left" else MIRROR_Y)
    at_object = np.asarray(p_world_object, dtype=float) - R @ offset
    # Against the object's direction seen from the palm: the open hand moves in sideways.
    aside = at_object - R @ np.array([0.0, 0.12 * np.sign(offset[1]), 0.0])
    up = np.array([0.0, 0.0, lift])
    home = _home(robot)[side == "right"]
    return waypoint_policy(
        "grasp",
        [
            *([one_hand(side, 1.3, np.array([home[0], aside[1], home[2]]), 0.0)] if around else []),
            one_hand(side, 2.5, aside, 0.0),
            one_hand(side, 4.5, at_object, 0.0),
            one_hand(side, 6.0, None, 1.0),
            one_hand(side, 8.0, at_object + up, 1.0),
            one_hand(side, 13.0, None, 1.0),
        ],
        robot=robot,
    )


def hand_over(*, mass: float = 1.0, side: Side = "left", robot: RobotSpec | None = None) -> ScriptedPolicy:
    """One hand takes the flask from the table, holds it out, and puts it back.

    Args:
        mass: Expected of the flask [kg].
        side: Which hand.
        robot: Whose hands; the G1's with Dex3 hands if None.
    """
    sign = 1.0 if side == "left" else -1.0
    at = np.array(ON_TABLE) * [1.0, sign, 1.0] + [0.0, 0.0, 0.08] - OBJECT_IN_PALM * [1.0, sign, 1.0]
    aside, up, out = np.array([0.0, 0.12 * sign, 0.0]), np.array([0.0, 0.0, 0.12]), np.array([0.03, 0.05 * sign, 0.20])
    weight = np.array([0.0, 0.0, -9.81 * mass])
    return waypoint_policy(
        "hand_over",
        [
            one_hand(side, 2.5, at + aside, 0.0),
            one_hand(side, 4.5, at),
            one_hand(side, 6.0, None, 1.0),
            one_hand(side, 7.5, at + up, force=weight),
            one_hand(side, 9.0, at + out),
            one_hand(side, 12.0, None),
            one_hand(side, 13.5, at + up),
            one_hand(side, 15.5, at, force=np.zeros(3)),
            one_hand(side, 17.0, None, 0.0),
            one_hand(side, 18.5, at + aside),
            one_hand(side, 19.5, None),
        ],
        robot=robot,
    )


def _home(robot: RobotSpec | None) -> tuple[np.ndarray, np.ndarray]:
    stance = stance_pose(robot)
    return stance.p_world_lpalm, stance.p_world_rpalm


SCRIPTS: dict[str, Callable[..., ScriptedPolicy]] = {
    "lissajous": lissajous,
    "reach": reach,
    "walk_reach": walk_reach,
    "two_hand_lift": two_hand_lift,
    "pick_low": lambda **settings: pick("low", **settings),
    "pick_high": lambda **settings: pick("high", **settings),
    "wave": wave,
    "grasp": grasp,
    "touch": touch,
    "wipe": wipe,
    "press": press,
    "pull_drawer": pull_drawer,
    "turn_handle": turn_handle,
    "lift_box": lift_box,
    "hand_over": hand_over,
}
"""Scripted policies by the name that the CLI takes."""
FURNITURE = ("touch", "wipe", "press", "pull_drawer", "turn_handle", "lift_box")
"""Scripts that are made for the hands of the G1 with Dex3 hands and the furniture of `models.scenes`."""


def scripts_of(robot: RobotSpec | None = None) -> tuple[str, ...]:
    """Names of the scripts that a robot has, the G1 with Dex3 hands if not given."""
    return tuple(name for name in SCRIPTS if robot in (None, g1()) or name not in FURNITURE)


def scripted_policy(name: str, robot: RobotSpec | None = None, **settings: object) -> ScriptedPolicy:
    """A scripted policy of a robot, the G1 with Dex3 hands if not given, by name.

    Raises:
        PolicyError: If there is none of that name, or a setting is unknown.
    """
    if name not in SCRIPTS:
        raise PolicyError(f"no script is called '{name}'; {did_you_mean(name, SCRIPTS)}there are: {', '.join(SCRIPTS)}")
    if robot is not None and name not in scripts_of(robot):
        raise PolicyError(f"script '{name}' is made for the G1 with Dex3 hands; of {robot.name}: {scripts_of(robot)}")
    if robot not in (None, g1()):
        settings["robot"] = robot
    try:
        return SCRIPTS[name](**settings)
    except TypeError as error:
        raise PolicyError(f"script '{name}' does not take these settings: {error}") from error
