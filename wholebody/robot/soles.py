"""Where the soles are, and how the floor lies under them, in a state of the robot."""

from __future__ import annotations

from math import atan2
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.robot.state import Robot


class SolePose(NamedTuple):
    """Pose of a sole that lies flat on what it stands on.

    Attributes:
        position: Middle of the sole in world, shape (3,), [m]; z is the height of the floor there.
        rotation: Its axes in world, shape (3, 3): x ahead, z away from the floor.
    """

    position: np.ndarray
    rotation: np.ndarray

    @property
    def normal(self) -> np.ndarray:
        """Normal of the floor under it in world, shape (3,), unit length."""
        return self.rotation[:, 2]

    @property
    def yaw(self) -> float:
        """Direction of its x axis about the vertical [rad]."""
        return atan2(self.rotation[1, 0], self.rotation[0, 0])


def sole_poses(robot: Robot, q: np.ndarray) -> tuple[SolePose, SolePose]:
    """Left and right sole in a configuration (nq,), by the angles of the legs; `robot` keeps its own.

    Of an estimated state these are the measured feet. An encoder's offset, or a tilt error of the IMU, is in them:
    an unlevel floor and an IMU that is not level cannot be told apart by them.
    """
    model, data = robot.model, robot.model.createData()
    pin.forwardKinematics(model, data, q)
    left, right = (
        pin.updateFramePlacement(model, data, robot.frame_id(foot.frame))
        * pin.SE3(np.eye(3), np.array(foot.sole_center))
        for foot in robot.spec.feet
    )
    return SolePose(left.translation, left.rotation), SolePose(right.translation, right.rotation)
