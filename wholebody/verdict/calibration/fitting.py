"""Fit a calibration to outcomes: draws by group, tests on groups that were left out, and what an alarm misses."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from wholebody.verdict.calibration.additive import KINKS, Scale, fit, logistic
from wholebody.verdict.calibration.model import ANSWERS, Calibration, with_world

DRAWS, FOLDS = 24, 5
"""Draws of the data, and parts of which one is left out at a time [no unit]; chosen: each draw costs a fit."""
PENALTIES = (1.0, 3.0, 10.0, 30.0, 100.0)
"""On the weights [chunks]; chosen: those of which the one is taken that predicts groups best that were left out."""
MISSED = 0.01
"""Share of falls that an alarm may miss [no unit]; definition."""
WRONG = 0.5
"""Share of the chunks that do not fall for which an alarm may go off [no unit]; chosen: one that does more is none."""
LIKE = 0.99
"""Share of the fitted chunks that count as like them [no unit]; chosen: one in a hundred is told in vain."""
BINS = 15
"""Of equal count, in the error of a calibration; definition."""
RIDGE = 0.05
"""Added to the covariance of standard quantities [no unit]; chosen: what varies less than that tells nothing apart."""


def fit_calibration(
    quantities: Sequence[Mapping[str, float]],
    worlds: Sequence[str],
    answers: np.ndarray,
    groups: Sequence[str],
    *,
    uses: Mapping[str, Collection[str]] | None = None,
    repeats: int = DRAWS,
    seed: int = 0,
    card: Mapping | None = None,
) -> tuple[Calibration, np.ndarray]:
    """A model, and the probabilities (2, m) that models fitted to the other groups give to each chunk.

    Args:
        quantities: Of m chunks.
        worlds: In which each was.
        answers: What became of it, in the order of `ANSWERS`, 0 or 1, shape (2, m).
        groups: What is not to be split.
        uses: Of which quantities each answer is told; of all if not given.
        repeats: Draws of the data.
        seed: Of folds and draws.
        card: Whatever is to be known of the data.
    """
    names, rng = tuple(with_world(quantities[0], worlds[0])), np.random.default_rng(seed)
    x = Calibration(names, None, None, None, {}).rows(quantities, worlds)
    scale, group = Scale.of(x), np.unique(groups, return_inverse=True)[1]
    n = int(group.max()) + 1
    a, fold = scale.basis(x), (rng.permutation(n) % FOLDS)[group]
    held, weights, chosen = np.empty_like(answers, dtype=float), [], {}
    for k, (name, y) in enumerate(zip(ANSWERS, answers, strict=True)):
        used = [uses is None or one in uses[name] for one in names]
        columns = np.flatnonzero([True, *used * (1 + len(KINKS))])
        mine, all_weights = a[:, columns], np.zeros((repeats, a.shape[1]))
        tried = {penalty: left_out(mine, y, fold, penalty) for penalty in PENALTIES}
        penalty = min(tried, key=lambda one: log_loss(tried[one], y))
        held[k], chosen[name] = tried[penalty], penalty
        counts = rng.multinomial(n, np.full(n, 1.0 / n), size=repeats)
        all_weights[:, columns] = [fit(mine, y, count[group].astype(float), penalty) for count in counts]
        weights.append(all_weights)
    z = scale.standard(x)
    shape = np.linalg.inv(np.cov(z.T, bias=True) + RIDGE * np.eye(len(names)))
    bound = alarm_bound(held[0][answers[0] > 0.5])
    wrong = float((held[0][answers[0] < 0.5] >= bound).mean()) if (answers[0] < 0.5).any() else 0.0
    alarm = bound if wrong <= WRONG else 0.0
    facts = {"alarm": alarm, "alarm_bound": bound, "near": 0.0, "penalties": chosen, "chunks": len(x), **(card or {})}
    model = Calibration(names, scale, np.array(weights), shape, facts)
    model.card["near"] = float(np.quantile(model.distance(x), LIKE))
    return model, held


def left_out(a: np.ndarray, y: np.ndarray, fold: np.ndarray, penalty: float) -> np.ndarray:
    """Probability of each answer by a model fitted to the other folds, shape (m,)."""
    p = np.empty(len(y))
    for one in range(FOLDS):
        test = fold == one
        p[test] = logistic(a[test] @ fit(a[~test], y[~test], np.ones((~test).sum()), penalty))
    return p


def log_loss(p: np.ndarray, y: np.ndarray) -> float:
    """Mean logarithm of the probability of what happened, negative."""
    p = np.clip(p, 1e-9, 1.0 - 1e-9)
    return float(-np.mean(y * np.log(p) + (1.0 - y) * np.log(1.0 - p)))


def alarm_bound(falls: np.ndarray, missed: float = MISSED) -> float:
    """Probability from which an alarm is due, so that of falls drawn alike at most so large a share is missed.

    Args:
        falls: Probabilities that were given to n falls, shape (n,).
        missed: That share, on average over draws of such falls.

    Returns:
        The k-th smallest, k = floor(missed (n + 1)); 0, an alarm always, where there are too few for any promise.

    Source:
        Vovk, Gammerman and Shafer 2005, "Algorithmic Learning in a Random World", inductive conformal prediction.
    """
    k = int(np.floor(missed * (len(falls) + 1)))
    return float(np.sort(falls)[k - 1]) if k else 0.0


def calibration_error(p: np.ndarray, y: np.ndarray, bins: int = BINS) -> float:
    """Mean difference of probability and share, over bins of equal count."""
    parts = np.array_split(np.argsort(p, kind="stable"), bins)
    return float(sum(len(part) * abs(p[part].mean() - y[part].mean()) for part in parts if len(part)) / len(p))
