"""The friction pyramid of a contact point: the one that contacts, program and its judgement share.

It is inscribed in the cone: a force with ``|f_x| <= slope f_z`` and ``|f_y| <= slope f_z`` for ``slope = friction /
sqrt(2)`` is inside the cone of that friction wherever it points.
"""

from __future__ import annotations

import math

PYRAMID_SIDES = ((1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0))
"""Directions of its sides in the floor plane [no unit]; definition."""


def pyramid_slope(friction: float) -> float:
    """Largest tangential force along x or y for a unit of normal force."""
    return friction / math.sqrt(2.0)


def beyond_side(side: int, slope: float, x: float, y: float, z: float) -> float:
    """How far a force (x, y, z) is beyond a side of the pyramid [N]; negative inside."""
    return PYRAMID_SIDES[side][0] * x + PYRAMID_SIDES[side][1] * y - slope * z
