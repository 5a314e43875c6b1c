"""What the sensors of a robot say at one instant."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from wholebody.robot.contact_schedule import ContactSchedule
from wholebody.types import RobotState


@dataclass(frozen=True, slots=True)
class Readings:
    """Readings of the IMU in the pelvis and of the joints, as Unitree's LowState has them; joints in Pinocchio order.

    Attributes:
        time: When they were taken, on the clock of the robot [s].
        quat_xyzw: Orientation of the pelvis; its yaw drifts.
        gyro: Angular velocity of the pelvis in its own axes, shape (3,), [rad/s].
        q: Positions of the joints, shape (n,), [rad].
        dq: Speeds, likewise [rad/s].
        tau: Torques, likewise [N m]; None if they are not known.
        acc: Specific force at the IMU in its own axes, shape (3,), [m/s^2]: what an accelerometer reads, 9.81 upwards
            at rest; None if it is not known.
    """

    time: float
    quat_xyzw: np.ndarray
    gyro: np.ndarray
    q: np.ndarray
    dq: np.ndarray
    tau: np.ndarray | None = None
    acc: np.ndarray | None = None


class Estimator(Protocol):
    """Makes the state of the robot of its readings.

    Attributes:
        settling: Time at rest that it takes until its states are as good as they get [s].
    """

    settling: float

    def expect(self, contacts: ContactSchedule | None) -> None:
        """Take the schedule of standing feet, on the clock of the readings; None: both stand, or as they feel."""

    def reset(self) -> None:
        """Forget the past."""

    def estimate(self, readings: Readings) -> RobotState:
        """The state, from the readings of an instant and those before."""
