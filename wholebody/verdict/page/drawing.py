"""The robot and its scene for a page: meshes and marks as K3D has them, and the tree of bodies that moves them."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from models.scenes import SceneFile
from models.spec import RobotSpec
from wholebody.sim.pictures.meshes import parts
from wholebody.sim.pictures.scene import Colour, Show, on_floor
from wholebody.verdict.page.reach_layer import box

CAMERA = (1.85, 1.2, 1.3, 0.08, 0.0, 0.7, 0.0, 0.0, 1.0)
"""Camera of the page at first: place, what it looks at, and what is up [m]; chosen: robot and both palms in the
picture."""
FIELD_OF_VIEW = 40.0
"""Field of view of the camera [deg]; chosen: little distortion."""
GRID, GRID_CELL = 1.5, 0.25
"""Half the edge of the grid on the floor and its cell [m]; chosen."""
REACH_COLOUR: Colour = (0.20, 0.60, 0.62, 0.18)
"""Colour of the border of where palms can be held."""
CORNERS = 24
"""Corners of what is round."""


def tree(model: mujoco.MjModel) -> list[dict[str, Any]]:
    """How bodies hang on each other: frame in the parent's, and joints with axis, point and index of their value."""
    bodies = []
    for b in range(1, model.nbody):
        first, count = int(model.body_jntadr[b]), int(model.body_jntnum[b])
        joints = [
            {
                "kind": int(model.jnt_type[j]),
                "at": int(model.jnt_qposadr[j]),
                "axis": model.jnt_axis[j].tolist(),
                "point": model.jnt_pos[j].tolist(),
                "zero": float(model.qpos0[model.jnt_qposadr[j]]),
            }
            for j in range(first, first + count)
        ]
        frame = {"position": model.body_pos[b].tolist(), "quat": model.body_quat[b].tolist()}
        bodies.append(
            {"name": model.body(b).name, "parent": int(model.body_parentid[b]) - 1, **frame, "joints": joints}
        )
    return bodies


def snapshot(
    spec: RobotSpec,
    scene: str | SceneFile,
    support: Sequence[np.ndarray],
    palms: dict[str, np.ndarray],
    reach: Sequence[np.ndarray],
) -> tuple[bytes, dict]:
    """What K3D draws.

    Args:
        spec: The robot.
        scene: Around it.
        support: Polygons that the robot stands on, shape (c, 2) each, [m].
        palms: Ways of the palms, (n, 2, 3) each, [m], by the name of the mark.
        reach: Where the left and the right palm can be held, as of `reach_fields`.

    Returns:
        K3D's snapshot, and for each name of a body or a mark the numbers of its objects.
    """
    import k3d

    plot = k3d.plot(
        camera=list(CAMERA), camera_mode="orbit", camera_fov=FIELD_OF_VIEW, camera_auto_fit=False, grid_visible=False,
        menu_visibility=False, axes_helper=0, lighting=1.6, background_color=0xFFFFFF, fps_meter=False,
    )  # fmt: skip
    names: dict[str, list[int]] = defaultdict(list)

    def add(name: str, drawable: Any) -> None:
        names[name].append(drawable.id)
        plot.__iadd__(drawable)

    for part in parts(spec, scene):
        colour = (part.colour[0] << 16) + (part.colour[1] << 8) + part.colour[2]
        mesh = k3d.mesh(
            *_creased(part.vertices, part.faces), color=colour, flat_shading=False, side="double", roughness=0.55
        )
        add(("" if part.robot else "scene:") + part.body, mesh)
    for name, (vertices, faces, colour) in _marks(support).items():
        mesh = k3d.mesh(vertices, faces, color=_number(colour), opacity=colour[3], flat_shading=False, side="double")
        add(f"mark:{name}", mesh)
    for name, way in palms.items():
        for side in range(2):
            points = way[np.isfinite(way[:, side]).all(axis=1), side].astype(np.float32)
            if len(points) > 1:
                colour = _number(Show[name.upper()].colour) if name.upper() in Show.__members__ else 0x808890
                add(f"way:{name}", k3d.line(points, color=colour, shader="simple", opacity=0.8))
    for side, field in enumerate(reach):
        ends = dict(zip(("xmin", "xmax", "ymin", "ymax", "zmin", "zmax"), box(side), strict=True))
        colour = {"color": _number(REACH_COLOUR), "opacity": REACH_COLOUR[3]}
        add("reach", k3d.marching_cubes(field.astype(np.float32), level=0.0, flat_shading=False, **colour, **ends))
    add("grid", k3d.lines(*_grid(), indices_type="segment", shader="simple", color=0x8A93A0, opacity=0.35))
    return plot.get_binary_snapshot(), dict(names)


