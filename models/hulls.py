"""Convex hulls of the robot's meshes, made once and kept in the user's cache.

Collision with the raw meshes costs 850 ms for all pairs, with their hulls 0.5 ms.
"""

from __future__ import annotations

import hashlib
from functools import lru_cache
from pathlib import Path

import numpy as np

from models.cache import cache_dir, write_whole
from models.spec import RobotSpecError

_TRIANGLE = np.dtype([("normal", "<f4", 3), ("vertices", "<f4", (3, 3)), ("attribute", "<u2")])
_HEADER = 80


def read_stl(path: Path) -> np.ndarray:
    """Triangles of a binary STL file, shape (n, 3, 3): triangle, corner, xyz, in the file's unit (here metres).

    Raises:
        RobotSpecError: If the file is missing, is not binary STL, or is cut short.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise RobotSpecError(f"cannot read mesh {path}: {error.strerror}") from error
    return _parse_stl(content, path)["vertices"].astype(float)


def convex_hull(triangles: np.ndarray) -> np.ndarray:
    """Triangles of the convex hull, corners anticlockwise seen from outside.

    Args:
        triangles: Any triangles, shape (n, 3, 3).

    Returns:
        Hull triangles, shape (m, 3, 3); every corner is a corner of the input.
    """
    from scipy.spatial import ConvexHull  # slow to import, needed only when the cache is cold

    points = np.unique(triangles.reshape(-1, 3), axis=0)
    hull = ConvexHull(points, qhull_options="Qt")
    faces = points[hull.simplices]
    normals = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
    inward = np.einsum("ij,ij->i", normals, hull.equations[:, :3]) < 0
    faces[inward] = faces[inward][:, [0, 2, 1]]
    return faces


def hull_file(mesh: Path) -> Path:
    """Binary STL with the convex hull of a mesh, from the cache or made now.

    Raises:
        RobotSpecError: If the mesh cannot be read or the cache cannot be written.
    """
    try:
        found = mesh.stat()
        key = _content_hash(mesh, found.st_mtime_ns, found.st_size)
    except OSError as error:
        raise RobotSpecError(f"cannot read mesh {mesh}: {error.strerror}") from error
    path = cache_dir() / "hulls" / f"{mesh.stem}-{key}.stl"
    if not _is_whole(path):
        write_whole(path, _to_stl(convex_hull(read_stl(mesh))))
    return path


@lru_cache(maxsize=256)
def _content_hash(mesh: Path, _mtime_ns: int, _size: int) -> str:
    return hashlib.sha256(mesh.read_bytes()).hexdigest()[:16]


def _parse_stl(content: bytes, path: Path) -> np.ndarray:
    count = int.from_bytes(content[_HEADER : _HEADER + 4], "little")
    expected = _HEADER + 4 + count * _TRIANGLE.itemsize
    if count == 0 or len(content) != expected:
        raise RobotSpecError(
            f"{path} is not a whole binary STL file: {len(content)} bytes, {expected} expected for {count} triangles; "
            "reinstall the package it comes from"
        )
    return np.frombuffer(content, dtype=_TRIANGLE, offset=_HEADER + 4, count=count)


def _to_stl(triangles: np.ndarray) -> bytes:
    records = np.zeros(len(triangles), dtype=_TRIANGLE)
    records["vertices"] = triangles
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    records["normal"] = np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0)
    return b"convex hull".ljust(_HEADER) + len(triangles).to_bytes(4, "little") + records.tobytes()


def _is_whole(path: Path) -> bool:
    if not path.is_file():
        return False
    with path.open("rb") as file:
        head = file.read(_HEADER + 4)
    count = int.from_bytes(head[_HEADER:], "little")
    return count > 0 and path.stat().st_size == _HEADER + 4 + count * _TRIANGLE.itemsize
