"""Hulls: they contain their mesh, are never farther away than it, and come whole out of the cache.

Strategy: every mesh of one side for containment; for distances the pairs that are closest in a few postures.
"""

import json
import subprocess
import sys

import coal
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from models import RobotSpecError, g1
from models.cache import CACHE_VARIABLE, cache_dir, whole_file
from models.hulls import convex_hull, hull_file, read_stl
from models.pinocchio_model import load_collision, load_pinocchio
from models.urdf import light_urdf

MESHES = sorted((g1().urdf.parents[1] / "meshes").glob("*.STL"))
# Left and right are mirror images made by the same tool: one side is enough for the slow test.
ONE_SIDE = [mesh for mesh in MESHES if not mesh.stem.startswith("right_")]


def outside(points, triangles):
    """Largest distance of points beyond the planes of closed, outward triangles [m]."""
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    area = np.linalg.norm(normals, axis=1)
    # The plane of a needle of a triangle is known only roughly.
    keep = area > 1e-9
    normals = normals[keep] / area[keep, None]
    offsets = np.einsum("ij,ij->i", normals, triangles[keep, 0])
    return float(max((points[i : i + 2000] @ normals.T - offsets).max() for i in range(0, len(points), 2000)))


@pytest.mark.parametrize("mesh", ONE_SIDE, ids=lambda mesh: mesh.stem)
def test_the_hull_contains_every_vertex_of_its_mesh(mesh):
    points = np.unique(read_stl(mesh).reshape(-1, 3), axis=0)
    assert outside(points, read_stl(hull_file(mesh))) < 2e-5


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(4, 60))
def test_the_hull_of_random_triangles_is_closed_and_faces_outwards(seed, n):
    triangles = np.random.default_rng(seed).normal(size=(n, 3, 3))
    faces = convex_hull(triangles)
    assert outside(triangles.reshape(-1, 3), faces) < 1e-9
    volume = np.einsum("ij,ij->i", faces[:, 0], np.cross(faces[:, 1], faces[:, 2])).sum() / 6
    assert volume == pytest.approx(ConvexHull(triangles.reshape(-1, 3)).volume, rel=1e-9)


def mesh_geometry(spec, model):
    """The raw meshes that belong to the collision shapes, as triangle trees."""
    return pin.buildGeomFromUrdf(
        model, str(spec.urdf), pin.GeometryType.COLLISION, package_dirs=[str(spec.urdf.parents[4])]
    )


def test_hull_distances_never_exceed_mesh_distances():
    spec = g1()
    model = load_pinocchio(spec)
    hulls, meshes = load_collision(spec, model), mesh_geometry(spec, model)
    names = [shape.name for shape in meshes.geometryObjects]
    assert names == [shape.name for shape in hulls.geometryObjects]
    data, hull_data = model.createData(), hulls.createData()
    rng = np.random.default_rng(0)
    request, worst = coal.DistanceRequest(), -np.inf
    for _ in range(4):
        q = pin.neutral(model)
        q[7:] = 0.6 * rng.uniform(model.lowerPositionLimit[7:], model.upperPositionLimit[7:])
        pin.computeDistances(model, data, hulls, hull_data, q)
        distances = np.array([result.min_distance for result in hull_data.distanceResults])
        for k in np.flatnonzero(distances > 0)[np.argsort(distances[distances > 0])][:8]:
            pair = hulls.collisionPairs[int(k)]
            first, second = (meshes.geometryObjects[i] for i in (pair.first, pair.second))
            placements = [data.oMi[shape.parentJoint] * shape.placement for shape in (first, second)]
            transforms = [coal.Transform3s(at.rotation, at.translation) for at in placements]
            result = coal.DistanceResult()
            exact = coal.distance(first.geometry, transforms[0], second.geometry, transforms[1], request, result)
            worst = max(worst, distances[k] - exact)
    assert worst < 1e-6


def test_a_representation_of_the_raw_mesh_is_not_its_hull():
    """coal's ``buildConvexRepresentation`` keeps all vertices; why `convex_hull` exists."""
    mesh = next(path for path in MESHES if path.stem == "torso_link_rev_1_0")
    raw = coal.MeshLoader().load(str(mesh), np.ones(3))
    raw.buildConvexRepresentation(False)
    hull = coal.MeshLoader().load(str(hull_file(mesh)), np.ones(3))
    assert hull.num_vertices < 0.1 * raw.convex.num_points


def test_all_hulls_become_convex_shapes_in_pinocchio():
    spec = g1()
    kinds = {type(shape.geometry).__name__ for shape in load_collision(spec, load_pinocchio(spec)).geometryObjects}
    assert {kind.replace("Base", "") for kind in kinds} == {"Convex", "Sphere", "Cylinder", "Box"}


@pytest.fixture
def empty_cache(tmp_path, monkeypatch):
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path / "cache"))
    return tmp_path / "cache"


def test_the_cache_variable_moves_the_cache(empty_cache):
    assert cache_dir() == empty_cache
    assert hull_file(MESHES[0]).is_relative_to(empty_cache)


def test_a_hull_is_made_once(empty_cache):
    first = hull_file(MESHES[0])
    written = first.stat().st_mtime_ns
    assert hull_file(MESHES[0]) == first
    assert first.stat().st_mtime_ns == written


def test_a_damaged_hull_is_made_again(empty_cache):
    path = hull_file(MESHES[0])
    whole = path.read_bytes()
    for damaged in (b"", whole[:50], whole[:-7]):
        path.write_bytes(damaged)
        assert hull_file(MESHES[0]).read_bytes() == whole


def test_damaged_shapes_are_made_again():
    spec = g1(hands=False)
    model = load_pinocchio(spec)
    expected = load_collision(spec, model)
    for stored in light_urdf(spec).parent.glob("shapes-*.bin"):
        stored.write_bytes(b"damaged")
    again = load_collision(spec, model)
    assert [s.name for s in again.geometryObjects] == [s.name for s in expected.geometryObjects]
    assert len(again.collisionPairs) == len(expected.collisionPairs)


def test_a_cache_that_cannot_be_written_is_explained(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path / "file"))
    with pytest.raises(RobotSpecError, match=CACHE_VARIABLE):
        hull_file(MESHES[0])


def test_a_write_that_fails_leaves_nothing_behind(tmp_path):
    with pytest.raises(ZeroDivisionError), whole_file(tmp_path / "thing"):
        raise ZeroDivisionError
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("content", [b"", b"solid ascii", b"\0" * 84, b"\0" * 80 + b"\2\0\0\0" + b"\0" * 50])
def test_a_mesh_that_is_not_whole_is_refused(tmp_path, content):
    path = tmp_path / "mesh.stl"
    path.write_bytes(content)
    with pytest.raises(RobotSpecError, match="not a whole binary STL"):
        read_stl(path)


def test_two_processes_may_fill_the_cache_at_once(empty_cache):
    code = "from models import g1; from models.urdf import light_urdf; print(light_urdf(g1(hands=False)))"
    running = [subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) for _ in range(2)]
    paths = {process.communicate(timeout=1000)[0].strip() for process in running}
    assert [process.returncode for process in running] == [0, 0]
    assert len(paths) == 1
    path = light_urdf(g1(hands=False))
    assert str(path) in paths
    assert json.loads(path.with_name("collisions.json").read_text())
