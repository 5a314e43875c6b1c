"""Keep the joints near the trajectory."""

from __future__ import annotations

import numpy as np

from wholebody.robot.state import Robot
from wholebody.tasks.base import Objective


class PostureTask:
    """Joint positions, each joint with its own gain and weight.

    Args:
        kp: Stiffness per joint, shape (n_joints,), [1/s^2]. kd: Damping, shape (n_joints,), [1/s].
        weight: Shape (n_joints,), [1/(rad/s^2)^2]. All in Pinocchio joint order.
    """

    feedback_max = 100.0
    """Largest |kp * error| per joint [rad/s^2]; chosen, no trial is on record."""

    def __init__(self, *, kp: np.ndarray, kd: np.ndarray, weight: np.ndarray) -> None:
        self.kp, self.kd, self.weight = kp, kd, weight
        n = len(weight)
        self.bind(np.zeros((3, n)))
        self._J = np.hstack([np.zeros((n, 6)), np.eye(n)])

    def bind(self, memory: np.ndarray) -> None:
        """Read the reference from shared memory: rows position, velocity, acceleration (3, n_joints)."""
        self.q_ref, self.dq_ref, self.ddq_ref = memory

    def objective(self, robot: Robot) -> Objective:
        """Objective with one row a joint."""
        feedback = np.clip(self.kp * (self.q_ref - robot.q[7:]), -self.feedback_max, self.feedback_max)
        return Objective(self._J, self.ddq_ref + self.kd * (self.dq_ref - robot.v[6:]) + feedback, self.weight)
