"""The state of a robot that stands on both feet: where its pelvis is, from its legs and its IMU."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import atan2, copysign, cos, inf, isfinite, sin, sqrt

import numpy as np
import pinocchio as pin

from models.pinocchio_model import load_pinocchio, stance_q
from models.spec import RobotSpec
from wholebody.errors import InputError
from wholebody.estimation.readings import Readings
from wholebody.types import QUATERNION_TOLERANCE, RobotState

BIAS_TIME = 5.0
"""Time constant with which the bias of the gyro is learned from the legs [s]; chosen: much longer than any motion."""
TILT_TIME = 0.2
"""Time constant with which the orientation follows the IMU's, the gyro leading [s]; chosen: a hundred readings, whose
noise it divides by 14."""
GAP_MAX = 0.05
"""Longest time between readings over which the gyro leads [s]; chosen: beyond it the IMU is believed at once."""
BIAS_MAX = 0.1
"""Largest bias of a gyro that is learned [rad/s]; chosen: six degrees a second is a broken one."""


class StandingOdometry:
    """Leg odometry for two soles that stay flat where they are.

    The origin of world is midway between their centres, x the mean of their directions, z up. Roll and pitch are those
    of the IMU; its yaw, which drifts, is not used: the legs say how the pelvis is turned over the soles. They say how
    fast it turns as well, and so what the gyro's bias is; without its bias, the gyro smooths the orientation. A floor
    that slopes, or a foot that is lifted or slides, is not noticed.

    Args:
        spec: The robot.
        dt: Time between readings, over which the bias of the gyro is learned and the orientation smoothed [s]; 0: every
            state is that of its own readings alone.
    """

    def __init__(self, spec: RobotSpec, dt: float = 0.0) -> None:
        whole = load_pinocchio(spec)
        self._names, self._soles = list(whole.names)[2:], []
        # The soles hang on the legs alone.
        ankles = [whole.frames[whole.getFrameId(foot.frame)].parentJoint for foot in spec.feet]
        legs = {joint for ankle in ankles for joint in whole.supports[ankle]}
        locked = [joint for joint in range(2, whole.njoints) if joint not in legs]
        model = self._model = pin.buildReducedModel(whole, locked, pin.neutral(whole))
        self._legs = np.array([whole.idx_vs[joint] - 6 for joint in sorted(legs) if joint > 1])
        for foot in spec.feet:
            ankle = model.frames[model.getFrameId(foot.frame)]
            T_joint_sole = ankle.placement * pin.SE3(np.eye(3), np.array(foot.sole_center))
            frame = pin.Frame(f"{foot.side}_sole", ankle.parentJoint, 0, T_joint_sole, pin.FrameType.OP_FRAME)
            self._soles.append(model.addFrame(frame))
        self._data = model.createData()
        self._share = dt / BIAS_TIME
        self.reset()

    def reset(self) -> None:
        """The gyro has no bias that is known."""
        self.bias, self._time = np.zeros(3), -inf

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
        if not abs(sqrt(quat.dot(quat)) - 1.0) <= QUATERNION_TOLERANCE:
            quat = np.full(4, np.nan)
        n, model, data = len(readings.q), self._model, self._data
        q, v = np.zeros(7 + n), np.zeros(6 + n)
        q[7:], v[3:6], v[6:] = readings.q, readings.gyro - self.bias, readings.dq
        q[3:7] = self._smoothed(readings.time, quat, v[3:6]) if self._share > 0.0 else quat
        legs = self._legs
        pin.forwardKinematics(model, data, np.append(q[:7], q[7:][legs]), np.append(v[:6], v[6:][legs]))
        left, right = (pin.updateFramePlacement(model, data, sole) for sole in self._soles)
        slide, slip = (pin.getFrameVelocity(model, data, sole, pin.LOCAL_WORLD_ALIGNED).vector for sole in self._soles)
        R = data.oMi[1].rotation
        # Soles that stay turn with the pelvis as its gyro says, and back by the legs: what is left is the gyro's bias.
        motion = 0.5 * (slide + slip)
        if self._share > 0.0 and isfinite(motion.dot(motion)):
            self.bias = (self.bias + self._share * (motion[3:] @ R)).clip(-BIAS_MAX, BIAS_MAX)
        ahead, place = left.rotation[:, 0] + right.rotation[:, 0], -0.5 * (left.translation + right.translation)
        yaw = -atan2(ahead[1], ahead[0])
        c, s, x, y = cos(yaw), sin(yaw), place[0], place[1]
        q[0], q[1], q[2] = c * x - s * y, s * x + c * y, place[2]
        quat = (pin.Quaternion(cos(0.5 * yaw), 0.0, 0.0, sin(0.5 * yaw)) * pin.Quaternion(q[3:7])).coeffs()
        q[3:7] = quat * (copysign(1.0, quat[3]) / sqrt(quat.dot(quat)))  # of the two signs always the same one
        v[:3] = -motion[:3] @ R
        return RobotState(readings.time, q, v, readings.tau)

    def _smoothed(self, time: float, quat: np.ndarray, w: np.ndarray) -> np.ndarray:
        """Orientation that the gyro carries on, and that follows the IMU's slowly: its noise is left out."""
        seconds = time - self._time
        if not isfinite(quat.dot(quat) + w.dot(w)):
            return quat
        if 0.0 < seconds < GAP_MAX:
            turned = self._orientation @ pin.exp3(seconds * w)
            off = pin.log3(turned.T @ pin.Quaternion(quat).toRotationMatrix())
            self._orientation = turned @ pin.exp3(seconds / TILT_TIME * off)
        elif seconds != 0.0:
            self._orientation = pin.Quaternion(quat).toRotationMatrix()
        self._time = time
        return pin.Quaternion(self._orientation).coeffs()

    def _all(self, readings: Mapping[str, float], what: str) -> np.ndarray:
        try:
            return np.array([readings[name] for name in self._names], dtype=float)
        except KeyError:
            missing = [name for name in self._names if name not in readings]
            raise InputError(
                f"{what} lack {', '.join(missing[:5])}{' and others' if len(missing) > 5 else ''}: {len(missing)} of "
                f"{len(self._names)}; a number for every joint of the robot is expected, by its name in the URDF"
            ) from None


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
