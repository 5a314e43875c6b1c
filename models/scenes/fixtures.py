"""Walls, and what is pulled, pressed and turned: bodies that move on a joint with the resistance of the real thing."""

from __future__ import annotations

from collections.abc import Callable

import mujoco

from models.places import (
    BAR,
    BUTTON,
    BUTTON_FORCE,
    BUTTON_TRAVEL,
    DRAWER_FRICTION,
    LEVER,
    LEVER_LENGTH,
    LEVER_RADIUS,
    LEVER_TORQUE,
    LEVER_TURN,
    LOCKED_STIFFNESS,
    WALL_AHEAD,
    WALL_BESIDE,
)

FIXTURE_JOINT = "fixture"
"""Name of the joint of whatever moves: positive is out of the drawer, into the button, down with the lever."""

_WALL = (0.78, 0.77, 0.74, 1.0)
_PAINT = (0.55, 0.60, 0.66, 1.0)
_METAL = (0.35, 0.36, 0.38, 1.0)
_STOP = (0.004, 1.0)  # as stiff as physics steps of 2 ms allow: springs press their bodies against these stops
_DRY = (0.999, 0.999, 0.001, 0.5, 2.0)  # dry friction that does not creep under less force than it has
_FRICTION = (0.6, 0.005, 0.0001)  # plaster, wood and metal on plastic
_BAR_RADIUS, _BAR_HALF, _BOW = 0.012, 0.09, 0.14  # of the bar, and how far it stands out: fingers close behind it [m]
_BOX, _CYLINDER = mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_CYLINDER


def add_wall(mj: mujoco.MjSpec) -> list[float]:
    """A wall across the way, its face 0.45 m ahead of the world origin."""
    _solid(mj.worldbody, "wall", _BOX, (0.05, 1.0, 1.0), (WALL_AHEAD + 0.05, 0.0, 1.0), _WALL)
    return []


def add_corridor(mj: mujoco.MjSpec) -> list[float]:
    """A wall on either side, the faces 0.45 m from the world origin."""
    for side, sign in (("left", 1.0), ("right", -1.0)):
        at = (0.2, sign * (WALL_BESIDE + 0.05), 0.75)
        _solid(mj.worldbody, f"corridor_{side}", _BOX, (0.6, 0.05, 0.75), at, _WALL)
    return []


def add_drawer(mj: mujoco.MjSpec) -> list[float]:
    """A drawer of 3 kg on a chest, held by 30 N of dry friction; its bar pulls it out along -x, 0.35 m at most."""
    front, y, z = BAR[0] + _BOW, BAR[1], BAR[2]
    _solid(mj.worldbody, "chest", _BOX, (0.20, 0.20, 0.5 * (z - 0.12)), (front + 0.22, y, 0.5 * (z - 0.12)), _PAINT)
    drawer = mj.worldbody.add_body(name="drawer", pos=(front, y, z))
    _slide(drawer, (-1.0, 0.0, 0.0), 0.35, frictionloss=DRAWER_FRICTION, damping=[5.0, 0.0, 0.0])
    _solid(drawer, "drawer", _BOX, (0.01, 0.18, 0.11), (0.01, 0.0, 0.0), _PAINT, mass=1.0)
    _solid(drawer, "drawer_tray", _BOX, (0.18, 0.16, 0.09), (0.20, 0.0, 0.0), _PAINT, mass=1.6)
    _bow(drawer)
    return [0.0]


def add_locked(mj: mujoco.MjSpec) -> list[float]:
    """A locked door with an upright bar, which gives in its frame along -x by a spring of 500 N/m."""
    front, y, z = BAR[0] + _BOW, BAR[1], BAR[2]
    _solid(mj.worldbody, "frame", _BOX, (0.03, 0.50, 1.0), (front + 0.08, y, 1.0), _WALL)
    door = mj.worldbody.add_body(name="door", pos=(front, y, z))
    spring = {"stiffness": [LOCKED_STIFFNESS, 0.0, 0.0], "damping": [20.0, 0.0, 0.0]}
    _slide(door, (-1.0, 0.0, 0.0), 0.40, **spring)
    _solid(door, "door", _BOX, (0.02, 0.40, 0.60), (0.02, 0.0, 0.0), _PAINT, mass=3.0)
    _bow(door)
    return [0.0]


