"""Uniform cubic B-splines."""

from __future__ import annotations

import numpy as np

_BASIS = np.array([[1.0, 4.0, 1.0, 0.0], [-3.0, 0.0, 3.0, 0.0], [3.0, -6.0, 3.0, 0.0], [-1.0, 3.0, -3.0, 1.0]]) / 6.0
"""Powers of the share of an interval (rows) by the four control points around it (columns)."""


class CubicBSpline:
    """The C2 piecewise cubic with given control points; its second derivative at a knot is their second difference.

    Args:
        start: Parameter of the second control point, where the curve begins.
        step: Between two knots.
        points: Control points, shape (n, C), n at least 4; the curve ends at the last but one.

    Attributes:
        start, step: As given.
        coefficients: Of the powers of the share of an interval, shape (4, n - 3, C).
    """

    def __init__(self, start: float, step: float, points: np.ndarray) -> None:
        self.start, self.step = start, step
        around = np.stack([points[i : len(points) - 3 + i] for i in range(4)])
        self.coefficients = np.einsum("pi,inc->pnc", _BASIS, around)

    def __call__(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Value, first and second derivative at parameters (m,), shape (m, C) each."""
        s = (x - self.start) / self.step
        i = np.clip(s.astype(int), 0, self.coefficients.shape[1] - 1)
        u = (s - i)[:, None]
        c0, c1, c2, c3 = (c[i] for c in self.coefficients)
        value = c0 + u * (c1 + u * (c2 + u * c3))
        first = (c1 + u * (2.0 * c2 + 3.0 * u * c3)) / self.step
        return value, first, (2.0 * c2 + 6.0 * u * c3) / self.step**2
