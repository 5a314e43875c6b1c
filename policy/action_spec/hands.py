"""Closing numbers for a Dex3 hand, one of all of it or one a finger of another hand: 0 open, 1 closed.

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
from policy.joints import LEFT_HAND_JOINTS, RIGHT_HAND_JOINTS

Side = Literal["left", "right"]


def grasp_posture(side: Side, closing: np.ndarray | float) -> np.ndarray:
    """Finger joints for a closing number.

    Args:
        side: ``left`` or ``right``.
        closing: 0 open to 1 closed, shape ``(...)``; clipped to that range.

    Returns:
        Shape ``(..., 7)`` in motor order, [rad].
    """
    is_open, closed = _ends(side)
    share = np.clip(np.asarray(closing, dtype=float), 0.0, 1.0)[..., None]
    return is_open + share * (closed - is_open)


def closing_of(side: Side, q_hand: np.ndarray) -> np.ndarray:
    """Closing number nearest to finger joints ``(..., 7)`` [rad], least squares, in [0, 1], shape ``(...)``."""
    is_open, closed = _ends(side)
    span = closed - is_open
    return np.clip((np.asarray(q_hand, dtype=float) - is_open) @ span / (span @ span), 0.0, 1.0)


def fingers_closed(side: Side, fingers: Sequence[str], closings: np.ndarray) -> np.ndarray:
    """Dex3 joints for closing numbers of another hand's fingers.

    Args:
        side: ``left`` or ``right``.
        fingers: Of `policy.action_spec.slot.FOREIGN_HANDS`, in the order of the numbers.
        closings: 0 open to 1 closed, shape ``(..., len(fingers))``; clipped to that range.

    Returns:
        Shape ``(..., 7)`` in motor order, [rad].
    """
    is_open, closed = _ends(side)
    share = np.clip(np.asarray(closings, dtype=float), 0.0, 1.0)
    each = np.empty((*share.shape[:-1], len(is_open)))
    for joints, sources in _places(side, tuple(fingers)).values():
        each[..., joints] = share[..., sources].mean(axis=-1, keepdims=True)
    return is_open + each * (closed - is_open)


def finger_closings(side: Side, fingers: Sequence[str], q_hand: np.ndarray) -> np.ndarray:
    """Closing numbers of another hand's fingers that are nearest to Dex3 joints.

    Args:
        side: ``left`` or ``right``.
        fingers: Of `policy.action_spec.slot.FOREIGN_HANDS`, in the order of the numbers.
        q_hand: Dex3 joints in motor order, shape ``(..., 7)``, [rad].

    Returns:
        Shape ``(..., len(fingers))``, in [0, 1]. Fingers that share a Dex3 finger have the same number; what
        turns a thumb sideways has 0.
    """
    is_open, closed = _ends(side)
    q = np.asarray(q_hand, dtype=float)
    closings = np.zeros((*q.shape[:-1], len(fingers)))
    for joints, sources in _places(side, tuple(fingers)).values():
        span = (closed - is_open)[joints]
        share = np.clip((q - is_open)[..., joints] @ span / (span @ span), 0.0, 1.0)
        closings[..., sources] = share[..., None]
    return closings


@lru_cache(maxsize=8)
def _places(side: Side, fingers: tuple[str, ...]) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Joints of each Dex3 finger, and the numbers of another hand that close it."""
    names = LEFT_HAND_JOINTS if side == "left" else RIGHT_HAND_JOINTS
    drives = {"thumb": ("thumb", "thumb_bend"), "index": ("index",), "middle": ("middle", "ring", "pinky")}
    return {
        finger: (
            np.array([i for i, name in enumerate(names) if f"_{finger}_" in name]),
            np.array([i for i, name in enumerate(fingers) if name in sources]),
        )
        for finger, sources in drives.items()
    }


@lru_cache(maxsize=2)
def finger_range(side: Side) -> tuple[np.ndarray, np.ndarray]:
    """Least and largest angle of each finger joint in motor order, two of shape (7,), [rad]."""
    spec = g1()
    where = spec.indices(LEFT_HAND_JOINTS if side == "left" else RIGHT_HAND_JOINTS)
    return spec.position_min[where], spec.position_max[where]


@lru_cache(maxsize=2)
def _ends(side: Side) -> tuple[np.ndarray, np.ndarray]:
    spec = g1()
    where = slice(0, 7) if side == "left" else slice(7, 14)
    return np.array(spec.hand_open[where]), np.array(spec.hand_closed[where])
