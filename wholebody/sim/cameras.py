"""What the robot's cameras see in the simulation, drawn by a child process while a policy runs.

As for videos (`wholebody.sim.pictures.render`), a child process draws, since OpenGL that is missing can end a process.
``python -m wholebody.sim.cameras REQUEST`` is that child: it reads positions from standard input, as many numbers as
the first one says, and writes pixels to standard output.

The head's camera is the D435 of the robot's description. The G1 comes without cameras at its wrists: where these are is
a choice of ours, above the wrist, looking along the fingers. A policy that was trained with others sees other pictures.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from wholebody.errors import RenderError
from wholebody.sim.opengl import LIBRARIES, lit, plain

if TYPE_CHECKING:
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
BALL = 0.03
"""Radius of a ball that is shown [m]; chosen: the distance within which a goal is reached."""
COLOURS = ((0.9, 0.2, 0.15, 1.0), (0.15, 0.4, 0.9, 1.0))
"""Colours of the balls, red first: red, green, blue and opacity [no unit]; chosen: far from grey and brown."""


class DrawingProcess:
    """Draws what cameras see of a robot that somebody else simulates; close it.

    Args:
        joints: Names of the robot's joints.
        scene: Around it.
        sizes: Height and width by camera, of those in `MOUNTS` [px].
        marks: How many balls are shown beside what there is.

    Raises:
        RenderError: If a camera is unknown, or no OpenGL back end works here, with the packages that are missing.
    """

    def __init__(self, joints: Sequence[str], scene: str, sizes: Mapping[str, tuple[int, int]], marks: int = 0) -> None:
        self.sizes = {name: (int(height), int(width)) for name, (height, width) in sizes.items()}
        for name in self.sizes.keys() - MOUNTS.keys():
            raise RenderError(f"there is no camera '{name}'; there are {', '.join(MOUNTS)}")
        request = json.dumps({"scene": scene, "joints": list(joints), "sizes": self.sizes, "marks": marks})
        reasons = []
        for backend, packages in LIBRARIES.items():
            self._child = subprocess.Popen(
                [sys.executable, "-m", "wholebody.sim.cameras", request],
                env={**os.environ, "MUJOCO_GL": backend},
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                start_new_session=True,
            )
            if self._child.stdout.read(len(READY)) == READY:
                return
            lines = self._child.communicate()[1].decode(errors="replace").strip().splitlines()
            reasons.append(f"{backend} (Debian packages: {packages}): {lines[-1] if lines else 'it ended at once'}")
        raise RenderError("no OpenGL here to draw what cameras see; install one of: " + "; ".join(reasons))

    def draw(self, positions: np.ndarray, marks: np.ndarray | None = None) -> dict[str, np.ndarray]:
        """Images (height, width, 3) by camera, uint8, RGB.

        Args:
            positions: Of MuJoCo's joints, shape (nq,); or base position, quaternion wxyz, joints in motor order and
                poses of the scene's bodies that move.
            marks: Where balls are shown, shape (marks, 3), [m].

        Raises:
            RenderError: If the child process ended.
        """
        message = np.hstack(
            [np.asarray(part, dtype=float).ravel() for part in (positions, () if marks is None else marks)]
        )
        try:
            self._child.stdin.write(np.array([len(message)], dtype=float).tobytes() + message.tobytes())
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
        for pipe in (self._child.stdin, self._child.stdout, self._child.stderr):
            with suppress(BrokenPipeError):
                pipe.close()
        self._child.wait()


class RenderedCameras(DrawingProcess):
    """Pictures of the present moment of a plant; call it for them, and close it.

    Args:
        plant: Whose present moment.
        scene: Scene that the plant was made with.
        sizes: Height and width by camera, of those in `MOUNTS` [px].

    Raises:
        RenderError: If no OpenGL back end works here, with the packages that are missing.
    """

    def __init__(self, plant: MujocoPlant, scene: str, sizes: Mapping[str, tuple[int, int]]) -> None:
        super().__init__(plant.spec.joint_names, scene, sizes)
        self.plant = plant

    def __call__(self) -> dict[str, np.ndarray]:
        """Images (height, width, 3) by camera, uint8, RGB.

        Raises:
            RenderError: If the child process ended.
        """
        return self.draw(self.plant.data.qpos)

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


def _draw(scene: str, joints: list[str], sizes: Mapping[str, Sequence[int]], marks: int) -> None:
    import mujoco

    from models.moving_bodies import moving_joints, put
    from models.mujoco_model import BASE_JOINT

    model = _model(scene, joints, sizes, marks)
    data = mujoco.MjData(model)
    moving, motors = moving_joints(model), [model.joint(name).qposadr[0] for name in joints]
    base = model.joint(BASE_JOINT).qposadr[0]
    renderers = {size: plain(mujoco.Renderer(model, *size)) for size in {tuple(size) for size in sizes.values()}}
    read, write = sys.stdin.buffer, sys.stdout.buffer
    write.write(READY)
    write.flush()
    while len(head := read.read(8)) == 8:
        numbers = np.frombuffer(read.read(8 * int(np.frombuffer(head)[0]))).copy()
        numbers, balls = np.split(numbers, [len(numbers) - 3 * marks])
        data.mocap_pos[:marks] = balls.reshape(-1, 3)
        if len(numbers) == model.nq:
            data.qpos[:] = numbers
        else:
            data.qpos[base : base + 7], data.qpos[motors] = numbers[:7], numbers[7 : 7 + len(joints)]
            put(model, data.qpos, moving, numbers[7 + len(joints) :].reshape(-1, 7))
        mujoco.mj_kinematics(model, data)
        mujoco.mj_camlight(model, data)
        for name, size in sizes.items():
            renderers[tuple(size)].update_scene(data, f"view_{name}")
            write.write(renderers[tuple(size)].render().tobytes())
        write.flush()


def _model(scene: str, joints: list[str], sizes: Mapping[str, Sequence[int]], marks: int) -> mujoco.MjModel:
    """Model that is drawn: robot and scene with fewer triangles, cameras and balls."""
    from models.mujoco_model import build_mujoco
    from models.robots import robot_with
    from wholebody.sim.pictures.meshes import coarser
    from wholebody.sim.scene_file import scene_of

    def build() -> mujoco.MjSpec:
        return build_mujoco(robot_with(joints), scene=scene_of(scene), visuals=True)

    mj = coarser(lit(build()), build().compile())
    for name in sizes:
        _add_camera(mj, name)
    for number in range(marks):
        _add_ball(mj, number)
    mj.visual.quality.offsamples = 0  # smooth edges take a third of the time
    mj.visual.global_.offheight = max(height for height, _ in sizes.values())
    mj.visual.global_.offwidth = max(width for _, width in sizes.values())
    return mj.compile()


def _add_ball(mj: mujoco.MjSpec, number: int) -> None:
    import mujoco

    ball, colour = mj.worldbody.add_body(name=f"mark_{number}", mocap=True), COLOURS[number % len(COLOURS)]
    ball.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[BALL, 0.0, 0.0], rgba=colour, contype=0, conaffinity=0)


if __name__ == "__main__":
    _draw(**json.loads(sys.argv[1]))
