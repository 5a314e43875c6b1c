"""A single closing number for a Dex3 hand: 0 open, 1 closed."""

from __future__ import annotations

from functools import lru_cache
from typing import Literal

import numpy as np

from models.g1 import g1

Side = Literal["left", "right"]

_SHARE_CLOSED = {"thumb_1": 0.7, "thumb_2": 0.7, "middle_0": 0.8, "middle_1": 0.8, "index_0": 0.8, "index_1": 0.8}
"""Of the way to the joint limit in the closing direction: stops before the fingers run into the palm."""
_THUMB_OPEN = 0.5
"""Of the way to the other limit: the thumb swings clear of the palm. Fingers are straight at 0."""


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
def _ends(side: Side) -> tuple[np.ndarray, np.ndarray]:
    spec = g1()
    is_open, closed = np.zeros(7), np.zeros(7)
    for i, name in enumerate(spec.tool(side).finger_joints):
        joint = spec.joints[spec.index(name)]
        key = name.removeprefix(f"{side}_hand_").removesuffix("_joint")
        bounds = [joint.position_min, joint.position_max]
        # Left thumb joints close towards their upper bound, left fingers towards their lower one; right mirrored.
        closes_up = key.startswith("thumb") == (side == "left")
        if key in _SHARE_CLOSED:
            closed[i] = _SHARE_CLOSED[key] * bounds[closes_up]
        if key == "thumb_1":
            is_open[i] = _THUMB_OPEN * bounds[not closes_up]
    return is_open, closed
