"""Convex shapes of the robot as flat tables, for compiled code."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from zipfile import BadZipFile
from zlib import crc32

import coal
import numpy as np
import pinocchio as pin

from models.cache import whole_file
from models.spec import RobotSpec
from models.urdf import light_urdf
from wholebody.collision import gjk as core
from wholebody.errors import InputError

_BOX = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
_BOX_EDGES = np.array([[a, b] for a in range(8) for b in range(8) if bin(a ^ b).count("1") == 1])


@dataclass(frozen=True)
class ShapeTable:
    """Shapes of a geometry model in the axes of the bodies they are fixed to; body 0 is the base.

    Attributes:
        shapes: Rows ``kind first count body`` of `gjk`, shape (n, 4).
        rounds: Rows ``centre axis radius half-length``, shape (n, 8), [m].
        vertices: Of all shapes, shape (n_vertices, 3), [m].
        start: Where the neighbours of each vertex begin in ``neighbours``, shape (n_vertices + 1,).
        neighbours: Vertices at the other ends of the edges, shape (n_edges,).
    """

    shapes: np.ndarray
    rounds: np.ndarray
    vertices: np.ndarray
    start: np.ndarray
    neighbours: np.ndarray


def shape_table(spec: RobotSpec, geometry: pin.GeometryModel) -> ShapeTable:
    """Tables of hulls, boxes, spheres and cylinders.

    Args:
        spec: The robot, in whose cache the edges are kept: reading them from the hulls takes a second.
        geometry: Its shapes.

    Raises:
        InputError: If a shape is of another kind.
        RobotSpecError: If the cache cannot be written.
    """
    items = geometry.geometryObjects
    shapes, rounds, vertices, count = np.zeros((len(items), 4), dtype=np.int64), np.zeros((len(items), 8)), [], 0
    for row, around, item in zip(shapes, rounds, items, strict=True):
        kind, points = _shape(item.name, item.geometry, around)
        around[core.CENTRE : core.AXIS] = item.placement.translation
        around[core.AXIS : core.RADIUS] = item.placement.rotation[:, 2]
        row[:] = kind, count, len(points), item.parentJoint - 1
        vertices.append(points @ item.placement.rotation.T + item.placement.translation)
        count += len(points)
    placed = np.concatenate(vertices)
    ends = _edges(spec, [item.geometry for item in items], shapes[:, core.FIRST], placed)
    start = np.searchsorted(ends[:, 0], np.arange(count + 1))
    return ShapeTable(shapes, rounds, placed, start, np.ascontiguousarray(ends[:, 1]))


def _shape(name: str, geometry: coal.CollisionGeometry, around: np.ndarray) -> tuple[int, np.ndarray]:
    """Kind and vertices in the shape's own axes; sizes of round shapes into ``around``."""
    if isinstance(geometry, coal.Sphere):
        around[core.RADIUS] = geometry.radius
        return core.SPHERE, np.zeros((1, 3))
    if isinstance(geometry, coal.Cylinder):
        around[core.RADIUS], around[core.HALF_LENGTH] = geometry.radius, geometry.halfLength
        return core.CYLINDER, np.zeros((0, 3))
    corners = hull_corners(geometry)
    if corners is None:
        kind = type(geometry).__name__
        raise InputError(f"shape '{name}' is a {kind}; hulls, boxes, spheres and cylinders are known")
    return core.HULL, corners


def hull_corners(geometry: coal.CollisionGeometry) -> np.ndarray | None:
    """Vertices of a hull or a box in its own axes, shape (n, 3), [m]; None for other shapes."""
    if isinstance(geometry, coal.Box):
        return _BOX * geometry.halfSide
    return np.array(geometry.points()) if isinstance(geometry, coal.ConvexBase) else None


def _edges(spec: RobotSpec, shapes: Sequence, first: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """Both directions of every edge, sorted, shape (n, 2); from the cache where it is of these vertices."""
    stored, key = light_urdf(spec).with_name("edges.npz"), crc32(vertices.tobytes())
    found = _stored_edges(stored)
    if found is not None and int(found["key"]) == key:
        return found["edges"].astype(np.int64)
    edges = np.concatenate([_shape_edges(shape) + at for shape, at in zip(shapes, first, strict=True)])
    edges = np.unique(np.concatenate([edges, edges[:, ::-1]]), axis=0)
    with whole_file(stored) as temporary, temporary.open("wb") as file:
        np.savez(file, edges=edges.astype(np.int32), key=key)
    return edges


def _stored_edges(path: Path) -> dict[str, np.ndarray] | None:
    if not path.is_file():
        return None
    try:
        with np.load(path, allow_pickle=False) as found:
            return {name: found[name] for name in ("edges", "key")}
    except (OSError, ValueError, KeyError, EOFError, BadZipFile):  # damaged: made again
        return None


def _shape_edges(geometry: coal.CollisionGeometry) -> np.ndarray:
    if isinstance(geometry, coal.Box):
        return _BOX_EDGES
    if not isinstance(geometry, coal.ConvexBase):
        return np.zeros((0, 2), dtype=np.int64)
    faces = np.array([[face[k] for k in range(3)] for face in map(geometry.polygons, range(geometry.num_polygons))])
    return np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
