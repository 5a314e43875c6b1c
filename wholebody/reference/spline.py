"""C2 curves through knots: cubic splines in slope form, written as quintic segments so that outliers stay C2 too.

A segment is the quintic that takes value, first and second derivative from one knot to the next. Where those are a
cubic spline's the quintic *is* the cubic. A knot whose slope has to be limited gets second derivative zero: the curve
stays C2 there, at the price of a higher jerk, which a cubic could not give.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import comb

import numpy as np

DEGREE = 5
DENSE = 100
"""Knots up to which a dense solution takes no longer than a banded one: a chunk then does without scipy."""
_SHIFT = np.array([[comb(j, i) if j >= i else 0 for j in range(DEGREE + 1)] for i in range(DEGREE + 1)], dtype=float)
_FACTOR = np.array([[np.prod(np.arange(k, k - d, -1.0)) for k in range(DEGREE + 1)] for d in range(DEGREE + 1)])
_POWER = np.array([[max(j - i, 0) for j in range(DEGREE + 1)] for i in range(DEGREE + 1)])


@dataclass(frozen=True)
class PiecewiseQuintic:
    """Curve in R^C on ``[breaks[0], breaks[-1]]``, held outside: it is meant to begin and to end at rest.

    Attributes:
        breaks: Increasing parameters, shape ``(N + 1,)``.
        coefficients: ``y = sum_k coefficients[i, k] (s - breaks[i])^k``, shape ``(N, 6, C)``.
    """

    breaks: np.ndarray
    coefficients: np.ndarray

    def __call__(self, s: np.ndarray, derivatives: int = 2) -> list[np.ndarray]:
        """Value and derivatives at ``s`` (n,), each shape ``(n, C)``; a break belongs to the segment after it."""
        s = np.clip(s, self.breaks[0], self.breaks[-1])
        i = np.clip(np.searchsorted(self.breaks, s, side="right") - 1, 0, len(self.coefficients) - 1)
        x, c = (s - self.breaks[i])[:, None], self.coefficients[i].swapaxes(0, 1)
        out = []
        for d in range(derivatives + 1):
            y = _FACTOR[d, DEGREE] * c[DEGREE]
            for k in range(DEGREE - 1, d - 1, -1):
                y *= x
                y += _FACTOR[d, k] * c[k]
            out.append(y)
        return out

    def __add__(self, other: PiecewiseQuintic) -> PiecewiseQuintic:
        """The sum of two curves, defined where one of them is."""
        mine, its = self.split(other.breaks), other.split(self.breaks)
        return PiecewiseQuintic(mine.breaks, mine.coefficients + its.coefficients)

    def split(self, points: np.ndarray) -> PiecewiseQuintic:
        """The same curve with breaks at ``points`` as well, which may lie outside."""
        breaks = np.union1d(self.breaks, points)
        i = np.clip(np.searchsorted(self.breaks, breaks[:-1], side="right") - 1, 0, len(self.coefficients) - 1)
        coefficients = shift(self.coefficients[i], breaks[:-1] - self.breaks[i])
        outside = (breaks[:-1] < self.breaks[0]) | (breaks[:-1] >= self.breaks[-1])
        coefficients[outside] = 0.0
        coefficients[outside, 0] = self(breaks[:-1][outside], 0)[0]
        return PiecewiseQuintic(breaks, coefficients)

    def after(self, s: float) -> PiecewiseQuintic:
        """The part from ``s`` on; ``s`` must be a break."""
        first = int(np.searchsorted(self.breaks, s))
        return PiecewiseQuintic(self.breaks[first:], self.coefficients[first:])


def shift(coefficients: np.ndarray, delta: np.ndarray) -> np.ndarray:
    """Coefficients ``(N, 6, C)`` of the same polynomials in ``x' = x - delta``, delta ``(N,)``."""
    matrix = _SHIFT * np.asarray(delta)[:, None, None] ** _POWER
    return matrix @ coefficients


