"""A small network that tells pairs of palms that are held from others, fitted by Adam; numpy alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wholebody.jit.entry import Entry
from wholebody.planning.reachability.kernels import network as kernel
from wholebody.planning.reachability.kernels.network import N_FEATURES
from wholebody.planning.reachability.pairs import BODY, Pairs

WIDTH = 96
"""Neurons of each of the two hidden layers; chosen: a query takes microseconds."""
BATCH = 512
RATE, DECAY = 2e-3, 1e-4
"""Largest step of Adam and weight decay, both per step [no unit]; chosen."""
MISS_SCALE, MISS_MOST, MISS_SHARE = 0.1, 0.5, 0.1
"""Miss that counts 1, most that counts [m], and weight of its loss beside cross-entropy [no unit]; chosen."""
FADE, FADE_SQUARE, TINY = 0.9, 0.999, 1e-8
"""Memory of Adam for gradients and their squares, and what is added to a root [no unit]. Source: Kingma & Ba
2015, algorithm 1."""

_all_features = Entry(kernel.all_features)


@dataclass(frozen=True)
class Network:
    """Weights, layer by layer.

    Attributes:
        w1, b1: Shapes (N_FEATURES, WIDTH) and (WIDTH,).
        w2, b2: Shapes (WIDTH, WIDTH) and (WIDTH,).
        w3, b3: Shapes (WIDTH,) and (1,).
    """

    w1: np.ndarray
    b1: np.ndarray
    w2: np.ndarray
    b2: np.ndarray
    w3: np.ndarray
    b3: np.ndarray

    @property
    def layers(self) -> list[np.ndarray]:
        """All of them in the order of their names."""
        return [self.w1, self.b1, self.w2, self.b2, self.w3, self.b3]


def untrained(generator: np.random.Generator) -> Network:
    """Random weights; He et al. 2015."""

    def drawn(*shape: int) -> np.ndarray:
        return (generator.standard_normal(shape) * np.sqrt(2.0 / shape[0])).astype(np.float32)

    zeros = np.zeros(WIDTH, np.float32)
    return Network(drawn(N_FEATURES, WIDTH), zeros, drawn(WIDTH, WIDTH), zeros.copy(), drawn(WIDTH), zeros[:1].copy())


def inputs(pairs: Pairs) -> np.ndarray:
    """Features of the pairs and of their mirror images, shape (2, n, N_FEATURES)."""
    out = np.zeros((2, len(pairs), N_FEATURES), np.float32)
    for one, x in zip((pairs, pairs.mirrored()), out, strict=True):
        _all_features(*map(np.ascontiguousarray, (one.points, one.turns, one.loads)), BODY, x)
    return out


def fit(network: Network, x: np.ndarray, missed: np.ndarray, epochs: int, generator: np.random.Generator) -> Network:
    """The network after some epochs; the step shrinks to nothing along a cosine.

    A second output, which is dropped in the end, is fitted to how far pairs are missed: that has the hidden layers
    learn more from a pair than a yes or no.

    Args:
        network: To begin with.
        x: As of `inputs`.
        missed: By how much, 0 where a pair is held, not finite where it is not known, shape (n,), [m].
        epochs: Times that every pair is seen.
        generator: Of the order in which they are.
    """
    layers = [layer.copy() for layer in [*network.layers, network.w3, network.b3]]
    mean, square = ([np.zeros_like(layer) for layer in layers] for _ in range(2))
    n, step = len(missed), 0
    total = epochs * -(-n // BATCH)
    for _ in range(epochs):
        order = generator.permutation(n)
        for first in range(0, n, BATCH):
            chosen = order[first : first + BATCH]
            step += 1
            now = 0.5 * RATE * (1.0 + np.cos(np.pi * step / total))
            gradients = _gradients(layers, x[:, chosen].reshape(-1, x.shape[2]), missed[chosen])
            for i, g in enumerate(gradients):
                mean[i] += (1.0 - FADE) * (g - mean[i])
                square[i] += (1.0 - FADE_SQUARE) * (g * g - square[i])
                root = np.sqrt(square[i] / (1.0 - FADE_SQUARE**step)) + TINY
                layers[i] -= (now * (mean[i] / (1.0 - FADE**step) / root + DECAY * layers[i])).astype(np.float32)
    return Network(*layers[:6])


def _gradients(layers: list[np.ndarray], x: np.ndarray, missed: np.ndarray) -> list[np.ndarray]:
    """Of the mean loss; ``x`` has the pairs, then their mirror images."""
    w1, b1, w2, b2, w3, b3, w4, b4 = layers
    h1 = np.maximum(x @ w1 + b1, 0.0)
    h2 = np.maximum(h1 @ w2 + b2, 0.0)
    logit = (h2 @ w3).reshape(2, -1).sum(axis=0) + b3
    far = (h2 @ w4).reshape(2, -1).sum(axis=0) + b4
    off = 0.5 + 0.5 * np.tanh(0.5 * logit) - (missed == 0.0)  # the logistic function, which does not overflow
    # Held pairs are inside by an unknown distance: what is told of them is wrong only if it is positive.
    wrong = far - np.minimum(missed, MISS_MOST) / MISS_SCALE
    wrong = np.where(np.isfinite(missed) & ((missed > 0.0) | (far > 0.0)), MISS_SHARE * wrong, 0.0)
    off, wrong = ((one / len(missed)).astype(np.float32) for one in (off, wrong))
    back, back4 = np.tile(off, 2), np.tile(wrong, 2)
    to2 = (np.outer(back, w3) + np.outer(back4, w4)) * (h2 > 0.0)
    to1 = (to2 @ w2.T) * (h1 > 0.0)
    of1, of2 = (x.T @ to1, to1.sum(axis=0)), (h1.T @ to2, to2.sum(axis=0))
    return [*of1, *of2, h2.T @ back, off.sum(keepdims=True), h2.T @ back4, wrong.sum(keepdims=True)]
