"""Fit a calibration to outcomes: draws by group, tests on groups that were left out, and what an alarm misses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from sklearn.ensemble import GradientBoostingClassifier
from sklearn.tree import DecisionTreeRegressor

from wholebody.verdict.calibration.model import ANSWERS, Calibration, with_world
from wholebody.verdict.calibration.scale import Scale
from wholebody.verdict.calibration.trees import DEPTH, Trees

DRAWS, FOLDS = 16, 5
"""Draws of the data, and parts of which one is left out at a time [no unit]; chosen: each draw costs a fit."""
NUMBERS = (50, 100, 150, 190)
"""Of trees; chosen: those of which the one is taken that predicts groups best that were left out, and no more than make
300 kB (300 trees would find 0.3 % more of the falls)."""
RATE, LEAF_MIN, DRAWN, ASKED = 0.1, 15, 0.7, 0.15
"""Share of what a tree says that is added, chunks that a leaf is of at least, and shares of the chunks and of the
quantities that a tree and a question are chosen by [no unit]; chosen: by groups left out of 1,500 chunks, where nothing
near them was better by more than chance."""
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
    numbers: Sequence[int] = NUMBERS,
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
        numbers: Of trees, from which one is chosen.
        repeats: Draws of the data.
        seed: Of folds and draws.
        card: Whatever is to be known of the data.
    """
    names, rng = tuple(with_world(quantities[0], worlds[0])), np.random.default_rng(seed)
    x = Calibration(names, None, None, None, {}).rows(quantities, worlds)
    scale, group = Scale.of(x), np.unique(groups, return_inverse=True)[1]
    n = int(group.max()) + 1
    fold = (rng.permutation(n) % FOLDS)[group]
    held, grown, chosen = np.empty_like(answers, dtype=float), [], {}
    for k, (name, y) in enumerate(zip(ANSWERS, answers, strict=True)):
        tried = left_out(x, y, fold, numbers)
        number = min(tried, key=lambda one: log_loss(tried[one], y))
        held[k], chosen[name] = tried[number], number
        counts = rng.multinomial(n, np.full(n, 1.0 / n), size=repeats)
        grown.append([as_arrays(grow(x, y, count[group], number)) for count in counts])
    most = max(chosen.values())
    trees = Trees(*(np.array([[padded(draw[part], most) for draw in draws] for draws in grown]) for part in range(3)))
    z = scale.standard(x)
    shape = np.linalg.inv(np.cov(z.T, bias=True) + RIDGE * np.eye(len(names)))
    bound = alarm_bound(held[0][answers[0] > 0.5])
    wrong = float((held[0][answers[0] < 0.5] >= bound).mean()) if (answers[0] < 0.5).any() else 0.0
    alarm = bound if wrong <= WRONG else 0.0
    facts = {"alarm": alarm, "alarm_bound": bound, "near": 0.0, "trees": chosen, "chunks": len(x), **(card or {})}
    model = Calibration(names, scale, trees, shape, facts)
    model.card["near"] = float(np.quantile(model.distance(x), LIKE))
    return model, held


def grow(x: np.ndarray, y: np.ndarray, weight: np.ndarray, number: int) -> GradientBoostingClassifier:
    """So many trees on quantities (m, n) for answers (m,) that count so often (m,)."""
    some, settings = weight > 0, {"min_samples_leaf": LEAF_MIN, "subsample": DRAWN, "max_features": ASKED}
    model = GradientBoostingClassifier(
        n_estimators=number, learning_rate=RATE, max_depth=DEPTH, random_state=0, **settings
    )
    return model.fit(x[some], y[some], sample_weight=weight[some])


def as_arrays(model: GradientBoostingClassifier) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Quantities, bounds and leaves as `Trees` has them."""
    nodes, number = 2**DEPTH - 1, len(model.estimators_)
    quantity, bound = np.zeros((number, nodes), dtype=int), np.full((number, nodes), np.inf)
    leaf = np.zeros((number, nodes + 1))

    def fill(row: int, one: DecisionTreeRegressor, at: int = 0, node: int = 0, depth: int = 0) -> None:
        tree = one.tree_
        if tree.children_left[at] >= 0:
            quantity[row, node], bound[row, node] = tree.feature[at], tree.threshold[at]
            fill(row, one, tree.children_left[at], 2 * node + 1, depth + 1)
            fill(row, one, tree.children_right[at], 2 * node + 2, depth + 1)
        else:
            width = 2 ** (DEPTH - depth)
            first = (node + 1 - 2**depth) * width
            leaf[row, first : first + width] = RATE * tree.value[at, 0, 0]

    for row, (one,) in enumerate(model.estimators_):
        fill(row, one)
    # What it begins with is told by the first tree.
    x = np.zeros((1, model.n_features_in_))
    leaf[0] += model.decision_function(x)[0] - RATE * sum(float(one.predict(x)[0]) for (one,) in model.estimators_)
    return quantity, bound, leaf


def padded(part: np.ndarray, number: int) -> np.ndarray:
    """With trees that ask what the last one asks and say nothing, up to so many."""
    more = number - len(part)
    last = np.zeros_like(part[-1:]) if part.shape[1] == 2**DEPTH else part[-1:]
    return np.concatenate([part, np.repeat(last, more, axis=0)])


def left_out(x: np.ndarray, y: np.ndarray, fold: np.ndarray, numbers: Sequence[int]) -> dict[int, np.ndarray]:
    """Probability of each answer by models fitted to the other folds, shape (m,), by the number of trees."""
    found = {number: np.empty(len(y)) for number in numbers}
    for one in range(FOLDS):
        test = fold == one
        model = grow(x[~test], y[~test], np.ones((~test).sum()), max(numbers))
        for number, p in enumerate(model.staged_predict_proba(x[test]), 1):
            if number in found:
                found[number][test] = p[:, 1]
    return found


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
