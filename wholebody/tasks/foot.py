"""Lead a foot that is up along its swing."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wholebody.robot.state import Robot
from wholebody.tasks.base import Objective, limited


class FootTask:
    """Pose of a foot that is up; a foot that stands has no such task.

    ``target = a_ref + kd (twist_ref - twist) + kp error - drift``, world-aligned axes at the origin of its frame.

    Args:
        frame: Foot body frame.
        kp: Stiffness [1/s^2]. kd: Damping [1/s].
        position_weight: [1/(m/s^2)^2]. orientation_weight: [1/(rad/s^2)^2].
    """

    feedback_max = (60.0, 120.0)
    """Largest proportional acceleration, linear [m/s^2] and angular [rad/s^2]; chosen: twice that of a hand, since the
    foot has to be there when it is to carry."""

    def __init__(self, frame: str, *, kp: float, kd: float, position_weight: float, orientation_weight: float) -> None:
        self.frame, self.kp, self.kd = frame, kp, kd
        self.weight = np.array([position_weight] * 3 + [orientation_weight] * 3)
        self.bind(np.zeros(24))
        self.R_world_ref[:] = np.eye(3)

    def bind(self, memory: np.ndarray) -> None:
        """Read the reference from shared memory: rotation (9), position (3), twist (6), acceleration (6)."""
        self.R_world_ref, self.p_world_ref = memory[:9].reshape(3, 3), memory[9:12]
        self.twist_ref, self.acceleration_ref = memory[12:18], memory[18:]

    def objective(self, robot: Robot) -> Objective:
        """Objective with six rows, linear first."""
        T, velocity = robot.pose(self.frame), robot.velocity(self.frame)
        turn = pin.log3(self.R_world_ref @ T.rotation.T)
        feedback = np.concatenate(
            [
                limited(self.kp * (self.p_world_ref - T.translation), self.feedback_max[0]),
                limited(self.kp * turn, self.feedback_max[1]),
            ]
        )
        wanted = self.acceleration_ref + self.kd * (self.twist_ref - velocity) + feedback
        return Objective(robot.jacobian(self.frame), wanted - robot.drift(self.frame), self.weight)
