"""Video and contact sheet of a recorded run.

Drawing happens in a child process: with a wrong ``MUJOCO_GL`` already ``import mujoco`` can end the process, and the
choice of the library is made at import. ``python -m wholebody.sim.render RECORDING OUTPUT`` is that child.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import numpy as np

from wholebody.errors import InputError, RenderError

if TYPE_CHECKING:
    import mujoco

WIDTH, HEIGHT, FPS, SHEET_FRAMES = 640, 480, 30, 6
LIBRARIES = {"egl": "libegl1 libegl-mesa0 libgl1-mesa-dri libgl1", "osmesa": "libosmesa6"}
"""OpenGL back ends in the order they are tried, with the Debian packages they need."""

COLOURS = ((0.90, 0.15, 0.15, 0.8), (0.10, 0.35, 0.95, 0.8))
"""Of the left and right hand's target."""
TARGET_RADIUS = 0.02  # [m]
COLUMNS = ("time", "q", "T_world_palms", "status", "objects", "joint_names", "scene")


def render(recording: str | Path, output: str | Path, *, timeout: float = 600.0) -> None:
    """Draw a recording as a video (.mp4) or as a sheet of six frames (.png); broken off, it leaves no file.

    Args:
        recording: File written by `Recorder.save`.
        output: Where to; the ending says what.
        timeout: Longest time for one back end [s].

    Raises:
        InputError: If the ending is neither, or the recording is empty or missing.
        RenderError: If no OpenGL back end works here, with the packages that are missing.
    """
    check_output(output)
    if not Path(recording).is_file():
        raise InputError(f"there is no recording '{recording}'")
    reasons, output = [], Path(output)
    # Beside its place: a file system renames only within itself.
    with TemporaryDirectory(prefix=".drawing-", dir=output.absolute().parent) as folder:
        for backend, packages in LIBRARIES.items():
            drawn = Path(folder) / output.name
            reason = _child(backend, recording, drawn, timeout)
            if reason is None:
                drawn.replace(output)
                return
            reasons.append(f"{backend} (Debian packages: {packages}): {reason}")
    raise RenderError("no OpenGL here to render with; install one of: " + "; ".join(reasons))


def check_output(output: str | Path) -> None:
    """Refuse a file name that is neither video nor picture, before any work is done.

    Raises:
        InputError: With the endings that would do.
    """
    if Path(output).suffix not in (".mp4", ".png"):
        raise InputError(f"cannot render to '{output}': the ending must be .mp4 (video) or .png (sheet of six frames)")


def _child(backend: str, recording: str | Path, output: str | Path, timeout: float) -> str | None:
    """Draw in a process of its own; the reason if that failed, else None."""
    command = [sys.executable, "-m", "wholebody.sim.render", str(recording), str(output)]
    environment = {**os.environ, "MUJOCO_GL": backend}
    try:
        child = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=timeout, check=False)
    except subprocess.TimeoutExpired:
        return f"took longer than {timeout:.0f} s"
    if child.returncode == 0:
        return None
    return (child.stderr.strip().splitlines() or [f"ended with code {child.returncode}"])[-1]


def _draw(recording: Path, output: Path) -> None:
    import imageio.v2 as iio

    with np.load(recording, allow_pickle=False) as data:
        columns = {name: data[name] for name in COLUMNS}
    n = len(columns["time"])
    if output.suffix == ".png":
        tiles = list(_frames(columns, np.linspace(0, n - 1, SHEET_FRAMES).round().astype(int)))
        half = SHEET_FRAMES // 2
        iio.imwrite(output, np.vstack([np.hstack(tiles[:half]), np.hstack(tiles[half:])]))
        return
    times = np.arange(columns["time"][0], columns["time"][-1] + 1e-9, 1.0 / FPS)
    with iio.get_writer(output, fps=FPS, codec="libx264", macro_block_size=16) as writer:
        for frame in _frames(columns, np.searchsorted(columns["time"], times - 1e-9).clip(0, n - 1)):
            writer.append_data(frame)


def _frames(columns: dict[str, np.ndarray], rows: np.ndarray) -> Iterator[np.ndarray]:
    """Images (HEIGHT, WIDTH, 3) of the rows."""
    import mujoco

    from models.conversion import Conversion
    from models.g1 import g1
    from models.mujoco_model import build_mujoco
    from models.pinocchio_model import load_pinocchio

    spec = g1(hands=any("_hand_" in name for name in columns["joint_names"]))
    pin_model = load_pinocchio(spec)
    model = lit(build_mujoco(spec, scene=str(columns["scene"]), visuals=True)).compile()
    data, conversion = mujoco.MjData(model), Conversion(spec, pin_model, model)
    loose = [int(model.jnt_qposadr[j]) for j in np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE)][1:]
    camera = mujoco.MjvCamera()
    # From the front left, far enough for a robot of 1.3 m with its arms up or squatting.
    camera.lookat[:], camera.distance, camera.azimuth, camera.elevation = (0.12, 0.0, 0.66), 2.2, 215.0, -10.0
    with mujoco.Renderer(model, HEIGHT, WIDTH) as renderer:
        flags = renderer.scene.flags
        flags[mujoco.mjtRndFlag.mjRND_SHADOW] = flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = 0
        v = np.zeros(pin_model.nv)
        for row in rows:
            conversion.to_mujoco(columns["q"][row], v, data.qpos, data.qvel)
            for address, pose in zip(loose, columns["objects"][row], strict=True):
                data.qpos[address : address + 7] = pose
            mujoco.mj_forward(model, data)
            renderer.update_scene(data, camera)
            _add_targets(renderer.scene, columns["T_world_palms"][row])
            yield _labelled(renderer.render(), f"{columns['time'][row]:.2f} s  {columns['status'][row]}")


def lit(mj: mujoco.MjSpec) -> mujoco.MjSpec:
    """A bright sky and light from the camera, for looking at; physics does not change."""
    import mujoco

    mj.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=(0.62, 0.72, 0.82),
        rgb2=(0.90, 0.93, 0.96),
        width=256,
        height=256,
    )
    floor = mj.texture("checker")
    floor.rgb1, floor.rgb2 = (0.62, 0.65, 0.68), (0.52, 0.55, 0.58)
    mj.visual.headlight.ambient, mj.visual.headlight.diffuse = (0.35, 0.35, 0.35), (0.45, 0.45, 0.45)
    mj.visual.headlight.specular = (0.1, 0.1, 0.1)
    return mj


def _add_targets(scene: mujoco.MjvScene, palms: np.ndarray) -> None:
    """Small spheres where the palms are commanded to be."""
    import mujoco

    for T, colour in zip(palms, COLOURS, strict=True):
        if scene.ngeom < scene.maxgeom:
            geom = scene.geoms[scene.ngeom]
            size, sphere = np.full(3, TARGET_RADIUS), mujoco.mjtGeom.mjGEOM_SPHERE
            mujoco.mjv_initGeom(geom, sphere, size, T[:3, 3], np.eye(3).ravel(), np.array(colour, dtype=np.float32))
            scene.ngeom += 1


def _labelled(image: np.ndarray, text: str) -> np.ndarray:
    """A copy of the image with a line of text at its top left."""
    from PIL import Image, ImageDraw

    picture = Image.fromarray(image)
    ImageDraw.Draw(picture).text((12, 8), text, fill=(20, 24, 30), font_size=20)
    return np.asarray(picture)


if __name__ == "__main__":
    _draw(Path(sys.argv[1]), Path(sys.argv[2]))