def add_door(mj: mujoco.MjSpec) -> list[float]:
    """A door with a lever that a hand presses down: 1 N m of spring when it is level, 2 N m where it unlatches."""
    x, y, _ = LEVER
    _solid(mj.worldbody, "door", _BOX, (0.02, 0.45, 1.0), (x + 0.09, y + 0.35, 1.0), _PAINT)
    lever = mj.worldbody.add_body(name="lever", pos=LEVER, gravcomp=1.0)  # the spring carries its weight
    low, high = LEVER_TORQUE
    stiffness = (high - low) / LEVER_TURN
    joint = lever.add_joint(name=FIXTURE_JOINT, type=mujoco.mjtJoint.mjJNT_HINGE, axis=(-1.0, 0.0, 0.0))
    _stopped(joint, 0.9)
    joint.stiffness, joint.springref, joint.damping = [stiffness, 0.0, 0.0], -low / stiffness, [0.05, 0.0, 0.0]
    half = 0.5 * LEVER_LENGTH
    _solid(lever, "lever", _BOX, (LEVER_RADIUS, half, LEVER_RADIUS), (0.0, half, 0.0), _METAL, mass=0.2)
    _solid(lever, "lever_neck", _BOX, (0.03, 0.01, 0.01), (0.03, 0.0, 0.0), _METAL, mass=0.1)
    return [0.0]


def add_button(mj: mujoco.MjSpec) -> list[float]:
    """A button 60 mm across: a spring of 5 N holds it out, at 20 N and 10 mm it clicks, at 15 mm it ends."""
    x, y, z = BUTTON
    _solid(mj.worldbody, "panel", _BOX, (0.02, 0.06, 0.06), (x + 0.05, y, z), _PAINT)
    _solid(mj.worldbody, "post", _BOX, (0.02, 0.02, 0.5 * z - 0.03), (x + 0.05, y, 0.5 * z - 0.03), _PAINT)
    cap = mj.worldbody.add_body(name="button", pos=BUTTON)
    low, high = BUTTON_FORCE
    stiffness = (high - low) / BUTTON_TRAVEL
    spring = {"stiffness": [stiffness, 0.0, 0.0], "springref": -low / stiffness, "damping": [5.0, 0.0, 0.0]}
    _slide(cap, (1.0, 0.0, 0.0), 0.015, **spring)
    geom = _solid(cap, "button", _CYLINDER, (0.03, 0.0065, 0.0), (0.0065, 0.0, 0.0), (0.8, 0.15, 0.12, 1.0), mass=0.1)
    geom.quat = (0.5**0.5, 0.0, 0.5**0.5, 0.0)  # its axis along x
    return [0.0]


FIXTURES: dict[str, Callable[[mujoco.MjSpec], list[float]]] = {
    "wall": add_wall,
    "corridor": add_corridor,
    "drawer": add_drawer,
    "locked": add_locked,
    "door": add_door,
    "button": add_button,
}
"""Builders by name; each returns the positions of its joints."""


def _solid(
    body: mujoco.MjsBody,
    name: str,
    kind: mujoco.mjtGeom,
    size: tuple[float, float, float],
    pos: tuple[float, float, float],
    rgba: tuple[float, float, float, float],
    **more: float,
) -> mujoco.MjsGeom:
    return body.add_geom(name=name, type=kind, size=size, pos=pos, rgba=rgba, friction=_FRICTION, **more)


def _slide(body: mujoco.MjsBody, axis: tuple[float, float, float], most: float, **resistance: object) -> None:
    """Let a body move along an axis from 0 to ``most`` [m]."""
    joint = body.add_joint(name=FIXTURE_JOINT, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis, **resistance)
    _stopped(joint, most)


def _stopped(joint: mujoco.MjsJoint, most: float) -> None:
    """Let a joint move from 0 to ``most``, where it meets hard stops."""
    joint.range, joint.limited = (0.0, most), mujoco.mjtLimited.mjLIMITED_TRUE
    joint.solref_limit = joint.solref_friction = _STOP
    joint.solimp_friction = _DRY


def _bow(body: mujoco.MjsBody) -> None:
    """An upright bar that stands out of the front of a body towards -x."""
    _solid(body, "bar", _CYLINDER, (_BAR_RADIUS, _BAR_HALF, 0.0), (-_BOW, 0.0, 0.0), _METAL, mass=0.3)
    for name, z in (("bar_top", _BAR_HALF), ("bar_bottom", -_BAR_HALF)):
        size, pos = (0.5 * _BOW, _BAR_RADIUS, 0.006), (-0.5 * _BOW, 0.0, z)
        _solid(body, name, _BOX, size, pos, _METAL, mass=0.05)
