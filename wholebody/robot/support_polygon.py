"""The support polygon of the contact points, as half-planes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class SupportPolygon:
    """Convex polygon ``normals @ p <= offsets`` in the floor plane.

    Attributes:
        normals: Outward unit normals, shape (k, 2).
        offsets: Distances from the origin along the normals, shape (k,), [m].
        vertices: Counter-clockwise corners, shape (k, 2), [m].
    """

    normals: np.ndarray
    offsets: np.ndarray
    vertices: np.ndarray

    def margin(self, point: np.ndarray) -> float:
        """Distance from a point (2,) to the nearest edge, positive inside [m]."""
        return float((self.offsets - self.normals @ point).min())


def convex_polygon(points: np.ndarray) -> SupportPolygon:
    """Convex hull of points in the plane.

    Args:
        points: Shape (n, 2), at least three of them not on a line, [m].

    Source:
        Andrew's monotone chain, Information Processing Letters 9(5), 1979.
    """
    ordered = points[np.lexsort((points[:, 1], points[:, 0]))]
    corners = np.array(_half_hull(ordered)[:-1] + _half_hull(ordered[::-1])[:-1])
    edges = np.roll(corners, -1, axis=0) - corners
    normals = np.stack([edges[:, 1], -edges[:, 0]], axis=1) / np.linalg.norm(edges, axis=1, keepdims=True)
    return SupportPolygon(normals, np.sum(normals * corners, axis=1), corners)


def _half_hull(points: np.ndarray) -> list[np.ndarray]:
    chain: list[np.ndarray] = []
    for p in points:
        while len(chain) > 1 and _turn(chain[-1] - chain[-2], p - chain[-2]) <= 1e-12:
            chain.pop()
        chain.append(p)
    return chain


def _turn(a: np.ndarray, b: np.ndarray) -> float:
    """Cross product in the plane: positive for a left turn."""
    return float(a[0] * b[1] - a[1] * b[0])
