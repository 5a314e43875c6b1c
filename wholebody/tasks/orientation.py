"""Keep a body (pelvis, torso) near a reference orientation."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wholebody.robot.state import Robot
from wholebody.tasks.base import Objective, limited


class OrientationTask:
    """Orientation of one body, in world axes.

    Args:
        frame: Name of the body frame.
        kp: Stiffness [1/s^2]. kd: Damping [1/s]. weight: [1/(rad/s^2)^2].
    """

    feedback_max = 20.0
    """Largest kp * error [rad/s^2]; chosen, no trial is on record."""

    def __init__(self, frame: str, *, kp: float, kd: float, weight: float) -> None:
        self.frame, self.kp, self.kd = frame, kp, kd
        self.weight = np.full(3, weight)
        self.bind(np.zeros(15))
        self.R_world_ref[:] = np.eye(3)

    def bind(self, memory: np.ndarray) -> None:
        """Read the reference from memory that the program shares: rotation (9), rate (3) and acceleration (3)."""
        self.R_world_ref, self.rate_ref, self.acceleration_ref = memory[:9].reshape(3, 3), memory[9:12], memory[12:]

    def objective(self, robot: Robot) -> Objective:
        """Objective with three rows."""
        error = pin.log3(self.R_world_ref @ robot.pose(self.frame).rotation.T)
        rate = robot.velocity(self.frame)[3:]
        wanted = self.acceleration_ref + limited(self.kp * error, self.feedback_max) + self.kd * (self.rate_ref - rate)
        return Objective(robot.jacobian(self.frame)[3:], wanted - robot.drift(self.frame)[3:], self.weight)
