"""Scenes drawn by MuJoCo, with a caption and a legend: ``python -m wholebody.sim.pictures.drawing RECORD OUTPUT``.

A process of its own, started by `wholebody.sim.pictures.render`. It writes a line to standard output after every frame:
how many are done, and how many there are.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from wholebody.sim.opengl import lit, plain
from wholebody.sim.pictures.caption import captioned, legend
from wholebody.sim.pictures.moments import moments
from wholebody.sim.pictures.scene import SCENE_COLUMNS, SIDES, Mark, MarkKind, Scene, scene_at
from wholebody.sim.record import Record, read_record

if TYPE_CHECKING:
    import mujoco

    from models.spec import RobotSpec

WIDTH, HEIGHT, FPS, SHEET_FRAMES = 640, 480, 30, 6
GIF_WIDTH, GIF_FPS, GIF_COLOURS = 400, 8, 128
"""Width [px], pictures a second [Hz] and colours of an animation; chosen: ten seconds in half a megabyte."""
LOOK_AT, DISTANCE, AZIMUTH, ELEVATION = (0.14, 0.0, 0.64), 2.0, 212.0, -14.0
"""View from the front left, far enough for a robot of 1.3 m that stands or squats [m], [deg]."""
FURTHEST, HAND = 3.2, 0.15
"""Most distance of the camera, and what is to be seen around a palm [m]; chosen: a hand that is further up or aside is
cut off, rather than the robot become small."""
NEAR, GOES_OVER = 0.5, 1.0
"""Way from the origin up to which a robot that walks comes nearer to a camera that stays [m], and time over which the
rest of its way is averaged for the camera [s]; chosen: further on its feet are out of the picture, which is not to sway
with each step."""


def main(recording: Path, output: Path) -> None:
    """Draw a sheet (.png), an animation (.gif) or a video."""
    import imageio.v2 as iio

    record = read_record(recording, SCENE_COLUMNS)
    if output.suffix == ".png":
        chosen = moments(record, SHEET_FRAMES)
        tiles = list(frames(record, [moment.row for moment in chosen], [moment.why for moment in chosen]))
        tiles += [np.full_like(tiles[0], 255)] * (SHEET_FRAMES - len(tiles))
        half = SHEET_FRAMES // 2
        iio.imwrite(output, np.vstack([np.hstack(tiles[:half]), np.hstack(tiles[half:]), legend(half * WIDTH)]))
        return
    time, fps = record["time"], GIF_FPS if output.suffix == ".gif" else FPS
    times = np.arange(time[0], time[-1] + 1e-9, 1.0 / fps)
    rows = np.searchsorted(time, times - 1e-9).clip(0, len(record) - 1)
    colours = legend(WIDTH)
    if output.suffix == ".gif":
        _write_gif(output, list(frames(record, rows)), colours)
        return
    with iio.get_writer(output, fps=FPS, codec="libx264", macro_block_size=16) as writer:
        for frame in frames(record, rows):
            writer.append_data(np.vstack([frame, colours]))


def _write_gif(output: Path, pictures: list[np.ndarray], colours: np.ndarray) -> None:
    """Write pictures above a legend as an animation of some colours, which browsers show without being asked."""
    from PIL import Image

    # The legend many times over: its colours are to be among those.
    palette = Image.fromarray(np.vstack([pictures[len(pictures) // 2], *[colours] * 8])).quantize(GIF_COLOURS)
    first, *rest = (
        Image.fromarray(whole)
        .resize((GIF_WIDTH, GIF_WIDTH * len(whole) // WIDTH), Image.Resampling.LANCZOS)
        .quantize(palette=palette, dither=Image.Dither.NONE)
        for whole in (np.vstack([one, colours]) for one in pictures)
    )
    first.save(output, save_all=True, append_images=rest, duration=round(1e3 / GIF_FPS), loop=0)


def frames(record: Record, rows: Sequence[int], why: Sequence[str] = ()) -> Iterator[np.ndarray]:
    """Captioned pictures of control periods; ``why`` says of each why it is shown."""
    painter, way = Painter(record), camera_way(record)
    for done, row in enumerate(rows):
        scene = scene_at(record, int(row))
        yield captioned(painter.paint(scene, way[row]), scene, why[done] if why else "")
        print(done + 1, len(rows), flush=True)  # noqa: T201 - what the process that started this one reads


class Painter:
    """Draws scenes of one recording.

    Args:
        record: Says which robot and which surroundings.
    """

    def __init__(self, record: Record) -> None:
        import mujoco

        from models.conversion import Conversion
        from models.moving_bodies import moving_joints
        from models.pinocchio_model import load_pinocchio
        from models.robots import robot_with

        spec = robot_with(record["joint_names"].tolist())
        pin_model = load_pinocchio(spec)
        self._model = drawn_model(spec, str(record["scene"]))
        self._data, self._rest = mujoco.MjData(self._model), np.zeros(pin_model.nv)
        self._conversion = Conversion(spec, pin_model, self._model)
        self._moving = moving_joints(self._model)
        self._hands = {tool.side: _below(self._model, self._model.body(tool.wrist_frame).id) for tool in spec.tools}
        self._camera = mujoco.MjvCamera()
        self._look_at, self._camera.distance = view(record, float(self._model.vis.global_.fovy))
        self._camera.azimuth, self._camera.elevation = AZIMUTH, ELEVATION
        self._renderer = plain(mujoco.Renderer(self._model, HEIGHT, WIDTH))

    def paint(self, scene: Scene, way: np.ndarray | float = 0.0) -> np.ndarray:
        """Robot, objects and marks, shape (HEIGHT, WIDTH, 3), from a camera that has gone a way (3,) [m]."""
        import mujoco

        from models.moving_bodies import put

        data = self._data
        self._conversion.to_mujoco(scene.q, self._rest, data.qpos, data.qvel)
        put(self._model, data.qpos, self._moving, scene.objects)
        mujoco.mj_kinematics(self._model, data)
        mujoco.mj_camlight(self._model, data)
        self._camera.lookat[:] = self._look_at + way
        self._renderer.update_scene(data, self._camera)
        drawn = self._renderer.scene
        solid = [drawn.geoms[i] for i in range(drawn.ngeom)]
        for mark in scene.marks():
            if mark.kind is MarkKind.HAND:
                self._ghost(drawn, solid, mark, scene.measured[SIDES.index(mark.side)])
            else:
                draw_mark(drawn, mark)
        return self._renderer.render()

    def _ghost(self, drawn: mujoco.MjvScene, solid: list[mujoco.MjvGeom], mark: Mark, T_world_palm: np.ndarray) -> None:
        """Copies of what is drawn of a hand, moved along with its palm."""
        import mujoco

        T_there_here = mark.T_world_palm @ np.linalg.inv(T_world_palm)
        R, p = T_there_here[:3, :3], T_there_here[:3, 3]
        for geom in solid:
            if geom.objtype != mujoco.mjtObj.mjOBJ_GEOM:
                continue
            if int(self._model.geom_bodyid[geom.objid]) in self._hands[mark.side]:
                copy = _new_geom(drawn, geom.type, geom.size, R @ geom.pos + p, R @ geom.mat, mark.show.colour)
                if copy is not None:
                    copy.dataid, copy.matid = geom.dataid, -1


def drawn_model(spec: RobotSpec, scene: str) -> mujoco.MjModel:
    """Model that is drawn: robot and scene with light, and with fewer triangles than their meshes have."""
    from models.mujoco_model import build_mujoco
    from wholebody.sim.pictures.meshes import coarser
    from wholebody.sim.scene_file import scene_of

    def build() -> mujoco.MjSpec:
        return build_mujoco(spec, scene=scene_of(scene), visuals=True)

    return coarser(bright(lit(build())), build().compile()).compile()


def camera_way(record: Record) -> np.ndarray:
    """Way that the camera goes along with a robot that walks, at each control period, shape (n, 3), [m]."""
    soles, time = record["soles"].mean(axis=1), record["time"]
    far = np.linalg.norm(soles, axis=1, keepdims=True)
    away = soles * np.maximum(1.0 - NEAR / np.maximum(far, NEAR), 0.0)
    before, after = np.searchsorted(time, time - 0.5 * GOES_OVER), np.searchsorted(time, time + 0.5 * GOES_OVER)
    total = np.concatenate([np.zeros((1, 2)), np.cumsum(away, axis=0)])
    mean = (total[after] - total[before]) / (after - before)[:, None]
    return np.column_stack([mean, np.zeros(len(mean))])


def view(record: Record, fovy: float) -> tuple[np.ndarray, float]:
    """Where a camera looks, shape (3,), and from how far it sees feet and palms, measured and commanded [m].

    So it is seen from the origin; `camera_way` says how it goes along.

    Args:
        record: The recording.
        fovy: Angle between the lower and the upper edge of the picture [deg].
    """
    palms = np.stack([record[f"T_world_palms_{which}"][..., :3, 3] for which in ("measured", "commanded")])
    points = np.concatenate([(palms - camera_way(record)[:, None]).reshape(-1, 3), np.zeros((1, 3))])
    look_at = np.array([*LOOK_AT[:2], max(LOOK_AT[2], 0.5 * points[:, 2].max())])
    turn, lift = np.deg2rad((AZIMUTH, ELEVATION))
    ahead = np.array([np.cos(lift) * np.cos(turn), np.cos(lift) * np.sin(turn), np.sin(lift)])
    right = np.array([np.sin(turn), -np.cos(turn), 0.0])
    away = points - look_at
    aside, up = np.abs(away @ right) + HAND, np.abs(away @ np.cross(right, ahead)) + HAND
    needed = np.maximum(up, aside * HEIGHT / WIDTH) / np.tan(np.deg2rad(fovy / 2.0)) - away @ ahead
    return look_at, float(np.clip(needed.max(), DISTANCE, FURTHEST))


def draw_mark(drawn: mujoco.MjvScene, mark: Mark) -> None:
    """A mark as shapes of MuJoCo."""
    import mujoco

    kind, size, colour, points, flat = mujoco.mjtGeom, mark.size, mark.show.colour, mark.points, np.eye(3)
    match mark.kind:
        case MarkKind.BALL:
            _new_geom(drawn, kind.mjGEOM_SPHERE, np.full(3, size), points[0], flat, colour)
        case MarkKind.DISC:
            _new_geom(drawn, kind.mjGEOM_CYLINDER, np.array([size, size, 5e-4]), points[0], flat, colour)
        case MarkKind.LINE:
            _line(drawn, *points, size, colour)
        case MarkKind.AREA:
            for first, second in zip(points, np.roll(points, -1, axis=0), strict=True):
                _line(drawn, first, second, size, (*colour[:3], 1.0))
            for first, second in pairwise(points[1:]):
                _triangle(drawn, points[0], first, second, colour)


def _new_geom(
    drawn: mujoco.MjvScene, kind: int, size: np.ndarray, pos: np.ndarray, mat: np.ndarray, colour: Sequence[float]
) -> mujoco.MjvGeom | None:
    """One more shape; None where there is no room for it."""
    import mujoco

    if drawn.ngeom >= drawn.maxgeom:
        return None
    geom = drawn.geoms[drawn.ngeom]
    mujoco.mjv_initGeom(geom, kind, size, pos, np.asarray(mat, dtype=float).ravel(), np.array(colour, dtype=np.float32))
    drawn.ngeom += 1
    return geom


def _line(drawn: mujoco.MjvScene, first: np.ndarray, second: np.ndarray, size: float, colour: Sequence[float]) -> None:
    import mujoco

    geom = _new_geom(drawn, mujoco.mjtGeom.mjGEOM_CAPSULE, np.zeros(3), np.zeros(3), np.eye(3), colour)
    if geom is not None:
        mujoco.mjv_connector(geom, mujoco.mjtGeom.mjGEOM_CAPSULE, size, first, second)


def _triangle(drawn: mujoco.MjvScene, a: np.ndarray, b: np.ndarray, c: np.ndarray, colour: Sequence[float]) -> None:
    """MuJoCo's triangle has its corners at the origin and on the x and y axes of a frame that may be skewed."""
    import mujoco

    mat = np.column_stack([b - a, c - a, (0.0, 0.0, 1.0)])
    _new_geom(drawn, mujoco.mjtGeom.mjGEOM_TRIANGLE, np.ones(3), a, mat, colour)


def bright(mj: mujoco.MjSpec) -> mujoco.MjSpec:
    """Light from above, so that the floor is light as far as it goes."""
    import mujoco

    mj.worldbody.add_light(
        pos=(0.0, 0.0, 4.0),
        dir=(0.0, 0.0, -1.0),
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
        diffuse=(0.35, 0.35, 0.35),
        castshadow=False,
    )
    return mj


def _below(model: mujoco.MjModel, body: int) -> set[int]:
    """A body and all that hang on it."""
    found = {body}
    for other in range(body + 1, model.nbody):
        if int(model.body_parentid[other]) in found:
            found.add(other)
    return found


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
