"""Meshes of robot and scene as a browser gets them: with no more triangles than can be seen."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from models.mujoco_model import load_mujoco
from models.scenes import SceneFile
from models.spec import RobotSpec

MERGE_DISTANCE = 0.006
"""Vertices closer together than this become one [m]; by trial: the triangles become a fraction, and look the same."""
CELLS = 1 / 30
"""Vertices closer together than this share of a mesh's length become one [no unit]; by trial: looked at, fingers and
arms are as before at 320 x 240, and but for an emblem at 640 x 480."""
_FLOOR = mujoco.mjtGeom.mjGEOM_PLANE


@dataclass(frozen=True)
class Part:
    """A mesh fixed to a body.

    Attributes:
        body: Name of the body.
        name: Its own.
        vertices: Shape (n, 3), in the body's axes [m]. faces: Shape (m, 3).
        colour: Red, green and blue, 0 to 255.
        robot: Whether it belongs to the robot.
    """

    body: str
    name: str
    vertices: np.ndarray
    faces: np.ndarray
    colour: tuple[int, int, int]
    robot: bool


def parts(spec: RobotSpec, scene: str | SceneFile) -> list[Part]:
    """All that there is to see of the robot and its surroundings but the floor."""
    model = load_mujoco(spec, scene=scene, visuals=True)
    base, found = model.body(spec.base_body).id, []
    for g in range(model.ngeom):
        robot = int(model.body_rootid[model.geom_bodyid[g]]) == base
        if model.geom_type[g] == _FLOOR or (robot and model.geom_group[g] != 2):
            continue
        shape = _mesh(model, g) if model.geom_type[g] == mujoco.mjtGeom.mjGEOM_MESH else _primitive(model, g)
        if shape is None:
            continue
        R = np.zeros(9)
        mujoco.mju_quat2Mat(R, model.geom_quat[g])
        vertices = shape[0] @ R.reshape(3, 3).T + model.geom_pos[g]
        colour = tuple(round(255 * float(part)) for part in model.geom_rgba[g, :3])
        body = model.body(int(model.geom_bodyid[g])).name
        found.append(Part(body, f"geom_{g}", vertices.astype(np.float32), shape[1].astype(np.uint32), colour, robot))
    return found


def _mesh(model: mujoco.MjModel, g: int) -> tuple[np.ndarray, np.ndarray]:
    mesh = int(model.geom_dataid[g])
    first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    face, faces = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
    return simplified(model.mesh_vert[first : first + count], model.mesh_face[face : face + faces], MERGE_DISTANCE)


def simplified(vertices: np.ndarray, faces: np.ndarray, cell: float) -> tuple[np.ndarray, np.ndarray]:
    """A mesh whose vertices within a cell of a grid are one, at their mean.

    Args:
        vertices: Shape (n, 3), [m].
        faces: Shape (m, 3).
        cell: Edge of a cell [m].

    Source:
        Rossignac and Borrel 1993, "Multi-resolution 3D approximations for rendering complex scenes".
    """
    _, which = np.unique(np.floor(vertices / cell).astype(np.int64), axis=0, return_inverse=True)
    which = which.ravel()
    count = np.bincount(which)
    means = np.stack([np.bincount(which, axis) / count for axis in vertices.T], axis=1)
    faces = which[faces]
    edges = [faces[:, i] != faces[:, j] for i, j in ((0, 1), (1, 2), (2, 0))]
    return means, np.unique(faces[np.logical_and.reduce(edges)], axis=0)


def coarser(mj: mujoco.MjSpec, model: mujoco.MjModel) -> mujoco.MjSpec:
    """Robot with large meshes made coarser, as they are in the compiled model."""
    R = np.empty(9)
    for mesh in mj.meshes:
        number = model.mesh(mesh.name).id
        first, count = model.mesh_vertadr[number], model.mesh_vertnum[number]
        face, faces = model.mesh_faceadr[number], model.mesh_facenum[number]
        # MuJoCo has turned and moved them to the mesh's axes of inertia.
        mujoco.mju_quat2Mat(R, model.mesh_quat[number])
        vertices = model.mesh_vert[first : first + count] @ R.reshape(3, 3).T + model.mesh_pos[number]
        cell = CELLS * float(np.ptp(vertices, axis=0).max())
        points, triangles = simplified(vertices, model.mesh_face[face : face + faces], cell)
        if len(triangles) < 0.5 * faces:
            mesh.file, mesh.scale = "", [1.0, 1.0, 1.0]
            mesh.uservert, mesh.userface = points.ravel().tolist(), triangles.ravel().tolist()
    return mj


def _primitive(model: mujoco.MjModel, g: int) -> tuple[np.ndarray, np.ndarray] | None:
    """Box, sphere, capsule, cylinder or ellipsoid as a mesh; None for what is not drawn."""
    import trimesh

    kind, size = mujoco.mjtGeom(int(model.geom_type[g])), model.geom_size[g]
    Geom = mujoco.mjtGeom
    if kind == Geom.mjGEOM_BOX:
        mesh = trimesh.creation.box(2.0 * size)
    elif kind in (Geom.mjGEOM_SPHERE, Geom.mjGEOM_ELLIPSOID):
        mesh = trimesh.creation.icosphere(3)
        mesh.vertices = mesh.vertices * (size if kind == Geom.mjGEOM_ELLIPSOID else size[0])
    elif kind == Geom.mjGEOM_CYLINDER:
        mesh = trimesh.creation.cylinder(size[0], 2.0 * size[1])
    elif kind == Geom.mjGEOM_CAPSULE:
        mesh = trimesh.creation.capsule(2.0 * size[1], size[0])
    else:
        return None
    return np.asarray(mesh.vertices), np.asarray(mesh.faces)
