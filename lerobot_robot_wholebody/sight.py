"""What the robot's cameras see, drawn in a process of its own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from lerobot_robot_wholebody.config_wholebody_g1 import WholebodyCameraConfig
from models import g1
from policy.geometry.rotations import matrix_to_quaternion
from wholebody.live.served.messages import Seen
from wholebody.sim.cameras import DrawingProcess


class Cameras:
    """Cameras of a robot; a robot without cameras starts no process.

    Args:
        scene: Around the robot.
        cameras: Their settings by name.
        marks: How many balls are shown.

    Raises:
        RenderError: If a camera is unknown, or there is no OpenGL here, with the packages that are missing.
    """

    def __init__(self, scene: str, cameras: Mapping[str, WholebodyCameraConfig], marks: int) -> None:
        sizes = {name: (camera.height, camera.width) for name, camera in cameras.items()}
        self._process = DrawingProcess(g1().joint_names, scene, sizes, marks) if sizes else None

    def look(self, seen: Seen, marks: Sequence[np.ndarray]) -> dict[str, np.ndarray]:
        """Pictures by camera, uint8 (height, width, 3), of a moment with balls at positions (3,) in world [m].

        Raises:
            RenderError: If the process that draws ended.
        """
        if self._process is None:
            return {}
        now = seen.observation
        T = now.T_world_base
        quaternion = np.roll(matrix_to_quaternion(T[:3, :3], "xyzw"), 1)
        pose = (T[:3, 3], quaternion, now.q_body, now.q_lhand, now.q_rhand, seen.objects.ravel())
        return self._process.draw(np.hstack(pose), np.array(marks))

    def close(self) -> None:
        """End the process."""
        if self._process is not None:
            self._process.close()
