"""Video and contact sheet of a recorded run.

Drawing happens in a child process: with a wrong ``MUJOCO_GL`` already ``import mujoco`` can end the process, and the
choice of the library is made at import. ``python -m wholebody.sim.render RECORDING OUTPUT`` is that child.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np

from wholebody.errors import RenderError

WIDTH, HEIGHT, FPS, SHEET_FRAMES = 640, 480, 30, 6
LIBRARIES = {"egl": "libegl1 libegl-mesa0 libgl1-mesa-dri libgl1", "osmesa": "libosmesa6"}
"""OpenGL back ends in the order they are tried, with the Debian packages they need."""


def render(recording: str | Path, output: str | Path, *, timeout: float = 600.0) -> None:
    """Draw a recording as a video (.mp4) or as a sheet of six frames (.png).

    Args:
        recording: File written by `Recorder.save`.
        output: Where to; the ending says what.
        timeout: Longest time for one back end [s].

    Raises:
        RenderError: If no OpenGL back end works here, with the packages that are missing.
    """
    if Path(output).suffix not in (".mp4", ".png"):
        raise RenderError(f"cannot render to '{output}': the ending must be .mp4 (video) or .png (sheet of six frames)")
    reasons = []
    for backend, packages in LIBRARIES.items():
        command = [sys.executable, "-m", "wholebody.sim.render", str(recording), str(output)]
        try:
            child = subprocess.run(
                command,
                env={**os.environ, "MUJOCO_GL": backend},
                capture_output=True,
                text=True,
                timeout=timeout,
                check=False,
            )
        except subprocess.TimeoutExpired:
            reasons.append(f"{backend}: took longer than {timeout:.0f} s")
            continue
        if child.returncode == 0:
            return
        last = child.stderr.strip().splitlines()[-1:] or [f"ended with code {child.returncode}"]
        reasons.append(f"{backend} (Debian: {packages}): {last[0]}")
    raise RenderError("no OpenGL here to render with; install one of: " + "; ".join(reasons))


def _draw(recording: Path, output: Path) -> None:
    with np.load(recording, allow_pickle=False) as data:
        columns = {name: data[name] for name in ("time", "q", "T_world_palms", "joint_names", "scene")}
    every = max(1, round(1.0 / (FPS * float(np.median(np.diff(columns["time"]))))))
    rows = np.arange(0, len(columns["time"]), every)
    if output.suffix == ".png":
        rows = np.linspace(0, len(columns["time"]) - 1, SHEET_FRAMES).astype(int)
    frames = _frames(columns, rows)
    import imageio.v3 as iio

    if output.suffix == ".mp4":
        iio.imwrite(output, np.stack(list(frames)), fps=FPS, codec="libx264")
        return
    tiles = list(frames)
    half = SHEET_FRAMES // 2
    iio.imwrite(output, np.vstack([np.hstack(tiles[:half]), np.hstack(tiles[half:])]))


def _frames(columns: dict[str, np.ndarray], rows: np.ndarray):
    """Images (HEIGHT, WIDTH, 3) of the rows."""
    import mujoco

    from models.conversion import Conversion
    from models.g1 import g1
    from models.mujoco_model import load_mujoco
    from models.pinocchio_model import load_pinocchio

    spec = g1(hands=any("_hand_" in name for name in columns["joint_names"]))
    pin_model = load_pinocchio(spec)
    model = load_mujoco(spec, scene=str(columns["scene"]), visuals=True)
    data, conversion = mujoco.MjData(model), Conversion(spec, pin_model, model)
    camera = mujoco.MjvCamera()
    camera.lookat[:], camera.distance, camera.azimuth, camera.elevation = (0.15, 0.0, 0.70), 2.6, 150.0, -12.0
    with mujoco.Renderer(model, HEIGHT, WIDTH) as renderer:
        flags = renderer.scene.flags
        flags[mujoco.mjtRndFlag.mjRND_SHADOW] = flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = 0
        mujoco.mj_resetDataKeyframe(model, data, 0)
        v = np.zeros(pin_model.nv)
        for row in rows:
            conversion.to_mujoco(columns["q"][row], v, data.qpos, data.qvel)
            mujoco.mj_forward(model, data)
            renderer.update_scene(data, camera)
            _add_targets(renderer.scene, columns["T_world_palms"][row])
            yield renderer.render().copy()


def _add_targets(scene, palms: np.ndarray) -> None:
    """Small spheres where the palms are commanded to be: left red, right blue."""
    import mujoco

    for T, colour in zip(palms, ((0.9, 0.2, 0.2, 0.7), (0.2, 0.3, 0.9, 0.7)), strict=True):
        if scene.ngeom < scene.maxgeom:
            geom = scene.geoms[scene.ngeom]
            size, sphere = np.full(3, 0.025), mujoco.mjtGeom.mjGEOM_SPHERE
            mujoco.mjv_initGeom(geom, sphere, size, T[:3, 3], np.eye(3).ravel(), np.array(colour, dtype=np.float32))
            scene.ngeom += 1


if __name__ == "__main__":
    _draw(Path(sys.argv[1]), Path(sys.argv[2]))
