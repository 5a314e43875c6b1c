"""Keep the centre of mass at its reference."""

from __future__ import annotations

import numpy as np

from wholebody.robot.state import Robot
from wholebody.tasks.base import Objective, limited


class ComTask:
    """Position of the centre of mass in world.

    Args:
        kp: Stiffness [1/s^2]. kd: Damping [1/s].
        weight: Per axis x, y, z, shape (3,), [1/(m/s^2)^2].
    """

    feedback_max = 5.0
    """Largest kp * error [m/s^2]; chosen, no trial is on record."""

    def __init__(self, *, kp: float, kd: float, weight: tuple[float, float, float]) -> None:
        self.kp, self.kd = kp, kd
        self.weight = np.array(weight)
        self.bind(np.zeros(9), np.zeros(2), np.zeros(1))

    def bind(self, memory: np.ndarray, lean: np.ndarray, braced: np.ndarray) -> None:
        """Read the reference from memory that the program shares: position, velocity and acceleration (9,).

        ``lean`` (2,) is how far it is leant against what pushes the hands [m], ``braced`` (1,) how many times more its
        place weighs then.
        """
        self.lean, self.braced = lean, braced
        self.position_ref, self.velocity_ref, self.acceleration_ref = memory[:3], memory[3:6], memory[6:]

    def objective(self, robot: Robot) -> Objective:
        """Objective with three rows."""
        error = self.position_ref - robot.com
        error[:2] += self.lean
        feedback = limited(self.kp * error, self.feedback_max)
        wanted = self.acceleration_ref + self.kd * (self.velocity_ref - robot.com_velocity) + feedback
        more = np.array([1.0, 1.0, 0.0]) * self.braced
        return Objective(robot.J_com, wanted - robot.drift_com, self.weight * (1.0 + more))
