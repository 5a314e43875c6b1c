"""The state of a robot that stands on both feet: where its pelvis is, from its legs and its IMU."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pinocchio as pin

from models.pinocchio_model import load_pinocchio
from models.spec import RobotSpec
from wholebody.errors import InputError
from wholebody.types import QUATERNION_TOLERANCE, RobotState


class StandingOdometry:
    """Leg odometry for two soles that stay flat where they are.

    The origin of world is midway between their centres, x the mean of their directions, z up. Roll and pitch are those
    of the IMU; its yaw, which drifts, is not used: the legs say how the pelvis is turned over the soles. A floor that
    slopes, or a foot that is lifted or slides, is not noticed.

    Args:
        spec: The robot.
    """

    def __init__(self, spec: RobotSpec) -> None:
        self._model = load_pinocchio(spec)
        self._data = self._model.createData()
        self._names = list(self._model.names)[2:]
        self._feet = [(self._model.getFrameId(foot.frame), foot.sole_center) for foot in spec.feet]

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
        if not abs(np.linalg.norm(quat) - 1.0) <= QUATERNION_TOLERANCE:
            quat[:] = np.nan
        q = np.concatenate([np.zeros(3), quat, self._all(joints, "joints")])
        v = np.concatenate([np.zeros(3), w, self._all(speeds, "speeds")])
        soles, motion, yaw = self._soles(q, v)
        turn = pin.AngleAxis(-yaw, np.array([0.0, 0.0, 1.0])).matrix()
        R = pin.Quaternion(quat).toRotationMatrix()
        q[:3] = -turn @ soles
        quat = (pin.Quaternion(turn) * pin.Quaternion(quat)).normalized().coeffs()
        q[3:7] = np.copysign(1.0, quat[3]) * quat  # of the two signs always the same one
        v[:3] = -R.T @ motion
        return RobotState(time, q, v, None if torques is None else self._all(torques, "torques"))

    def _all(self, readings: Mapping[str, float], what: str) -> np.ndarray:
        try:
            return np.array([readings[name] for name in self._names], dtype=float)
        except KeyError:
            missing = [name for name in self._names if name not in readings]
            raise InputError(
                f"{what} lack {', '.join(missing[:5])}{' and others' if len(missing) > 5 else ''}: {len(missing)} of "
                f"{len(self._names)}; a number for every joint of the robot is expected, by its name in the URDF"
            ) from None

    def _soles(self, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
        """Mean centre and velocity of the soles and their mean heading, for a pelvis that is at the origin."""
        pin.forwardKinematics(self._model, self._data, q, v)
        places, speeds, ahead = [], [], np.zeros(3)
        for frame, center in self._feet:
            T = pin.updateFramePlacement(self._model, self._data, frame)
            twist = pin.getFrameVelocity(self._model, self._data, frame, pin.LOCAL_WORLD_ALIGNED)
            arm = T.rotation @ center
            places.append(T.translation + arm)
            speeds.append(twist.linear + np.cross(twist.angular, arm))
            ahead += T.rotation[:, 0]
        return np.mean(places, axis=0), np.mean(speeds, axis=0), float(np.arctan2(ahead[1], ahead[0]))
