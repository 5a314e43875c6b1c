"""Robots by the names that a configuration may give them (`robot.model`)."""

from __future__ import annotations

from collections.abc import Callable, Collection
from itertools import product

from models.members import RobotSpecError
from models.spec import RobotSpec
from models.unitree_g1 import LOCKED, g1

ROBOTS: dict[str, Callable[[], RobotSpec]] = {"g1_dex3": g1, "g1": lambda: g1(hands=False)}
"""Makers of robots by name. A program that has another robot puts it here before it makes a configuration of it."""


def robot_with(joints: Collection[str]) -> RobotSpec:
    """The robot that has these joints and no others, of `ROBOTS` and the G1s that lack some.

    Raises:
        RobotSpecError: If there is none.
    """
    lacking = (g1(hands, locked=locked) for hands, locked in product((True, False), LOCKED.values()))
    for robot in (*(make() for make in ROBOTS.values()), *lacking):
        if set(robot.joint_names) == set(joints):
            return robot
    raise RobotSpecError(
        f"no known robot has these {len(joints)} joints, '{min(joints, default='')}' among them; known are the G1s and "
        f"{', '.join(ROBOTS)}: put the one that is meant into `models.robots.ROBOTS`"
    )
