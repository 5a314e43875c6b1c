"""The state of a robot that stands on both feet: where its pelvis is, from its legs and its IMU."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pinocchio as pin

from models.pinocchio_model import load_pinocchio, stance_q
from models.spec import RobotSpec
from wholebody.errors import InputError
from wholebody.estimation.readings import Readings
from wholebody.types import QUATERNION_TOLERANCE, RobotState

BIAS_TIME = 5.0
"""Time constant with which the bias of the gyro is learned from the legs [s]; chosen: much longer than any motion."""
BIAS_MAX = 0.1
"""Largest bias of a gyro that is learned [rad/s]; chosen: six degrees a second is a broken one."""


class StandingOdometry:
    """Leg odometry for two soles that stay flat where they are.

    The origin of world is midway between their centres, x the mean of their directions, z up. Roll and pitch are those
    of the IMU; its yaw, which drifts, is not used: the legs say how the pelvis is turned over the soles. They say how
    fast it turns as well, and so what the gyro's bias is. A floor that slopes, or a foot that is lifted or slides, is
    not noticed.

    Args:
        spec: The robot.
        dt: Time between readings over which the bias of the gyro is learned [s]; 0: it is taken to have none.
    """

    def __init__(self, spec: RobotSpec, dt: float = 0.0) -> None:
        self._model = load_pinocchio(spec)
        self._data = self._model.createData()
        self._names = list(self._model.names)[2:]
        self._feet = [(self._model.getFrameId(foot.frame), foot.sole_center) for foot in spec.feet]
        self._share = dt / BIAS_TIME
        self.reset()

    def reset(self) -> None:
        """The gyro has no bias that is known."""
        self.bias = np.zeros(3)

    def state(
        self,
        *,
        time: float,
        joints: Mapping[str, float],
        speeds: Mapping[str, float],
        quat_xyzw: Sequence[float],
        gyro: Sequence[float],
        torques: Mapping[str, float] | None = None,
    ) -> RobotState:
        """The state for one set of readings, for `Supervisor.step`.

        A reading that is no number, or a quaternion that is none, gives a state that is not finite: the supervisor
        predicts the robot meanwhile and says so (`state_invalid`).

        Args:
            time: When they were taken, on the clock of the robot [s].
            joints: Position of every joint by its name in the URDF [rad]; others are ignored.
            speeds: Likewise [rad/s].
            quat_xyzw: Orientation of the pelvis, as its IMU has it: x, y, z, w. Unitree's messages begin with w.
            gyro: Angular velocity of the pelvis in its own axes [rad/s].
            torques: Torque of every joint by its name, as the motors tell it [N m], if they do.

        Raises:
            InputError: If a joint is missing, or the quaternion or angular velocity has another length.
        """
        quat, w = np.array(quat_xyzw, dtype=float), np.array(gyro, dtype=float)
        if quat.shape != (4,) or w.shape != (3,):
            raise InputError(
                f"quat_xyzw has shape {quat.shape} and gyro {w.shape}; a quaternion (4,) x, y, z, w and an angular "
                "velocity (3,) [rad/s] of the pelvis are expected"
            )
        tau = None if torques is None else self._all(torques, "torques")
        return self.estimate(Readings(time, quat, w, self._all(joints, "joints"), self._all(speeds, "speeds"), tau))

    def estimate(self, readings: Readings) -> RobotState:
        """The same for readings as arrays."""
        quat = readings.quat_xyzw
        if not abs(np.linalg.norm(quat) - 1.0) <= QUATERNION_TOLERANCE:
            quat = np.full(4, np.nan)
        q = np.concatenate([np.zeros(3), quat, readings.q])
        v = np.concatenate([np.zeros(3), readings.gyro - self.bias, readings.dq])
        R = pin.Quaternion(quat).toRotationMatrix()
        soles, motion, turning, yaw = self._soles(q, v)
        # Feet that stay turn with the pelvis as its gyro says, and back by the legs: what is left is the gyro's bias.
        if self._share > 0.0 and np.isfinite(turning).all():
            self.bias = np.clip(self.bias + self._share * (R.T @ turning), -BIAS_MAX, BIAS_MAX)
        turn = pin.AngleAxis(-yaw, np.array([0.0, 0.0, 1.0])).matrix()
        q[:3] = -turn @ soles
        quat = (pin.Quaternion(turn) * pin.Quaternion(quat)).normalized().coeffs()
        q[3:7] = np.copysign(1.0, quat[3]) * quat  # of the two signs always the same one
        v[:3] = -R.T @ motion
        return RobotState(readings.time, q, v, readings.tau)

    def _all(self, readings: Mapping[str, float], what: str) -> np.ndarray:
        try:
            return np.array([readings[name] for name in self._names], dtype=float)
        except KeyError:
            missing = [name for name in self._names if name not in readings]
            raise InputError(
                f"{what} lack {', '.join(missing[:5])}{' and others' if len(missing) > 5 else ''}: {len(missing)} of "
                f"{len(self._names)}; a number for every joint of the robot is expected, by its name in the URDF"
            ) from None

    def _soles(self, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
        """Of the soles: mean centre, velocity, angular velocity and heading, for a pelvis that is at the origin."""
        pin.forwardKinematics(self._model, self._data, q, v)
        places, speeds, turning, ahead = [], [], np.zeros(3), np.zeros(3)
        for frame, center in self._feet:
            T = pin.updateFramePlacement(self._model, self._data, frame)
            twist = pin.getFrameVelocity(self._model, self._data, frame, pin.LOCAL_WORLD_ALIGNED)
            arm = T.rotation @ center
            places.append(T.translation + arm)
            speeds.append(twist.linear + np.cross(twist.angular, arm))
            turning += twist.angular / len(self._feet)
            ahead += T.rotation[:, 0]
        return np.mean(places, axis=0), np.mean(speeds, axis=0), turning, float(np.arctan2(ahead[1], ahead[0]))


class StanceOdometry:
    """Leg odometry for ankles whose middle stays where it is in the stance; the whole orientation is the IMU's.

    Args:
        spec: The robot.
    """

    def __init__(self, spec: RobotSpec) -> None:
        self._model = load_pinocchio(spec)
        self._data = self._model.createData()
        self._feet = [self._model.getFrameId(foot.frame) for foot in spec.feet]
        self._middle = self._ankles(stance_q(spec, self._model), np.zeros(self._model.nv))[0]

    def reset(self) -> None:
        """Nothing is remembered."""

    def estimate(self, readings: Readings) -> RobotState:
        """The state for the readings of an instant."""
        q = np.concatenate([np.zeros(3), readings.quat_xyzw, readings.q])
        v = np.concatenate([np.zeros(3), readings.gyro, readings.dq])
        place, motion = self._ankles(q, v)
        q[:3] += self._middle - place
        v[:3] -= pin.Quaternion(q[3:7]).toRotationMatrix().T @ motion
        return RobotState(readings.time, q, v, readings.tau)

    def _ankles(self, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean position and velocity of the feet's frames in world, shape (3,) each."""
        pin.forwardKinematics(self._model, self._data, q, v)
        places = [pin.updateFramePlacement(self._model, self._data, frame).translation.copy() for frame in self._feet]
        axes = pin.LOCAL_WORLD_ALIGNED
        speeds = [pin.getFrameVelocity(self._model, self._data, frame, axes).linear.copy() for frame in self._feet]
        return np.mean(places, axis=0), np.mean(speeds, axis=0)
