"""Who is on stage: robots by their `id`, for teleoperators of the same process, which LeRobot tells nothing."""

from __future__ import annotations

from typing import TYPE_CHECKING
from weakref import WeakValueDictionary

if TYPE_CHECKING:
    from lerobot.robots import Robot

_robots: WeakValueDictionary[str | None, Robot] = WeakValueDictionary()


def enter(robot: Robot) -> None:
    """Let a robot be found.

    Raises:
        ValueError: If another one of that `id` is connected.
    """
    other = _robots.get(robot.id)
    if other is not None and other is not robot and other.is_connected:
        raise ValueError(f"a robot with --robot.id={robot.id} is connected already: give the other one another id")
    _robots[robot.id] = robot


def find(robot_id: str | None) -> Robot:
    """The connected robot of that `id`, or the only one.

    Raises:
        ConnectionError: If there is none, or there are several.
    """
    there = [robot for robot in _robots.values() if robot.is_connected]
    found = there if robot_id is None else [robot for robot in there if robot.id == robot_id]
    if len(found) != 1:
        ids = ", ".join(str(robot.id) for robot in there) or "none"
        raise ConnectionError(
            f"the expert drives a connected robot of type wholebody_g1 in its own process; connected: {ids}. "
            "Use --robot.type=wholebody_g1, and --teleop.robot_id where there are several"
        )
    return found[0]
