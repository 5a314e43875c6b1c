r"""Logistic regression on piecewise linear functions of each quantity: an additive model that can be read.

    log(p / (1 - p)) = b + sum_i f_i(x_i),   f_i piecewise linear with kinks at quantiles of x_i

fitted with a quadratic penalty, so often as there are draws of the data: the mean of the draws is the answer, and what
they differ by is how well it is known.

Source:
    Hastie and Tibshirani 1990, "Generalized Additive Models"; Efron 1979, "Bootstrap methods: another look at the
    jackknife".
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

KINKS = (0.1, 0.3, 0.5, 0.7, 0.9)
"""Quantiles at which slopes change [no unit]; chosen."""
STEPS, CLOSE = 40, 1e-8
"""Newton steps at most, and size of the last one [no unit]; derived: it converges quadratically."""
SPREAD_MIN = 1e-6
"""Standard deviation below which a quantity does not vary [no unit]; chosen: rounding."""


@dataclass(frozen=True)
class Scale:
    """How n quantities become numbers of order 1.

    Attributes:
        unit: Of each, where its logarithm begins, shape (n,).
        mean, spread: Of the logarithms, shape (n,) each.
        kinks: Where slopes change, shape (len(KINKS), n).
        low, high: Between which the fitted ones lie, shape (n,) each.
    """

    unit: np.ndarray
    mean: np.ndarray
    spread: np.ndarray
    kinks: np.ndarray
    low: np.ndarray
    high: np.ndarray

    @staticmethod
    def of(x: np.ndarray) -> Scale:
        """Of quantities (m, n)."""
        unit = np.maximum(np.median(np.abs(x), axis=0), 1e-3)
        logs = _logarithm(x, unit)
        mean, spread = logs.mean(axis=0), logs.std(axis=0)
        spread = np.where(spread < SPREAD_MIN, 1.0, spread)
        z = (logs - mean) / spread
        return Scale(unit, mean, spread, np.quantile(z, KINKS, axis=0), z.min(axis=0), z.max(axis=0))

    def standard(self, x: np.ndarray) -> np.ndarray:
        """Logarithms of quantities (m, n), of mean 0 and spread 1 where fitted."""
        return (_logarithm(x, self.unit) - self.mean) / self.spread

    def basis(self, x: np.ndarray) -> np.ndarray:
        """Piecewise linear functions of quantities (m, n), shape (m, 1 + n (1 + len(KINKS))).

        Beyond what was fitted they are constant.
        """
        z = np.clip(self.standard(x), self.low, self.high)
        bent = [np.maximum(z - kinks, 0.0) for kinks in self.kinks]
        return np.hstack([np.ones((len(z), 1)), z, *bent])


def _logarithm(x: np.ndarray, unit: np.ndarray) -> np.ndarray:
    """Linear up to a unit, logarithmic beyond, with the sign of x."""
    return np.sign(x) * np.log1p(np.abs(x) / unit)


def logistic(score: np.ndarray) -> np.ndarray:
    """Probabilities of logarithms of odds."""
    return 0.5 * (1.0 + np.tanh(0.5 * score))


def fit(a: np.ndarray, y: np.ndarray, weight: np.ndarray, penalty: float) -> np.ndarray:
    """Weights (k,) of the basis for answers of 0 or 1, by Newton's method; the first one is not penalised.

    Args:
        a: Basis, shape (m, k).
        y: Answers, shape (m,).
        weight: How often each counts, shape (m,).
        penalty: On the sum of squares of the weights, counted in answers.
    """
    w, ridge = np.zeros(a.shape[1]), np.full(a.shape[1], penalty)
    ridge[0] = 1e-6

    def cost(w: np.ndarray) -> float:
        score = a @ w
        return float(weight @ (np.logaddexp(0.0, score) - y * score) + 0.5 * ridge @ w**2)

    now = cost(w)
    for _ in range(STEPS):
        p = logistic(a @ w)
        gradient = a.T @ (weight * (p - y)) + ridge * w
        hessian = (a * (weight * p * (1.0 - p))[:, None]).T @ a + np.diag(ridge)
        step, size = np.linalg.solve(hessian, gradient), 1.0
        while (then := cost(w - size * step)) > now and size > 1e-6:
            size *= 0.5
        if then > now:
            break
        w, done, now = w - size * step, now - then < CLOSE * (1.0 + now), then
        if done:
            break
    return w
