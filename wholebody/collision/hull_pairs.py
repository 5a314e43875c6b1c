"""Pairs of convex shapes at many placements: which are nearer to each other than is asked for.

Spheres and boxes around the shapes say which pairs may be near; those are measured, each from where it was last.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from wholebody.collision.gjk import APART, SCRATCH, UNSURE, distance
from wholebody.jit.arrays import Matrix, Vector
from wholebody.jit.entry import Entry


class HullPairs(NamedTuple):
    """n shapes, each on a body of its own in whose axes it is given, and m pairs of them."""

    shapes: np.ndarray  # (n, 4) as in `gjk`
    rounds: np.ndarray  # (n, 8)
    vertices: np.ndarray  # (any, 3)
    start: np.ndarray
    neighbours: np.ndarray
    centre: np.ndarray  # (n, 3) of a box around each
    half: np.ndarray  # (n, 3) half its sides
    radius: np.ndarray  # (n,) of a sphere about the same centre
    pairs: np.ndarray  # (m, 2)
    near: np.ndarray  # (m,) distance from which on a pair does not matter


class Found(NamedTuple):
    """Distances of m pairs at K placements, with the end of the search for each; `distance` of far ones is inf."""

    distance: np.ndarray  # (K, m); -inf where shapes touch, and another algorithm has to say how deep
    rows: np.ndarray  # (K, m, 9) normal from the first to the second, and the nearest points
    simplex: np.ndarray  # (m, 4, 6)
    state: np.ndarray  # (m, 3)
    scratch: np.ndarray


def found_of(hulls: HullPairs, K: int) -> Found:
    """Room for an answer at K placements."""
    m, first = len(hulls.pairs), hulls.shapes[hulls.pairs, 1]
    state = np.column_stack([np.zeros(m, dtype=np.int64), first]).astype(np.int64)
    return Found(np.full((K, m), np.inf), np.zeros((K, m, 9)), np.zeros((m, 4, 6)), state, np.zeros(SCRATCH))


def measure(hulls: HullPairs, R: np.ndarray, p: np.ndarray, found: Found) -> None:
    """Measure the pairs that may be near.

    Args:
        hulls: `HullPairs`.
        R: Rotations of the bodies (K, n, 3, 3).
        p: Their origins (K, n, 3).
        found: `Found`, filled.
    """
    for k in range(R.shape[0]):
        for m in range(hulls.pairs.shape[0]):
            found.distance[k, m] = math.inf
            i, j = hulls.pairs[m, 0], hulls.pairs[m, 1]
            if apart(hulls, i, j, R[k], p[k], hulls.near[m]):
                continue
            size, code = distance(
                hulls.shapes[i], hulls.shapes[j], hulls.rounds[i], hulls.rounds[j], hulls.vertices, hulls.start,
                hulls.neighbours, hulls.near[m], R[k, i], p[k, i], R[k, j], p[k, j], found.simplex[m], found.state[m],
                found.scratch, found.rows[k, m],
            )  # fmt: skip
            if code == UNSURE:
                found.distance[k, m] = -math.inf
            elif code == APART and size < hulls.near[m]:
                found.distance[k, m] = size


def apart(hulls: HullPairs, i: int, j: int, R: np.ndarray, p: Matrix, near: float) -> bool:
    """Whether spheres and boxes around two shapes show that they are at least so far apart."""
    a, b = hulls.centre[i], hulls.centre[j]
    x = p[j, 0] - p[i, 0] + R[j, 0, 0] * b[0] + R[j, 0, 1] * b[1] + R[j, 0, 2] * b[2]
    y = p[j, 1] - p[i, 1] + R[j, 1, 0] * b[0] + R[j, 1, 1] * b[1] + R[j, 1, 2] * b[2]
    z = p[j, 2] - p[i, 2] + R[j, 2, 0] * b[0] + R[j, 2, 1] * b[1] + R[j, 2, 2] * b[2]
    x -= R[i, 0, 0] * a[0] + R[i, 0, 1] * a[1] + R[i, 0, 2] * a[2]
    y -= R[i, 1, 0] * a[0] + R[i, 1, 1] * a[1] + R[i, 1, 2] * a[2]
    z -= R[i, 2, 0] * a[0] + R[i, 2, 1] * a[1] + R[i, 2, 2] * a[2]
    size = near + hulls.radius[i] + hulls.radius[j]
    return (
        size <= 0.0
        or x * x + y * y + z * z >= size * size
        or outside_box(R[i], hulls.half[i], x, y, z) >= near + hulls.radius[j]
        or outside_box(R[j], hulls.half[j], x, y, z) >= near + hulls.radius[i]
    )


def outside_box(R: Matrix, half: Vector, x: float, y: float, z: float) -> float:
    """Distance of a point, seen from the middle of a box, from the box; R are the axes of the box."""
    total = 0.0
    for c in range(3):
        d = abs(R[0, c] * x + R[1, c] * y + R[2, c] * z) - half[c]
        if d > 0.0:
            total += d * d
    return math.sqrt(total)


measured = Entry(measure)
