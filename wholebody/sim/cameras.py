"""What the robot's cameras see in the simulation, drawn by a child process while a policy runs.

As for videos (`wholebody.sim.pictures.render`), a child process draws, since OpenGL that is missing can end a process.
``python -m wholebody.sim.cameras REQUEST`` is that child: it reads positions of MuJoCo's joints from standard input and
writes pixels to standard output.

The head's camera is the D435 of the robot's description. The G1 comes without cameras at its wrists: where these are is
a choice of ours, above the wrist, looking along the fingers. A policy that was trained with others sees other pictures.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from wholebody.errors import RenderError
from wholebody.sim.opengl import LIBRARIES, lit, plain

if TYPE_CHECKING:
    from collections.abc import Iterable

    import mujoco

    from wholebody.sim.plant import MujocoPlant

READY = b"ready\n"


@dataclass(frozen=True)
class Mount:
    """A camera on a body, looking along the body's x axis.

    Attributes:
        body: Body of the robot.
        position: In the body's frame [m].
        pitch: Turned down by this about the body's y axis [rad].
        fovy: Vertical field of view [deg].
    """

    body: str
    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    pitch: float = 0.0
    fovy: float = 42.0


MOUNTS = {
    # Field of view of the colour camera: data sheet of the RealSense D400 series.
    "head": Mount("d435_link", (0.02, 0.0, 0.0)),
    "left_wrist": Mount("left_wrist_yaw_link", (0.03, 0.0, 0.09), 0.7, 58.0),
    "right_wrist": Mount("right_wrist_yaw_link", (0.03, 0.0, 0.09), 0.7, 58.0),
}
"""Cameras by name [m, rad, deg]; the wrists' are chosen."""


class RenderedCameras:
    """Pictures of the present moment of a plant; call it for them, and close it.

    Args:
        plant: Whose present moment.
        scene: Scene that the plant was made with.
        sizes: Height and width by camera, of those in `MOUNTS` [px].

    Raises:
        RenderError: If no OpenGL back end works here, with the packages that are missing.
    """

    def __init__(self, plant: MujocoPlant, scene: str, sizes: Mapping[str, tuple[int, int]]) -> None:
        self.plant, self.sizes = plant, {name: (int(height), int(width)) for name, (height, width) in sizes.items()}
        request = json.dumps({"scene": scene, "joints": plant.spec.joint_names, "sizes": self.sizes})
        reasons = []
        for backend, packages in LIBRARIES.items():
            self._child = subprocess.Popen(
                [sys.executable, "-m", "wholebody.sim.cameras", request],
                env={**os.environ, "MUJOCO_GL": backend},
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
            )
            if self._child.stdout.read(len(READY)) == READY:
                return
            said = self._child.communicate()[1].decode(errors="replace").strip().splitlines()
            reasons.append(f"{backend} (Debian packages: {packages}): {said[-1] if said else 'it ended at once'}")
        raise RenderError("no OpenGL here to draw what cameras see; install one of: " + "; ".join(reasons))

    def __call__(self) -> dict[str, np.ndarray]:
        """Images (height, width, 3) by camera, uint8, RGB.

        Raises:
            RenderError: If the child process ended.
        """
        try:
            self._child.stdin.write(np.asarray(self.plant.data.qpos, dtype=float).tobytes())
            self._child.stdin.flush()
            images = {}
            for name, (height, width) in self.sizes.items():
                pixels = self._child.stdout.read(height * width * 3)
                images[name] = np.frombuffer(pixels, dtype=np.uint8).reshape(height, width, 3)
        except (OSError, ValueError) as error:
            raise RenderError("the process that draws what cameras see has ended") from error
        return images

    def close(self) -> None:
        """End the child process."""
        self._child.stdin.close()
        self._child.stdout.close()
        self._child.stderr.close()
        self._child.wait()

    def __enter__(self) -> RenderedCameras:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _add_camera(mj: mujoco.MjSpec, name: str) -> None:
    mount = MOUNTS[name]
    body = mj.body(mount.body)
    sine, cosine = np.sin(mount.pitch), np.cos(mount.pitch)
    # MuJoCo's camera looks along its -z, its y is up: x ahead of the body is -z, turned down by the pitch.
    right, back = np.array([0.0, -1.0, 0.0]), np.array([-cosine, 0.0, sine])
    axes = (*right, *np.cross(back, right))
    body.add_camera(name=f"view_{name}", pos=mount.position, xyaxes=axes, fovy=mount.fovy)


def _draw(scene: str, joints: list[str], sizes: Mapping[str, Iterable[int]]) -> None:
    import mujoco

    from models.mujoco_model import build_mujoco
    from models.robots import robot_with
    from wholebody.sim.scene_file import scene_of

    mj = lit(build_mujoco(robot_with(joints), scene=scene_of(scene), visuals=True))
    for name in sizes:
        _add_camera(mj, name)
    mj.visual.global_.offheight = max(height for height, _ in sizes.values())
    mj.visual.global_.offwidth = max(width for _, width in sizes.values())
    model = mj.compile()
    data = mujoco.MjData(model)
    renderers = {name: plain(mujoco.Renderer(model, *size)) for name, size in sizes.items()}
    sys.stdout.buffer.write(READY)
    sys.stdout.buffer.flush()
    while len(positions := sys.stdin.buffer.read(data.qpos.nbytes)) == data.qpos.nbytes:
        data.qpos[:] = np.frombuffer(positions)
        mujoco.mj_forward(model, data)
        for name, renderer in renderers.items():
            renderer.update_scene(data, f"view_{name}")
            sys.stdout.buffer.write(renderer.render().tobytes())
        sys.stdout.buffer.flush()


if __name__ == "__main__":
    _draw(**json.loads(sys.argv[1]))
