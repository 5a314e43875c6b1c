"""How quantities become numbers of order 1, to say how far a chunk is from those that a model was fitted to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

SPREAD_MIN = 1e-6
"""Standard deviation below which a quantity does not vary [no unit]; chosen: rounding."""


@dataclass(frozen=True)
class Scale:
    """Scale of n quantities.

    Attributes:
        unit: Of each, where its logarithm begins, shape (n,).
        mean, spread: Of the logarithms, shape (n,) each.
        low, high: Between which the fitted ones lie, shape (n,) each.
    """

    unit: np.ndarray
    mean: np.ndarray
    spread: np.ndarray
    low: np.ndarray
    high: np.ndarray

    @staticmethod
    def of(x: np.ndarray) -> Scale:
        """Scale fitted to quantities (m, n)."""
        unit = np.maximum(np.median(np.abs(x), axis=0), 1e-3)
        logs = _logarithm(x, unit)
        mean, spread = logs.mean(axis=0), logs.std(axis=0)
        spread = np.where(spread < SPREAD_MIN, 1.0, spread)
        z = (logs - mean) / spread
        return Scale(unit, mean, spread, z.min(axis=0), z.max(axis=0))

    def standard(self, x: np.ndarray) -> np.ndarray:
        """Logarithms of quantities (m, n), of mean 0 and spread 1 where fitted."""
        return (_logarithm(x, self.unit) - self.mean) / self.spread


def _logarithm(x: np.ndarray, unit: np.ndarray) -> np.ndarray:
    """Linear up to a unit, logarithmic beyond, with the sign of x."""
    return np.sign(x) * np.log1p(np.abs(x) / unit)
