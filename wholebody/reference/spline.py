"""C2 curves through knots: cubic splines in slope form, written as quintic segments so that outliers stay C2 too.

A segment is the quintic that takes value, first and second derivative from one knot to the next. Where those are a
cubic spline's the quintic *is* the cubic. A knot whose slope has to be limited gets second derivative zero: the curve
stays C2 there, at the price of a higher jerk, which a cubic could not give.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import comb

import numpy as np

from wholebody.jit.entry import Entry
from wholebody.reference.kernels import knot_derivatives as _kernel

DEGREE = 5
_SHIFT = np.array([[comb(j, i) if j >= i else 0 for j in range(DEGREE + 1)] for i in range(DEGREE + 1)], dtype=float)
_FACTOR = np.array([[np.prod(np.arange(k, k - d, -1.0)) for k in range(DEGREE + 1)] for d in range(DEGREE + 1)])
_POWER = np.array([[max(j - i, 0) for j in range(DEGREE + 1)] for i in range(DEGREE + 1)])

_knot_derivatives = Entry(_kernel.knot_derivatives)


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
        """Curve with breaks at ``points`` as well, which may lie outside."""
        breaks = np.union1d(self.breaks, points)
        i = np.clip(np.searchsorted(self.breaks, breaks[:-1], side="right") - 1, 0, len(self.coefficients) - 1)
        coefficients, delta = self.coefficients[i], breaks[:-1] - self.breaks[i]
        new = delta != 0.0
        coefficients[new] = shift(coefficients[new], delta[new])
        outside = (breaks[:-1] < self.breaks[0]) | (breaks[:-1] >= self.breaks[-1])
        if outside.any():
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
    out = np.empty((len(h), DEGREE + 1, y0.shape[1]))
    out[:, 0], out[:, 1], out[:, 2] = y0, start[1], 0.5 * start[2]
    out[:, 3] = (10 * rest - 4 * slope + 0.5 * curvature) / h**3
    out[:, 4] = (-15 * rest + 7 * slope - curvature) / h**4
    out[:, 5] = (6 * rest - 3 * slope + 0.5 * curvature) / h**5
    return out


def knot_derivatives(times: np.ndarray, y: np.ndarray, limited: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First and second derivatives at the knots of the C2 cubic spline, ends not-a-knot.

    Args:
        times: Increasing, shape ``(H,)``.
        y: Values, shape ``(H, C)``.
        limited: Knots that take a monotone slope and no curvature instead, shape ``(H,)``, bool.

    Returns:
        Slopes and second derivatives, shape ``(H, C)`` each.
    """
    count = len(times)
    if count == 1:
        return np.zeros_like(y), np.zeros_like(y)
    slopes, curvature = np.empty(y.shape), np.empty(y.shape)
    _knot_derivatives(
        times.astype(float), y.astype(float, order="C"), limited.astype(bool), slopes, curvature, np.empty(count)
    )
    return slopes, curvature
