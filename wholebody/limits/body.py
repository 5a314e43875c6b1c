"""Bounds on the pelvis and the torso around the trajectory: tilt, turning rate and height."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wholebody.limits.base import TIME_CONSTANT, Rows, braking_bound
from wholebody.robot.state import Robot


class OrientationLimit:
    """A body's rotation away from its plan stays small, and so does its rate.

    Args:
        frame: Body frame.
        angle_max: Largest rotation from the plan about each world axis [rad].
        rate_max: Largest angular rate about each axis [rad/s].
        brake: Angular deceleration that is always available [rad/s^2].
    """

    def __init__(self, frame: str, *, angle_max: float, rate_max: float, brake: float) -> None:
        self.frame, self.angle_max, self.rate_max, self.brake = frame, angle_max, rate_max, brake
        self.bind(np.zeros(15))
        self.R_world_ref[:] = np.eye(3)
        axes = ("roll", "pitch", "yaw")
        self._labels = tuple(f"{frame}.{axis}.{side}" for side in ("max", "min") for axis in axes)

    def bind(self, memory: np.ndarray) -> None:
        """Read the reference from memory that the program shares: rotation (9), rate (3) and acceleration (3)."""
        self.R_world_ref, self.rate_ref, self.acceleration_ref = memory[:9].reshape(3, 3), memory[9:12], memory[12:]

    def rows(self, robot: Robot) -> Rows:
        """Six rows: three axes, both sides."""
        angle = pin.log3(robot.pose(self.frame).rotation @ self.R_world_ref.T)
        rate = robot.velocity(self.frame)[3:]
        J, drift = robot.jacobian(self.frame)[3:], robot.drift(self.frame)[3:]
        upper = []
        for sign in (1.0, -1.0):
            drift_rate = sign * (rate - self.rate_ref)
            left = self.angle_max - sign * angle
            stop = braking_bound(left, drift_rate, self.brake) + sign * self.acceleration_ref
            speed = (self.rate_max - sign * rate) / TIME_CONSTANT
            upper.append(np.minimum(stop, speed) - sign * drift)
        return Rows(np.vstack([J, -J]), np.concatenate(upper), self._labels)


class HeightLimit:
    """A body's height stays within a band.

    Args:
        frame: Body frame.
        band: Largest distance from the plan, up and down [m].
        lowest: Height never gone below, whatever the plan [m].
        brake: Vertical deceleration that is always available [m/s^2].
    """

    def __init__(self, frame: str, *, band: float, lowest: float, brake: float) -> None:
        self.frame, self.band, self.lowest, self.brake = frame, band, lowest, brake
        self.bind(np.zeros(3))
        self._labels = tuple(f"{frame}.height.{side}" for side in ("lowest", "max", "min"))

    def bind(self, memory: np.ndarray) -> None:
        """Read the plan from memory that the program shares: height, rate and acceleration (3,)."""
        self._reference = memory

    def rows(self, robot: Robot) -> Rows:
        """One row for the lowest height, and two around the plan."""
        z, rate = robot.pose(self.frame).translation[2], robot.velocity(self.frame)[2]
        drift = robot.drift(self.frame)[2]
        J, (planned, planned_rate, acceleration) = robot.jacobian(self.frame)[2], self._reference
        away = rate - planned_rate
        margin = np.array([z - self.lowest, planned + self.band - z, z - planned + self.band])
        extra = np.array([drift, acceleration - drift, drift - acceleration])
        upper = braking_bound(margin, np.array([-rate, away, -away]), self.brake) + extra
        return Rows(np.vstack([-J, J, -J]), upper, self._labels)
