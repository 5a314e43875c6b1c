"""Bounds on the pelvis and the torso around the posture plan: tilt, turning rate and height."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wholebody.limits.base import Rows, barrier
from wholebody.robot import Robot


class OrientationLimit:
    """A body's rotation away from its plan stays small, and so does its rate.

    Args:
        frame: Body frame.
        angle_max: Largest rotation from the plan about each world axis [rad].
        rate_max: Largest angular rate about each axis [rad/s].
        brake: Angular deceleration that is always available [rad/s^2].
        dt: Time constant of the bound [s].
    """

    def __init__(self, frame: str, *, angle_max: float, rate_max: float, brake: float, dt: float = 0.02) -> None:
        self.frame, self.angle_max, self.rate_max, self.brake, self.dt = frame, angle_max, rate_max, brake, dt
        self.R_world_ref = np.eye(3)
        axes = ("roll", "pitch", "yaw")
        self._labels = tuple(f"{frame}.{axis}.{side}" for side in ("max", "min") for axis in axes)

    def rows(self, robot: Robot) -> Rows:
        """Six rows: three axes, both sides."""
        angle = pin.log3(robot.pose(self.frame).rotation @ self.R_world_ref.T)
        rate = robot.velocity(self.frame)[3:]
        J, drift = robot.jacobian(self.frame)[3:], robot.drift(self.frame)[3:]
        upper = []
        for sign in (1.0, -1.0):
            stop = barrier(self.angle_max - sign * angle, sign * rate, brake=self.brake, dt=self.dt)
            speed = (self.rate_max - sign * rate) / self.dt
            upper.append(np.minimum(stop, speed) - sign * drift)
        return Rows(np.vstack([J, -J]), np.concatenate(upper), self._labels)


class HeightLimit:
    """A body's height stays within a band.

    Args:
        frame: Body frame.
        band: Largest distance from the plan, up and down [m].
        lowest: Height never gone below, whatever the plan [m].
        brake: Vertical deceleration that is always available [m/s^2].
        dt: Time constant of the bound [s].
    """

    def __init__(self, frame: str, *, band: float, lowest: float, brake: float, dt: float = 0.02) -> None:
        self.frame, self.band, self.lowest, self.brake, self.dt = frame, band, lowest, brake, dt
        self.z_ref: float | None = None

    def rows(self, robot: Robot) -> Rows:
        """Two rows: up and down."""
        z = robot.pose(self.frame).translation[2]
        rate = robot.velocity(self.frame)[2]
        low, high = self.lowest, np.inf
        if self.z_ref is not None:
            low, high = max(self.lowest, self.z_ref - self.band), self.z_ref + self.band
        J, drift = robot.jacobian(self.frame)[2], robot.drift(self.frame)[2]
        margin = np.array([min(high - z, 10.0), z - low])
        upper = barrier(margin, np.array([rate, -rate]), brake=self.brake, dt=self.dt) - np.array([drift, -drift])
        return Rows(np.vstack([J, -J]), upper, (f"{self.frame}.height.max", f"{self.frame}.height.min"))
