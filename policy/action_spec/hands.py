"""A single closing number for a Dex3 hand: 0 open, 1 closed."""

from __future__ import annotations

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
