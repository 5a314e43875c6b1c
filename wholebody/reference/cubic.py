"""Cubic splines with given slopes at their ends."""

from __future__ import annotations

import numpy as np


class ClampedCubic:
    """The C2 piecewise cubic through knots that begins and ends with given slopes.

    Args:
        x: Increasing parameters, shape (K,), K at least 2.
        y: Values, shape (K, C).
        first, last: Slopes at the ends, shape (C,).
    """

    def __init__(self, x: np.ndarray, y: np.ndarray, first: np.ndarray, last: np.ndarray) -> None:
        h, n = np.diff(x), len(x)
        secant = np.diff(y, axis=0) / h[:, None]
        A, right, inner = np.eye(n), np.empty_like(y), np.arange(1, n - 1)
        A[inner, inner - 1], A[inner, inner], A[inner, inner + 1] = h[1:], 2.0 * (h[:-1] + h[1:]), h[:-1]
        right[0], right[-1] = first, last
        right[1:-1] = 3.0 * (h[1:, None] * secant[:-1] + h[:-1, None] * secant[1:])
        # Some tens of knots: a dense solution takes no longer than a banded one, which numpy does not have.
        slopes = np.linalg.solve(A, right)
        bend, twist = 3.0 * secant - 2.0 * slopes[:-1] - slopes[1:], slopes[:-1] + slopes[1:] - 2.0 * secant
        self._x = x
        self._c = y[:-1], slopes[:-1], bend / h[:, None], twist / (h * h)[:, None]

    def __call__(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Value, first and second derivative at parameters (m,), shape (m, C) each."""
        i = np.clip(np.searchsorted(self._x, x, side="right") - 1, 0, len(self._x) - 2)
        t = (x - self._x[i])[:, None]
        c0, c1, c2, c3 = (c[i] for c in self._c)
        c3 *= t
        value = c0 + t * (c1 + t * (c2 + c3))
        first = c1 + t * (2.0 * c2 + 3.0 * c3)
        return value, first, 2.0 * c2 + 6.0 * c3
