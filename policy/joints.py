"""Joints that chunks and observations carry, by the part of the robot that they move.

Motor order of the G1 is Unitree's: G1 DDS for the body, Dex3 DDS for the hands. The right Dex3 hand lists its index
finger before its middle finger, the left one after it, so hands are always mapped by name (`permutation`).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from models import g1
from models.spec import RobotSpec
from policy.errors import SpecError

PARTS = ("left_leg", "right_leg", "waist", "left_arm", "right_arm", "left_hand", "right_hand")
"""Parts of a robot whose joints a layout can have."""


def joints_of(robot: RobotSpec, part: str) -> tuple[str, ...]:
    """Names of the joints of one of `PARTS` in motor order; none if the robot lacks it."""
    side, _, what = part.partition("_")
    if what == "hand":
        return robot.tool(side).finger_joints
    return tuple(robot.joint_names[i] for i in robot.limbs[part])


def layout_robot(robot: RobotSpec) -> RobotSpec:
    """The robot whose layouts drive a robot: itself, or the G1 with Dex3 hands for one with rubber hands.

    What those ask of fingers is then left out.
    """
    dex3 = g1()
    return dex3 if not sum(robot.fingers) and robot.body_joints == dex3.body_joints else robot


def permutation(source: Sequence[str], target: Sequence[str]) -> np.ndarray:
    """Indices such that ``x_target = x_source[indices]``, matched by joint name; read-only.

    Raises:
        SpecError: If a target joint is missing from the source, or a name occurs twice.
    """
    return _permutation(tuple(source), tuple(target))


@lru_cache(maxsize=256)
def _permutation(source: tuple[str, ...], target: tuple[str, ...]) -> np.ndarray:
    if len(set(source)) != len(source):
        raise SpecError(f"a joint name occurs twice in {list(source)}")
    missing = [name for name in target if name not in source]
    if missing:
        raise SpecError(f"joints {missing} are missing; there are {list(source)}")
    indices = np.array([source.index(name) for name in target], dtype=int)
    indices.flags.writeable = False
    return indices
