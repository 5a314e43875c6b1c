"""The cubic B-spline of a plan, whose control points the knots are.

At a knot its acceleration is the second difference of the control points, and changes linearly from there to the next.
It begins at a given position with a given velocity, from which the first control point follows (`FIRST_RATE`).
"""

from __future__ import annotations

from wholebody.planning.trajopt.layout import FIRST_RATE


def knot_rate(k, K, dt) -> float:
    """Factor of the difference between knots k - 1 and k in the velocity between them [1/s]; 0 at both ends."""
    if k in (0, K):
        return 0.0
    return FIRST_RATE / dt if k == 1 else 1.0 / dt
