"""Robots by the names that a configuration may give them (`robot.model`)."""

from __future__ import annotations

from collections.abc import Callable

from models.spec import RobotSpec
from models.unitree_g1 import g1

ROBOTS: dict[str, Callable[[], RobotSpec]] = {"g1_dex3": g1, "g1": lambda: g1(hands=False)}
"""Makers of robots by name. A program that has another robot puts it here before it makes a configuration of it."""
