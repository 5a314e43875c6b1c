"""Keep a body (the pelvis) near a reference height."""

from __future__ import annotations

import numpy as np

from wholebody.robot.state import Robot
from wholebody.tasks.base import Objective


class HeightTask:
    """Height of one body above the floor.

    Args:
        frame: Body frame.
        kp: Stiffness [1/s^2]. kd: Damping [1/s]. weight: [1/(m/s^2)^2]. feedback_max: Largest |kp * error| [m/s^2].
    """

    def __init__(self, frame: str, *, kp: float, kd: float, weight: float, feedback_max: float = 5.0) -> None:
        self.frame, self.kp, self.kd, self.feedback_max = frame, kp, kd, feedback_max
        self.weight = np.array([weight])
        self._reference = np.zeros(3)

    def bind(self, memory: np.ndarray) -> None:
        """Read the reference from memory that the program shares: height, rate and acceleration (3,)."""
        self._reference = memory

    def set_reference(self, z: float, dz: float, ddz: float) -> None:
        """Set height [m], its rate [m/s] and acceleration [m/s^2]."""
        self._reference[:] = z, dz, ddz

    @property
    def z_ref(self) -> float:
        """Height [m]."""
        return float(self._reference[0])

    @property
    def dz_ref(self) -> float:
        """Its rate [m/s]."""
        return float(self._reference[1])

    @property
    def ddz_ref(self) -> float:
        """Its acceleration [m/s^2]."""
        return float(self._reference[2])

    def objective(self, robot: Robot) -> Objective:
        """Objective with one row."""
        error = self.z_ref - robot.pose(self.frame).translation[2]
        feedback = np.clip(self.kp * error, -self.feedback_max, self.feedback_max)
        wanted = self.ddz_ref + feedback + self.kd * (self.dz_ref - robot.velocity(self.frame)[2])
        return Objective(robot.jacobian(self.frame)[2:3], np.array([wanted - robot.drift(self.frame)[2]]), self.weight)
