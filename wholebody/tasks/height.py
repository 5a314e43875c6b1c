"""Keep a body (the pelvis) near a reference height."""

from __future__ import annotations

import numpy as np

from wholebody.robot.state import Robot
from wholebody.tasks.base import Objective


class HeightTask:
    """Height of one body above the floor.

    Args:
        frame: Body frame.
        kp: Stiffness [1/s^2]. kd: Damping [1/s]. weight: [1/(m/s^2)^2].
    """

    feedback_max = 5.0
    """Largest |kp * error| [m/s^2]; chosen, no trial is on record."""

    def __init__(self, frame: str, *, kp: float, kd: float, weight: float) -> None:
        self.frame, self.kp, self.kd = frame, kp, kd
        self.weight = np.array([weight])
        self.bind(np.zeros(3))

    def bind(self, memory: np.ndarray) -> None:
        """Read the reference from memory that the program shares: height [m], rate and acceleration (3,)."""
        self.reference = memory

    def objective(self, robot: Robot) -> Objective:
        """Objective with one row."""
        z_ref, dz_ref, ddz_ref = self.reference.tolist()
        error = z_ref - robot.pose(self.frame).translation[2]
        feedback = np.clip(self.kp * error, -self.feedback_max, self.feedback_max)
        wanted = ddz_ref + feedback + self.kd * (dz_ref - robot.velocity(self.frame)[2])
        return Objective(robot.jacobian(self.frame)[2:3], np.array([wanted - robot.drift(self.frame)[2]]), self.weight)
