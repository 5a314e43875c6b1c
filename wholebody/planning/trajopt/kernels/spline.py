"""The curve of a plan, whose control points the knots are; compiles with numba as it stands.

It is a cubic B-spline: at a knot its acceleration is the second difference of the control points, and changes linearly
from there to the next. It begins at a given place with a given velocity, which takes the first control point away.
"""

from __future__ import annotations

from wholebody.planning.trajopt.layout import FIRST


def pace(k, K, dt):
    """What a difference between knots k - 1 and k counts in the velocity between them."""
    if k in (0, K):
        return 0.0
    return FIRST / dt if k == 1 else 1.0 / dt
