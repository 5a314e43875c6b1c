"""Keep the angular momentum about the centre of mass at its plan."""

from __future__ import annotations

import numpy as np

from wholebody.robot.state import Robot
from wholebody.tasks.base import Objective


class AngularMomentumTask:
    """Drive the angular momentum ``L`` to its reference: ``dL/dt = dL_ref + kd (L_ref - L)``.

    Args:
        kd: Damping [1/s]. weight: [1/(N m)^2].
    """

    def __init__(self, *, kd: float, weight: float) -> None:
        self.kd = kd
        self.weight = np.full(3, weight)
        self.bind(np.zeros(6))

    def bind(self, memory: np.ndarray) -> None:
        """Read the reference from memory that the program shares: momentum and rate (6,)."""
        self.momentum_ref, self.rate_ref = memory[:3], memory[3:]

    def objective(self, robot: Robot) -> Objective:
        """Objective with three rows."""
        wanted = self.rate_ref + self.kd * (self.momentum_ref - robot.momentum[3:])
        return Objective(robot.J_momentum[3:], wanted - robot.drift_momentum[3:], self.weight)
