"""The protocol of a robot and its surroundings, stepped by commands."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

import numpy as np

from models.spec import RobotSpec
from wholebody.types import JointCommand, RobotState


@runtime_checkable
class Plant(Protocol):
    """What a closed loop needs of a robot in its surroundings; `wholebody.sim.plant.MujocoPlant` is one.

    Attributes:
        spec: The robot.
        control_dt: Time that one command is applied for [s].
        torque: Torques of the motors (n_joints,), motor order, [N m].
        torque_asked: Largest magnitude asked of each motor in the last control period, before its limit [N m].
    """

    spec: RobotSpec
    control_dt: float
    torque: np.ndarray
    torque_asked: np.ndarray

    def reset(self, begin: RobotState | None = None) -> RobotState:
        """Put the robot into a state, at rest in its stance if none is given, and the clock to 0.

        Raises:
            InputError: If that is no state of this robot, or the plant cannot be put into it.
        """
        ...

    def step(self, command: JointCommand) -> RobotState:
        """Apply a command for one control period; the true state after it.

        Raises:
            InputError: If the command has a wrong shape or is not finite.
            SimulationError: If the motion is no longer finite.
        """
        ...

    def joint_positions(self) -> np.ndarray:
        """True joint angles (n_joints,), motor order, [rad]."""
        ...

    def soles(self) -> np.ndarray:
        """Middles of the soles in world (2, 3), left first, [m]."""
        ...

    def contact_points(self) -> np.ndarray:
        """Points where the feet may touch the floor, in world (n, 3), [m]."""
        ...

    def foot_load(self) -> tuple[float, np.ndarray]:
        """Normal force of the floor on the feet [N] and centre of pressure (2,) [m]; zeros in the air."""
        ...

    def contacts(self) -> list[tuple[str, str]]:
        """Pairs of bodies that touch now, feet on the floor left out."""
        ...

    def is_robot(self, body: str) -> bool:
        """Whether a body is a part of the robot."""
        ...

    def touches_floor(self) -> str | None:
        """Name of a body of the robot, other than the feet, that touches the floor, or None."""
        ...

    def objects(self) -> np.ndarray:
        """Poses of the bodies around the robot that move: position [m] and quaternion wxyz, shape (k, 7)."""
        ...
