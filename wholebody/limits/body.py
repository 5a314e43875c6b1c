"""Bounds on the pelvis and the torso around the trajectory: tilt, turning rate and height."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wholebody.limits.base import Rows, braking_bound
from wholebody.robot.state import Robot


class OrientationLimit:
    """A body's rotation away from its plan stays small, and so does its rate.

    Args:
        frame: Body frame.
        angle_max: Largest rotation from the plan about each world axis [rad].
        rate_max: Largest angular rate about each axis [rad/s].
        brake: Angular deceleration that is always available [rad/s^2].
        time_constant: Of the approach to the bound [s].
    """

    def __init__(
        self, frame: str, *, angle_max: float, rate_max: float, brake: float, time_constant: float = 0.02
    ) -> None:
        self.frame, self.angle_max, self.rate_max = frame, angle_max, rate_max
        self.brake, self.time_constant = brake, time_constant
        self.bind(np.zeros(15))
        self.R_world_ref[:] = np.eye(3)
        axes = ("roll", "pitch", "yaw")
        self._labels = tuple(f"{frame}.{axis}.{side}" for side in ("max", "min") for axis in axes)

    def bind(self, memory: np.ndarray) -> None:
        """Read the reference from memory that the program shares: rotation (9), rate (3) and acceleration (3)."""
        self.R_world_ref, self.rate_ref, self.acceleration_ref = memory[:9].reshape(3, 3), memory[9:12], memory[12:]

    def set_reference(self, R_world_ref: np.ndarray, rate: np.ndarray, acceleration: np.ndarray) -> None:
        """Set the planned orientation (3, 3), angular rate (3,) [rad/s] and acceleration (3,) [rad/s^2], world axes."""
        self.R_world_ref[:], self.rate_ref[:], self.acceleration_ref[:] = R_world_ref, rate, acceleration

    def rows(self, robot: Robot) -> Rows:
        """Six rows: three axes, both sides."""
        angle = pin.log3(robot.pose(self.frame).rotation @ self.R_world_ref.T)
        rate = robot.velocity(self.frame)[3:]
        J, drift = robot.jacobian(self.frame)[3:], robot.drift(self.frame)[3:]
        upper = []
        for sign in (1.0, -1.0):
            drift_rate = sign * (rate - self.rate_ref)
            left = self.angle_max - sign * angle
            stop = braking_bound(left, drift_rate, brake=self.brake, time_constant=self.time_constant)
            stop += sign * self.acceleration_ref
            speed = (self.rate_max - sign * rate) / self.time_constant
            upper.append(np.minimum(stop, speed) - sign * drift)
        return Rows(np.vstack([J, -J]), np.concatenate(upper), self._labels)


class HeightLimit:
    """A body's height stays within a band.

    Args:
        frame: Body frame.
        band: Largest distance from the plan, up and down [m].
        lowest: Height never gone below, whatever the plan [m].
        brake: Vertical deceleration that is always available [m/s^2].
        time_constant: Of the approach to the bound [s].
    """

    def __init__(self, frame: str, *, band: float, lowest: float, brake: float, time_constant: float = 0.02) -> None:
        self.frame, self.band, self.lowest, self.brake, self.time_constant = frame, band, lowest, brake, time_constant
        self._reference: np.ndarray | None = None

    def bind(self, memory: np.ndarray) -> None:
        """Read the plan from memory that the program shares: height, rate and acceleration (3,)."""
        self._reference = memory

    def set_reference(self, z: float, dz: float, ddz: float) -> None:
        """Set the planned height [m], its rate [m/s] and acceleration [m/s^2]."""
        if self._reference is None:
            self._reference = np.zeros(3)
        self._reference[:] = z, dz, ddz

    def rows(self, robot: Robot) -> Rows:
        """One row for the lowest height, and two around the plan if there is one."""
        z = robot.pose(self.frame).translation[2]
        rate = robot.velocity(self.frame)[2]
        J, drift = robot.jacobian(self.frame)[2], robot.drift(self.frame)[2]
        rows = [(-J, z - self.lowest, -rate, drift)]
        if self._reference is not None:
            planned, planned_rate, acceleration = self._reference
            away = rate - planned_rate
            rows.append((J, planned + self.band - z, away, acceleration - drift))
            rows.append((-J, z - planned + self.band, -away, drift - acceleration))
        margin, speed, extra = (np.array([row[i] for row in rows]) for i in (1, 2, 3))
        upper = braking_bound(margin, speed, brake=self.brake, time_constant=self.time_constant) + extra
        labels = (f"{self.frame}.height.lowest", f"{self.frame}.height.max", f"{self.frame}.height.min")
        return Rows(np.vstack([row[0] for row in rows]), upper, labels[: len(rows)])
