"""The point of a simplex that is nearest to the origin.

``W`` (4, 3) are the points of the simplex, ``weights`` (4,) the barycentric coordinates of the nearest point in it.

Source:
    Ericson 2005, "Real-Time Collision Detection", 5.1.
"""

from __future__ import annotations

import math

from wholebody.jit.arrays import Matrix, Vector


def dot3(a: Vector, b: Vector) -> float:
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def segment(W: Matrix, a: int, b: int, weights: Vector) -> None:
    """Weights of the ends in the point of a segment nearest to the origin."""
    x, y, z = W[b, 0] - W[a, 0], W[b, 1] - W[a, 1], W[b, 2] - W[a, 2]
    along = -(x * W[a, 0] + y * W[a, 1] + z * W[a, 2])
    size = x * x + y * y + z * z
    t = 0.0 if along <= 0.0 or size == 0.0 else (1.0 if along >= size else along / size)
    weights[a], weights[b] = 1.0 - t, t


def triangle(W: Matrix, a: int, b: int, c: int, weights: Vector) -> None:
    """Weights of the corners in the point of a triangle nearest to the origin."""
    ux, uy, uz = W[b, 0] - W[a, 0], W[b, 1] - W[a, 1], W[b, 2] - W[a, 2]
    vx, vy, vz = W[c, 0] - W[a, 0], W[c, 1] - W[a, 1], W[c, 2] - W[a, 2]
    d1 = -(ux * W[a, 0] + uy * W[a, 1] + uz * W[a, 2])
    d2 = -(vx * W[a, 0] + vy * W[a, 1] + vz * W[a, 2])
    d3 = -(ux * W[b, 0] + uy * W[b, 1] + uz * W[b, 2])
    d4 = -(vx * W[b, 0] + vy * W[b, 1] + vz * W[b, 2])
    d5 = -(ux * W[c, 0] + uy * W[c, 1] + uz * W[c, 2])
    d6 = -(vx * W[c, 0] + vy * W[c, 1] + vz * W[c, 2])
    weights[a] = weights[b] = weights[c] = 0.0
    if d1 <= 0.0 and d2 <= 0.0:
        weights[a] = 1.0
    elif d3 >= 0.0 and d4 <= d3:
        weights[b] = 1.0
    elif d6 >= 0.0 and d5 <= d6:
        weights[c] = 1.0
    else:
        on_c, on_b, on_a = d1 * d4 - d3 * d2, d5 * d2 - d1 * d6, d3 * d6 - d5 * d4
        if on_c <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
            weights[b] = d1 / (d1 - d3)
            weights[a] = 1.0 - weights[b]
        elif on_b <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
            weights[c] = d2 / (d2 - d6)
            weights[a] = 1.0 - weights[c]
        elif on_a <= 0.0 and d4 >= d3 and d5 >= d6:
            weights[c] = (d4 - d3) / ((d4 - d3) + (d5 - d6))
            weights[b] = 1.0 - weights[c]
        else:
            weights[b], weights[c] = on_b / (on_a + on_b + on_c), on_c / (on_a + on_b + on_c)
            weights[a] = 1.0 - weights[b] - weights[c]


def outside(W: Matrix, a: int, b: int, c: int, d: int) -> bool:
    """Whether the origin may be on the other side of the plane ``abc`` than ``d``; a flat tetrahedron has no inside."""
    ux, uy, uz = W[b, 0] - W[a, 0], W[b, 1] - W[a, 1], W[b, 2] - W[a, 2]
    vx, vy, vz = W[c, 0] - W[a, 0], W[c, 1] - W[a, 1], W[c, 2] - W[a, 2]
    x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    origin = -(x * W[a, 0] + y * W[a, 1] + z * W[a, 2])
    height = x * (W[d, 0] - W[a, 0]) + y * (W[d, 1] - W[a, 1]) + z * (W[d, 2] - W[a, 2])
    size = math.sqrt(x * x + y * y + z * z)
    return origin * height <= 0.0 or abs(height) <= 1e-13 * size


def tetrahedron(W: Matrix, weights: Vector, trial: Vector) -> bool:
    """Weights of the corners in the nearest point of a tetrahedron; False if the origin is in it."""
    best = math.inf
    for out in range(4):
        a, b, c = (out + 1) % 4, (out + 2) % 4, (out + 3) % 4
        if outside(W, a, b, c, out):
            triangle(W, a, b, c, trial)
            trial[out] = 0.0
            size = 0.0
            for k in range(3):
                x = trial[a] * W[a, k] + trial[b] * W[b, k] + trial[c] * W[c, k]
                size += x * x
            if size < best:
                best = size
                for i in range(4):
                    weights[i] = trial[i]
    return best < math.inf


def nearest_of(W: Matrix, n: int, weights: Vector, trial: Vector) -> bool:
    """Weights (4,) of ``n`` points W (4, 3) in their simplex' point nearest to the origin; False if that is inside."""
    if n == 1:
        weights[0] = 1.0
    elif n == 2:
        segment(W, 0, 1, weights)
    elif n == 3:
        triangle(W, 0, 1, 2, weights)
    else:
        return tetrahedron(W, weights, trial)
    return True


def keep(W: Matrix, simplex: Matrix, n: int, weights: Vector) -> int:
    """Drop the points (4, 6) without a weight (4,); the number of those that are left."""
    kept = 0
    for i in range(n):
        if weights[i] > 0.0:
            if kept != i:
                weights[kept] = weights[i]
                for k in range(3):
                    W[kept, k] = W[i, k]
                for k in range(6):
                    simplex[kept, k] = simplex[i, k]
            kept += 1
    return kept
