"""How far inside the map a pair of palms is; compiled by `wholebody.jit`."""

from __future__ import annotations

import math

import numpy as np

from wholebody.jit.arrays import Indices, Matrix, Vector

N_TURNS = 5
N_TRUNKS = 27
N_FEATURES = 12 + N_TURNS + N_TRUNKS


def features(points: Matrix, turn: int, loads: Vector, body: tuple[np.ndarray, np.ndarray], x: np.ndarray) -> None:
    """What the network sees of a pair, in terms of about 1.

    Args:
        points: Left and right palm point in world (2, 3) [m].
        turn: Number of the turn.
        loads: Masses in the hands (2,) [kg].
        body: Shoulders of a trunk in each of some postures (N_TRUNKS, 2, 3), the first upright, and what leads from a
            wrist to its palm for each turn (N_TURNS, 2, 3) [m].
        x: Out, features (N_FEATURES,).
    """
    shoulders, ahead = body
    apart = 0.0
    for h in range(2):
        side, away = 1.0 if h == 0 else -1.0, 0.0
        for k in range(3):
            away += (points[h, k] - shoulders[0, h, k]) ** 2
        x[3 * h] = (points[h, 0] - 0.2) * 2.0
        x[3 * h + 1] = (side * points[h, 1] - 0.2) * 2.0
        x[3 * h + 2] = (points[h, 2] - 0.9) * 1.2
        x[6 + h] = 2.0 * math.sqrt(away) - 1.0
        x[8 + h] = loads[h]
    for k in range(3):
        apart += (points[0, k] - points[1, k]) ** 2
    apart = math.sqrt(apart)
    x[10] = 2.0 * apart - 1.0
    x[11] = max(1.0 - 8.0 * apart, 0.0)
    for i in range(N_TURNS):
        x[12 + i] = 1.0 if i == turn else 0.0
    for i in range(N_TRUNKS):
        furthest = 0.0
        for h in range(2):
            away = 0.0
            for k in range(3):
                away += (points[h, k] - ahead[turn, h, k] - shoulders[i, h, k]) ** 2
            furthest = max(furthest, away)
        x[12 + N_TURNS + i] = 3.0 * math.sqrt(furthest) - 1.2


def all_features(
    points: np.ndarray, turns: Indices, loads: Matrix, body: tuple[np.ndarray, np.ndarray], x: np.ndarray
) -> None:
    """`features` of n pairs, shapes (n, 2, 3), (n,), (n, 2) and (n, N_FEATURES)."""
    for k in range(turns.shape[0]):
        features(points[k], turns[k], loads[k], body, x[k])


def hard_swish(z: np.ndarray) -> None:
    """Hard swish ``z min(max(z / 6 + 1/2, 0), 1)`` of z (n,), float32, in place. Source: Howard et al. 2019, 5.2."""
    for j in range(z.shape[0]):
        z[j] *= min(max(z[j] * np.float32(1.0 / 6.0) + np.float32(0.5), np.float32(0.0)), np.float32(1.0))


def one_order(
    x: np.ndarray, w1: np.ndarray, b1: np.ndarray, w2: np.ndarray, b2: np.ndarray, w3: np.ndarray, h1: np.ndarray,
    h2: np.ndarray
) -> float:  # fmt: skip
    """The last layer's sum for one order of the hands, without its bias."""
    width = b1.shape[0]
    for j in range(width):
        h1[j] = b1[j]
        h2[j] = b2[j]
    for i in range(x.shape[0]):
        for j in range(width):
            h1[j] += x[i] * w1[i, j]
    hard_swish(h1)
    for i in range(width):
        if h1[i] != 0.0:
            for j in range(width):
                h2[j] += h1[i] * w2[i, j]
    hard_swish(h2)
    total = np.float32(0.0)
    for j in range(width):
        total += w3[j, 0] * (h1[j] + h2[j])
    return total


def rooms(
    points: np.ndarray, turns: Indices, loads: Matrix, body: tuple[np.ndarray, np.ndarray],
    network: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray],
    scratch: tuple[Matrix, Vector, np.ndarray, np.ndarray, np.ndarray], out: Vector
) -> None:  # fmt: skip
    """The logarithm of the odds that pairs are held.

    Args:
        points: Palm points of n pairs in world (n, 2, 3) [m].
        turns: Numbers of their turns (n,).
        loads: Masses in their hands (n, 2) [kg].
        body: As of `features`.
        network: Weights w1, b1, w2, b2, w3, b3.
        scratch: Other order of the points (2, 3) and loads (2,), features, and two hidden layers.
        out: (n,).
    """
    w1, b1, w2, b2, w3, b3 = network
    swapped, carried, x, h1, h2 = scratch
    for k in range(out.shape[0]):
        features(points[k], turns[k], loads[k], body, x)
        out[k] = b3[0] + one_order(x, w1, b1, w2, b2, w3, h1, h2)
        for h in range(2):
            carried[h] = loads[k, 1 - h]
            for i in range(3):
                swapped[h, i] = -points[k, 1 - h, i] if i == 1 else points[k, 1 - h, i]
        features(swapped, turns[k], carried, body, x)
        out[k] += one_order(x, w1, b1, w2, b2, w3, h1, h2)
