"""Damp the angular momentum about the centre of mass."""

from __future__ import annotations

import numpy as np

from wholebody.robot import Robot
from wholebody.tasks.base import Objective


class AngularMomentumTask:
    """Drive the angular momentum ``L`` to zero: ``dL/dt = -kd L``.

    Args:
        kd: Damping [1/s]. weight: [1/(N m)^2].
    """

    def __init__(self, *, kd: float, weight: float) -> None:
        self.kd = kd
        self.weight = np.full(3, weight)

    def objective(self, robot: Robot) -> Objective:
        """Objective with three rows."""
        wanted = -self.kd * robot.momentum[3:]
        return Objective(robot.J_momentum[3:], wanted - robot.drift_momentum[3:], self.weight)
