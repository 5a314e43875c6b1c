"""A small network that tells pairs of palms that are held from others, fitted by Adam; numpy alone."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from wholebody.jit.entry import Entry
from wholebody.planning.reachability.kernels import network as kernel
from wholebody.planning.reachability.kernels.network import N_FEATURES
from wholebody.planning.reachability.pairs import BODY, Pairs

NEURONS, HIDDEN = 128, 2
"""Neurons of a hidden layer of a map, and such layers; chosen: a query takes microseconds."""
BATCH, PAIRS_AT_ONCE = 256, 5000
"""Pairs of a step of a fit, and those that a network is asked at once; chosen: they fit the processor's memory."""
LEARNING_RATE, DECAY = 2e-3, 1e-4
"""Largest step of Adam and weight decay, both per step [no unit]; chosen."""
FADE, FADE_SQUARE, TINY = 0.9, 0.999, 1e-8
"""Memory of Adam for gradients and their squares, and what is added to a root [no unit]. Source: Kingma & Ba
2015, algorithm 1."""

Network = tuple[np.ndarray, ...]
"""Weights and biases, layer by layer: shapes (N_FEATURES, width) and (width,), then (width, width) and (width,) of each
further hidden layer, which adds to what the one before says, and (width, 1) and (1,)."""

_all_features = Entry(kernel.all_features)


def untrained(generator: np.random.Generator, width: int = NEURONS, hidden: int = HIDDEN) -> Network:
    """Random weights (He et al. 2015) of so many hidden layers, each as wide."""
    found: list[np.ndarray] = []
    for before, after in pairwise((N_FEATURES, *[width] * hidden, 1)):
        weights = generator.standard_normal((before, after)) * np.sqrt(2.0 / before)
        found += [weights.astype(np.float32), np.zeros(after, np.float32)]
    return tuple(found)


def inputs(pairs: Pairs) -> np.ndarray:
    """Features of the pairs and of their mirror images, shape (2, n, N_FEATURES)."""
    out = np.zeros((2, len(pairs), N_FEATURES), np.float32)
    for one, x in zip((pairs, pairs.mirrored()), out, strict=True):
        _all_features(*map(np.ascontiguousarray, (one.points, one.turns, one.loads)), BODY, x)
    return out


def logits(network: Network, pairs: Pairs) -> np.ndarray:
    """Logarithm of the odds that pairs are held, shape (n,)."""
    found = [np.zeros(0, np.float32)]
    for first in range(0, len(pairs), PAIRS_AT_ONCE):
        x = inputs(pairs[first : first + PAIRS_AT_ONCE])
        found.append(_Pass(network, x.reshape(-1, x.shape[2])).logit)
    return np.concatenate(found)


def likely(logit: np.ndarray) -> np.ndarray:
    """The logistic function, which does not overflow."""
    return 0.5 + 0.5 * np.tanh(0.5 * logit)


def fit(
    network: Network,
    x: np.ndarray,
    held: np.ndarray,
    epochs: int,
    generator: np.random.Generator,
    *,
    dropped: float = 0.0,
) -> Network:
    """The network after some epochs; the step shrinks to nothing along a cosine.

    Args:
        network: To begin with.
        x: As of `inputs`.
        held: Whether pairs are held, or how likely, shape (n,), 0 to 1.
        epochs: Times that every pair is seen.
        generator: Of the order in which they are, and of what is dropped.
        dropped: Share of the neurons that a further layer does not see, others at each step.
    """
    layers = [layer.copy() for layer in network]
    mean, square = ([np.zeros_like(layer) for layer in layers] for _ in range(2))
    n, step = len(held), 0
    total = epochs * -(-n // BATCH)
    for _ in range(epochs):
        order = generator.permutation(n)
        for first in range(0, n, BATCH):
            chosen = order[first : first + BATCH]
            step += 1
            now = 0.5 * LEARNING_RATE * (1.0 + np.cos(np.pi * step / total))
            seen = x[:, chosen].reshape(-1, x.shape[2])
            gradients = _Pass(layers, seen, dropped, generator).gradients(held[chosen])
            for i, g in enumerate(gradients):
                mean[i] += (1.0 - FADE) * (g - mean[i])
                square[i] += (1.0 - FADE_SQUARE) * (g * g - square[i])
                root = np.sqrt(square[i] / (1.0 - FADE_SQUARE**step)) + TINY
                layers[i] -= (now * (mean[i] / (1.0 - FADE**step) / root + DECAY * layers[i])).astype(np.float32)
    return tuple(layers)


class _Pass:
    """What a network says of pairs, whose mirror images come after them, and what would have it say something else.

    Attributes:
        logit: Of each pair, shape (n,).
    """

    def __init__(
        self,
        layers: Network | list[np.ndarray],
        x: np.ndarray,
        dropped: float = 0.0,
        generator: np.random.Generator | None = None,
    ) -> None:
        self._layers = layers
        self._seen, self._kept, self._slopes, total = [x], [], [], np.float32(0.0)
        for w, b in zip(layers[:-2:2], layers[1:-2:2], strict=True):
            output, slope = _hard_swish(self._seen[-1] @ w + b)
            self._slopes.append(slope)
            total = total + output
            kept = None
            if dropped and generator is not None:
                kept = (generator.random(total.shape, np.float32) >= dropped) * np.float32(1.0 / (1.0 - dropped))
            self._kept.append(kept)
            self._seen.append(total if kept is None else total * kept)
        self._total = total
        self.logit = (total @ layers[-2]).reshape(2, -1).sum(axis=0) + layers[-1]

    def gradients(self, held: np.ndarray) -> list[np.ndarray]:
        """Gradients of the mean cross-entropy, in the order of the layers."""
        off = ((likely(self.logit) - held) / len(held)).astype(np.float32)
        back = np.tile(off, 2)[:, None]
        found = [self._total.T @ back, off.sum(keepdims=True)]
        to_total = back @ self._layers[-2].T
        for k in reversed(range(len(self._slopes))):
            to_said = to_total * self._slopes[k]
            found[:0] = [self._seen[k].T @ to_said, to_said.sum(axis=0)]
            if k:
                to_seen = to_said @ self._layers[2 * k].T
                kept = self._kept[k - 1]
                to_total = to_total + (to_seen if kept is None else to_seen * kept)
        return found


def _hard_swish(z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Values of `kernel.hard_swish`, and its derivative."""
    share = np.clip(z * np.float32(1.0 / 6.0) + np.float32(0.5), 0.0, 1.0)
    return z * share, share + ((share > 0.0) & (share < 1.0)) * z * np.float32(1.0 / 6.0)
