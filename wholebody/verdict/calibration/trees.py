"""Probabilities by sums of small decision trees: each asks three questions and adds what its leaf says.

    log(p / (1 - p)) = sum_t leaf_t(x)

There is a sum for each draw of the data that was fitted to: their mean is the answer, and what they differ by is how
well it is known.

Source:
    Friedman 2001, "Greedy function approximation: a gradient boosting machine"; Efron 1979, "Bootstrap methods: another
    look at the jackknife".
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

DEPTH = 3
"""Questions from the root of a tree to a leaf [no unit]; chosen: deeper ones predict groups left out no better."""


@dataclass(frozen=True)
class Trees:
    """Trees in the order of answers, draws of the data and their number, ``shape`` (2, draws, t).

    A node asks whether a quantity is beyond its bound: no leads to node 2 k + 1, yes to node 2 k + 2.

    Attributes:
        quantity: Which one each node asks for, shape (*shape, 2**DEPTH - 1).
        bound: Its bounds, inf where nothing is asked, the same shape.
        leaf: What each leaf adds to the logarithm of the odds, shape (*shape, 2**DEPTH).
    """

    quantity: np.ndarray
    bound: np.ndarray
    leaf: np.ndarray

    def sound(self, n: int) -> bool:
        """Whether these are trees on n quantities."""
        shape, nodes = self.leaf.shape[:-1], 2**DEPTH - 1
        alike = self.quantity.shape == self.bound.shape == (*shape, nodes) and self.leaf.shape[-1:] == (nodes + 1,)
        asked = bool(((self.quantity >= 0) & (self.quantity < n)).all())
        return (
            alike
            and len(shape) == 3
            and asked
            and bool(np.isfinite(self.leaf).all() and not np.isnan(self.bound).any())
        )

    def probabilities(self, x: np.ndarray) -> np.ndarray:
        """Probabilities of quantities (m, n) by every draw, shape (2, draws, m)."""
        shape, m = self.leaf.shape[:-1], len(x)
        quantity, bound, leaf = (part.reshape(-1, part.shape[-1]) for part in (self.quantity, self.bound, self.leaf))
        tree, score = np.arange(len(leaf)), np.empty((m, *shape[:2]))
        for row, values in enumerate(x):
            node = np.zeros(len(leaf), dtype=int)
            for _ in range(DEPTH):
                node = 2 * node + 1 + (values[quantity[tree, node]] > bound[tree, node])
            score[row] = leaf[tree, node - (2**DEPTH - 1)].reshape(shape).sum(axis=2)
        return 0.5 * (1.0 + np.tanh(0.5 * np.moveaxis(score, 0, -1)))
