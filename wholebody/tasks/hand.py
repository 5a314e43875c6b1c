"""Track the pose of one hand's tool frame."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wholebody.robot.state import Robot
from wholebody.robot.touch import (
    AXIS_MAX,
    FORCE,
    HEADING,
    MOBILITY,
    PUSH_MAX,
    SHARE,
    STIFFNESS,
    TOLD,
    TOLD_GIVE,
    TOUCH,
    TURN_TOUCHING,
    stance_axes,
)
from wholebody.tasks.base import Objective, limited


class HandTask:
    """Pose of one tool frame, position and orientation weighted apart.

    ``target = a_ref + kd (twist_ref - twist) + kp error - drift``, world-aligned axes at the frame's origin.
    The proportional part is limited so that a far reference asks for a finite acceleration.

    A hand that touches is a mass on a spring whose force is bounded, in place of the linear rows:
    ``target = push - kd velocity + force / mass - drift`` with ``push = a_ref + kd velocity_ref + stiffness error``,
    along each axis of the stance and altogether no longer than it may be. At rest the force on it is then
    ``- mass push``: it yields to a larger one.
    Where it is told how hard to push, the spring's part of ``push`` along that is what it is told, more or less by
    `TOLD_GIVE`.

    Args:
        frame: Name of the tool frame.
        kp: Stiffness [1/s^2]. kd: Damping [1/s].
        position_weight: [1/(m/s^2)^2]. orientation_weight: [1/(rad/s^2)^2].

    Source:
        Hogan 1985, "Impedance Control: An Approach to Manipulation", J. Dyn. Sys. Meas. Control.
    """

    feedback_max = (30.0, 60.0)
    """Largest proportional acceleration, linear [m/s^2] and angular [rad/s^2]; chosen, no trial is on record."""

    def __init__(self, frame: str, *, kp: float, kd: float, position_weight: float, orientation_weight: float) -> None:
        self.frame, self.kp, self.kd = frame, kp, kd
        self.weight = np.array([position_weight] * 3 + [orientation_weight] * 3)
        self.bind(np.zeros(24), np.ones(1), np.zeros(TOUCH))
        self.R_world_ref[:] = np.eye(3)

    def bind(self, memory: np.ndarray, trust: np.ndarray, touch: np.ndarray) -> None:
        """Read the reference from shared memory: rotation (9), position (3), twist (6), acceleration (6).

        Args:
            memory: Shape (24,).
            trust: Memory of `trust`, shape (1,).
            touch: What the hand feels, as in `wholebody.robot.touch`, shape (TOUCH,).
        """
        self.R_world_ref, self.p_world_ref, self._trust = memory[:9].reshape(3, 3), memory[9:12], trust
        self.touch = touch
        self.twist_ref, self.acceleration_ref = memory[12:18], memory[18:]

    @property
    def trust(self) -> float:
        """Factor on the weights, 0 to 1: how much the reference is trusted."""
        return float(self._trust[0])

    @trust.setter
    def trust(self, trust: float) -> None:
        self._trust[0] = trust

    def error(self, robot: Robot) -> np.ndarray:
        """Reference minus present pose: world translation [m] and world rotation vector [rad], shape (6,)."""
        T = robot.pose(self.frame)
        rotation = pin.log3(self.R_world_ref @ T.rotation.T)
        return np.concatenate([self.p_world_ref - T.translation, rotation])

    def objective(self, robot: Robot) -> Objective:
        """Objective with six rows, linear first."""
        error, touch, velocity = self.error(robot), self.touch, robot.velocity(self.frame)
        share, turn_max = touch[SHARE], self.feedback_max[1]
        turn_max = turn_max * (1.0 - share) + TURN_TOUCHING * share
        feedback = np.concatenate(
            [limited(self.kp * error[:3], self.feedback_max[0]), limited(self.kp * error[3:], turn_max)]
        )
        wanted = self.acceleration_ref + self.kd * (self.twist_ref - velocity) + feedback
        R, stiffness, largest = stance_axes(touch[HEADING:]), touch[STIFFNESS:AXIS_MAX], touch[AXIS_MAX:HEADING]
        push = R @ (stiffness * (R.T @ error[:3]))
        if (size := float(np.linalg.norm(touch[TOLD : TOLD + 3]))) > 0.0:
            direction = touch[TOLD : TOLD + 3] / size
            along = float(push @ direction)
            push += (size + min(max(along, -TOLD_GIVE * size), TOLD_GIVE * size) - along) * direction
        push += self.kd * self.twist_ref[:3] + self.acceleration_ref[:3]
        push = R @ np.clip(R.T @ push, -largest, largest)
        yielding = limited(push, touch[PUSH_MAX]) - self.kd * velocity[:3] + touch[FORCE : FORCE + 3] * touch[MOBILITY]
        wanted[:3] = (1.0 - share) * wanted[:3] + share * yielding
        return Objective(robot.jacobian(self.frame), wanted - robot.drift(self.frame), self.trust * self.weight)