def _creased(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mesh with a vertex for each direction in which its faces look: light is smooth along a face, not over edges.

    Thin shells, whose two sides meet in a vertex, have no normal there otherwise.
    """
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    side = np.argmax(np.abs(normal), axis=1)
    side = 2 * side + (np.take_along_axis(normal, side[:, None], axis=1)[:, 0] < 0.0)
    keys, which = np.unique(6 * faces.astype(np.int64) + side[:, None], return_inverse=True)
    return vertices[keys // 6], which.reshape(faces.shape).astype(np.uint32)


def _number(colour: Colour) -> int:
    red, green, blue = (round(255 * part) for part in colour[:3])
    return (red << 16) + (green << 8) + blue


def _marks(support: Sequence[np.ndarray]) -> dict[str, tuple[np.ndarray, np.ndarray, Colour]]:
    """Shapes that are moved where they belong: of unit size, but for the support, which stays."""
    ball, disc, stick = _ball(), _disc(), _stick()
    begins = np.cumsum([0, *map(len, support)])
    fans = [[k, k + i, k + i + 1] for k, one in zip(begins, support, strict=False) for i in range(1, len(one) - 1)]
    corners = on_floor(np.concatenate(support)).astype(np.float32)
    shapes = {"support": (corners, np.array(fans, dtype=np.uint32), Show.SUPPORT.colour)}
    for side in ("left", "right"):
        shapes[f"asked_{side}"] = (*ball, (*Show.ASKED.colour[:3], 0.75))
        shapes[f"commanded_{side}"] = (*ball, Show.COMMANDED.colour)
        shapes[f"error_{side}"] = (*stick, Show.ERROR.colour)
    return shapes | {
        "pressure": (*disc, (0.90, 0.10, 0.45, 1.0)),
        "capture": (*disc, Show.CAPTURE.colour),
        "mass": (*ball, Show.MASS.colour),
        "plumb": (*stick, Show.MASS.colour),
    }


def _disc() -> tuple[np.ndarray, np.ndarray]:
    angle = np.linspace(0.0, 2.0 * np.pi, CORNERS, endpoint=False)
    rim = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(CORNERS)])
    faces = [[CORNERS, i, (i + 1) % CORNERS] for i in range(CORNERS)]
    return np.vstack([rim, np.zeros(3)]).astype(np.float32), np.array(faces, dtype=np.uint32)


def _ball() -> tuple[np.ndarray, np.ndarray]:
    half = CORNERS // 2
    up, around = np.meshgrid(
        np.linspace(0.0, np.pi, half + 1), np.linspace(0.0, 2.0 * np.pi, CORNERS + 1), indexing="ij"
    )
    points = np.stack([np.sin(up) * np.cos(around), np.sin(up) * np.sin(around), np.cos(up)], axis=-1)
    return points.reshape(-1, 3).astype(np.float32), _strips(half, CORNERS)


def _stick() -> tuple[np.ndarray, np.ndarray]:
    """A tube about z from 0 to 1, of radius 1."""
    angle = np.linspace(0.0, 2.0 * np.pi, CORNERS + 1)
    rim = np.column_stack([np.cos(angle), np.sin(angle)])
    ends = [np.column_stack([rim, np.full(len(rim), z)]) for z in (0.0, 1.0)]
    return np.vstack(ends).astype(np.float32), _strips(1, CORNERS)


def _strips(rows: int, columns: int) -> np.ndarray:
    """Triangles of a grid of (rows + 1) (columns + 1) points."""
    i, j = np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij")
    a = (i * (columns + 1) + j).ravel()
    b, c, d = a + 1, a + columns + 1, a + columns + 2
    return np.vstack([np.column_stack([a, c, b]), np.column_stack([b, c, d])]).astype(np.uint32)


def _grid() -> tuple[np.ndarray, np.ndarray]:
    at = np.arange(-GRID, GRID + 1e-9, GRID_CELL)
    ends = np.array([[[x, -GRID, 0], [x, GRID, 0]] for x in at] + [[[-GRID, y, 0], [GRID, y, 0]] for y in at])
    return ends.reshape(-1, 3).astype(np.float32), np.arange(2 * len(ends), dtype=np.uint32).reshape(-1, 2)
