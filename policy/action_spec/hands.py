"""Closing numbers for a hand, one of all of it or one a finger of another hand: 0 open, 1 closed.

A finger of another hand closes the joints of the Dex3 finger in its place, along the same straight line from open to
closed: ring and pinky close the middle finger with the middle one, by their mean. What turns a thumb sideways has no
place in this, and the difference between middle, ring and pinky is lost.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Literal

import numpy as np

from models import g1
from models.spec import RobotSpec
from policy.errors import SpecError
from policy.joints import joints_of

Side = Literal["left", "right"]
SIDES: tuple[Side, Side] = ("left", "right")


def grasp_posture(side: Side, closing: np.ndarray | float, robot: RobotSpec | None = None) -> np.ndarray:
    """Finger joints for a closing number.

    Args:
        side: ``left`` or ``right``.
        closing: 0 open to 1 closed, shape ``(...)``; clipped to that range.
        robot: Whose hand; the G1's with Dex3 hands if None.

    Returns:
        Shape ``(..., m)`` in motor order, [rad]; m is 7 of a Dex3 hand.
    """
    is_open, closed = _ends(robot or g1(), side)
    share = np.clip(np.asarray(closing, dtype=float), 0.0, 1.0)[..., None]
    return is_open + share * (closed - is_open)


def closing_of(side: Side, q_hand: np.ndarray, robot: RobotSpec | None = None) -> np.ndarray:
    """Closing number nearest to finger joints ``(..., m)`` [rad], least squares, in [0, 1], shape ``(...)``.

    It is 0 of a hand that has no fingers.
    """
    is_open, closed = _ends(robot or g1(), side)
    span = closed - is_open
    size = float(span @ span) or 1.0
    return np.clip((np.asarray(q_hand, dtype=float) - is_open) @ span / size, 0.0, 1.0)


def fingers_closed(
    side: Side, fingers: Sequence[str], closings: np.ndarray, robot: RobotSpec | None = None
) -> np.ndarray:
    """Finger joints for closing numbers of another hand's fingers.

    Args:
        side: ``left`` or ``right``.
        fingers: Of `policy.action_spec.slot.FOREIGN_HANDS`, in the order of the numbers.
        closings: 0 open to 1 closed, shape ``(..., len(fingers))``; clipped to that range.
        robot: Whose hand; the G1's with Dex3 hands if None.

    Returns:
        Shape ``(..., m)`` in motor order, [rad].
    """
    robot = robot or g1()
    is_open, closed = _ends(robot, side)
    share = np.clip(np.asarray(closings, dtype=float), 0.0, 1.0)
    each = np.empty((*share.shape[:-1], len(is_open)))
    for joints, sources in _places(robot, side, tuple(fingers)).values():
        each[..., joints] = share[..., sources].mean(axis=-1, keepdims=True)
    return is_open + each * (closed - is_open)


def finger_closings(
    side: Side, fingers: Sequence[str], q_hand: np.ndarray, robot: RobotSpec | None = None
) -> np.ndarray:
    """Closing numbers of another hand's fingers that are nearest to finger joints.

    Args:
        side: ``left`` or ``right``.
        fingers: Of `policy.action_spec.slot.FOREIGN_HANDS`, in the order of the numbers.
        q_hand: Finger joints in motor order, shape ``(..., m)``, [rad].
        robot: Whose hand; the G1's with Dex3 hands if None.

    Returns:
        Shape ``(..., len(fingers))``, in [0, 1]. Fingers that share a Dex3 finger have the same number; what
        turns a thumb sideways has 0.
    """
    robot = robot or g1()
    is_open, closed = _ends(robot, side)
    q = np.asarray(q_hand, dtype=float)
    closings = np.zeros((*q.shape[:-1], len(fingers)))
    for joints, sources in _places(robot, side, tuple(fingers)).values():
        span = (closed - is_open)[joints]
        share = np.clip((q - is_open)[..., joints] @ span / (span @ span), 0.0, 1.0)
        closings[..., sources] = share[..., None]
    return closings


@lru_cache(maxsize=32)
def _places(robot: RobotSpec, side: Side, fingers: tuple[str, ...]) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Joints of each finger, and the numbers of another hand that close it; a gripper is closed by all of them."""
    names = joints_of(robot, f"{side}_hand")
    if not any("_thumb_" in name for name in names):
        return {"all": (np.arange(len(names)), np.arange(len(fingers)))} if names else {}
    drives = {"thumb": ("thumb", "thumb_bend"), "index": ("index",), "middle": ("middle", "ring", "pinky")}
    return {
        finger: (
            np.array([i for i, name in enumerate(names) if f"_{finger}_" in name]),
            np.array([i for i, name in enumerate(fingers) if name in sources]),
        )
        for finger, sources in drives.items()
    }


@lru_cache(maxsize=16)
def finger_range(side: Side, robot: RobotSpec) -> tuple[np.ndarray, np.ndarray]:
    """Least and largest angle of each finger joint of a robot in motor order, two of shape (m,), [rad]."""
    where = robot.indices(robot.tool(side).finger_joints)
    return robot.position_min[where], robot.position_max[where]


@lru_cache(maxsize=16)
def _ends(robot: RobotSpec, side: Side) -> tuple[np.ndarray, np.ndarray]:
    """Fingers of an open and of a closed hand.

    Raises:
        SpecError: If the robot has fingers but does not say how they are open and closed.
    """
    hand = 0 if side == "left" else 1
    if len(robot.hand_open) != sum(robot.fingers) or len(robot.hand_closed) != sum(robot.fingers):
        raise SpecError(f"robot '{robot.name}' has no hand_open and hand_closed: one number cannot close its fingers")
    return robot.by_hand(robot.hand_open)[hand], robot.by_hand(robot.hand_closed)[hand]