def quintic(length: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Coefficients ``(N, 6, C)`` of the quintics between two jets.

    Args:
        length: Lengths of the segments, shape ``(N,)``.
        start: Value, first and second derivative at their starts, shape ``(3, N, C)``.
        end: The same at their ends.
    """
    h = np.asarray(length, dtype=float)[:, None]
    y0, d0, c0 = start[0], start[1] * h, 0.5 * start[2] * h**2
    rest = end[0] - y0 - d0 - c0
    slope, curvature = end[1] * h - d0 - 2 * c0, end[2] * h**2 - 2 * c0
    scaled = [
        y0,
        d0,
        c0,
        10 * rest - 4 * slope + 0.5 * curvature,
        -15 * rest + 7 * slope - curvature,
        6 * rest - 3 * slope + 0.5 * curvature,
    ]
    return np.stack([c / h**k for k, c in enumerate(scaled)], axis=1)


def knot_derivatives(times: np.ndarray, y: np.ndarray, limited: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First and second derivatives at the knots of the C2 cubic spline, ends not-a-knot.

    Args:
        times: Increasing, shape ``(H,)``.
        y: Values, shape ``(H, C)``.
        limited: Knots that take a monotone slope and no curvature instead, shape ``(H,)``, bool.

    Returns:
        Slopes and second derivatives, shape ``(H, C)`` each.

    Source:
        de Boor 2001, "A Practical Guide to Splines", chapter IV (slopes); Fritsch and Butland 1984 (harmonic mean).
    """
    count = len(times)
    if count == 1:
        return np.zeros_like(y), np.zeros_like(y)
    h = np.diff(times)
    secant = np.diff(y, axis=0) / h[:, None]
    lower, diagonal, upper, right = _spline_rows(h, secant)
    slopes = _monotone_slopes(secant)
    lower[limited], upper[limited], diagonal[limited] = 0.0, 0.0, 1.0
    right[limited] = slopes[limited]
    slopes = _solve_tridiagonal(lower, diagonal, upper, right)
    curvature = np.empty_like(y)
    curvature[:-1] = (6 * secant - 4 * slopes[:-1] - 2 * slopes[1:]) / h[:, None]
    curvature[-1] = (4 * slopes[-1] + 2 * slopes[-2] - 6 * secant[-1]) / h[-1]
    curvature[limited] = 0.0
    return slopes, curvature


def _spline_rows(h: np.ndarray, secant: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Tridiagonal system of the slopes: C2 at inner knots, not-a-knot at the ends where there are four knots."""
    count = len(h) + 1
    lower, diagonal, upper = np.zeros(count), np.ones(count), np.zeros(count)
    right = np.empty((count, secant.shape[1]))
    lower[1:-1], upper[1:-1], diagonal[1:-1] = h[1:], h[:-1], 2.0 * (h[:-1] + h[1:])
    right[1:-1] = 3.0 * (h[1:, None] * secant[:-1] + h[:-1, None] * secant[1:])
    if count < 4:  # one secant or one parabola
        bend = (secant[1] - secant[0]) / (h[0] + h[1]) if count == 3 else np.zeros(secant.shape[1])
        right[0], right[-1] = secant[0] - bend * h[0], secant[-1] + bend * h[-1]
        return lower, diagonal, upper, right
    for end, a, b, da, db in ((0, h[0], h[1], secant[0], secant[1]), (-1, h[-1], h[-2], secant[-1], secant[-2])):
        diagonal[end] = b
        (upper if end == 0 else lower)[end] = a + b
        right[end] = ((a + 2.0 * (a + b)) * b * da + a**2 * db) / (a + b)
    return lower, diagonal, upper, right


def _monotone_slopes(secant: np.ndarray) -> np.ndarray:
    """Harmonic mean of both secants where they agree in sign, else zero; zero at the ends.

    It is at most twice the smaller secant, for which the quintic with no curvature at its ends is monotone.
    """
    slopes = np.zeros((len(secant) + 1, secant.shape[1]))
    product, total = secant[:-1] * secant[1:], secant[:-1] + secant[1:]
    same = product > 0.0
    slopes[1:-1][same] = 2.0 * product[same] / total[same]
    return slopes


def _solve_tridiagonal(lower: np.ndarray, diagonal: np.ndarray, upper: np.ndarray, right: np.ndarray) -> np.ndarray:
    if len(diagonal) <= DENSE:
        A, i = np.diag(diagonal), np.arange(len(diagonal) - 1)
        A[i + 1, i], A[i, i + 1] = lower[1:], upper[:-1]
        return np.linalg.solve(A, right)
    from scipy.linalg import solve_banded  # too slow to come with the package

    bands = np.zeros((3, len(diagonal)))
    bands[0, 1:], bands[1], bands[2, :-1] = upper[:-1], diagonal, lower[1:]
    return solve_banded((1, 1), bands, right, check_finite=False)
