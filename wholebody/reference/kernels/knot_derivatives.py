"""Derivatives at the knots of a C2 cubic spline: one tridiagonal system in the slopes, the same for all channels.

Source:
    de Boor 2001, "A Practical Guide to Splines", chapter IV (slopes); Fritsch and Butland 1984 (harmonic mean).
"""

from __future__ import annotations

import numpy as np

from wholebody.jit.arrays import Matrix, Vector


def knot_derivatives(
    times: Vector, y: Matrix, limited: np.ndarray, slopes: Matrix, curvature: Matrix, upper: Vector
) -> None:
    """Fill slopes and second derivatives (H, C) at two knots or more; no pivots are needed.

    Args:
        times: Increasing (H,).
        y: Values (H, C).
        limited: Knots that take a monotone slope and no curvature instead (H,).
        slopes: Out (H, C).
        curvature: Out (H, C).
        upper: Scratch (H,).
    """
    last = times.shape[0] - 1
    for k in range(last + 1):
        below, diagonal, above = spline_row(times, limited, k)
        if k > 0:
            diagonal -= below * upper[k - 1]
        upper[k] = above / diagonal
        for c in range(y.shape[1]):
            right = right_side(times, y, limited, k, c)
            if k > 0:
                right -= below * slopes[k - 1, c]
            slopes[k, c] = right / diagonal
    for k in range(last - 1, -1, -1):
        for c in range(y.shape[1]):
            slopes[k, c] -= upper[k] * slopes[k + 1, c]
    for k in range(last + 1):
        # The last knot has the curvature at the end of the segment before it, seen backwards.
        to = k + 1 if k < last else k - 1
        h = times[to] - times[k]
        for c in range(y.shape[1]):
            bend = (6.0 * (y[to, c] - y[k, c]) / h - 4.0 * slopes[k, c] - 2.0 * slopes[to, c]) / h
            curvature[k, c] = 0.0 if limited[k] else bend


def spline_row(times: Vector, limited: np.ndarray, k: int) -> tuple[float, float, float]:
    """Row of the system: C2 at inner knots, not-a-knot at the ends where there are four knots."""
    last = times.shape[0] - 1
    end = k in (0, last)
    if limited[k] or (end and last < 3):
        return 0.0, 1.0, 0.0
    if end:
        a, b = end_steps(times, k)
        return (0.0, b, a + b) if k == 0 else (a + b, b, 0.0)
    before, after = times[k] - times[k - 1], times[k + 1] - times[k]
    return after, 2.0 * (before + after), before


def right_side(times: Vector, y: Matrix, limited: np.ndarray, k: int, c: int) -> float:
    """Right side of the system at knot ``k``, for channel ``c`` of y (H, C)."""
    last = times.shape[0] - 1
    if k in (0, last):
        return 0.0 if limited[k] else end_side(times, y, k, c)
    before, after = secant(times, y, k - 1, c), secant(times, y, k, c)
    if limited[k]:
        return 2.0 * before * after / (before + after) if before * after > 0.0 else 0.0
    return 3.0 * ((times[k + 1] - times[k]) * before + (times[k] - times[k - 1]) * after)


def end_side(times: Vector, y: Matrix, k: int, c: int) -> float:
    """Derivative at the first or the last knot; of few knots that of the line or the parabola through them."""
    last, near = times.shape[0] - 1, 0 if k == 0 else times.shape[0] - 2
    first = secant(times, y, near, c)
    if last == 1:
        return first
    second = secant(times, y, 1 if k == 0 else near - 1, c)
    a, b = end_steps(times, k)
    if last == 2:
        return first + a * (first - second) / (a + b)
    return ((a + 2.0 * (a + b)) * b * first + a * a * second) / (a + b)


def end_steps(times: Vector, k: int) -> tuple[float, float]:
    """Lengths of the segment at the first or the last knot, and of the next one."""
    if k == 0:
        return times[1] - times[0], times[2] - times[1]
    return times[k] - times[k - 1], times[k - 1] - times[k - 2]


def secant(times: Vector, y: Matrix, k: int, c: int) -> float:
    """Slope of the line from knot ``k`` to the next, of channel ``c`` of y (H, C)."""
    return (y[k + 1, c] - y[k, c]) / (times[k + 1] - times[k])
