"""What the controller is told of the true state: read by sensors that are biased, noisy and late, and estimated."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin

from models.pinocchio_model import frame_id, load_pinocchio
from models.spec import RobotSpec
from wholebody.config.bounds import require_run
from wholebody.estimation.odometry import StanceOdometry
from wholebody.estimation.readings import Estimator, Readings
from wholebody.types import RobotState


@dataclass(frozen=True, kw_only=True)
class SensorConfig:
    """Errors of the sensors; all zero by default. Noise is white, its standard deviation given."""

    imu_bias: float = 0.0
    """Constant tilt error of the base orientation [rad]."""
    imu_noise: float = 0.0
    """Noise of the base orientation, per axis [rad]."""
    gyro_noise: float = 0.0
    """Noise of the base's angular velocity, per axis [rad/s]."""
    encoder_offset: float = 0.0
    """Standard deviation of the constant offset of each joint [rad]."""
    encoder_noise: float = 0.0
    """Noise of each joint reading [rad]."""
    speed_noise: float = 0.0
    """Noise of each joint speed before the filter [rad/s]."""
    velocity_cutoff: float = 0.0
    """Cut-off of the first-order filter on joint speeds and angular velocity; 0 for none [Hz]."""
    gyro_bias: float = 0.0
    """Standard deviation of the constant offset of the gyro, per axis [rad/s]."""
    yaw_drift: float = 0.0
    """Standard deviation of the speed at which the orientation's yaw drifts away [rad/s]."""
    acc_noise: float = 0.0
    """Noise of the accelerometer, per axis [m/s^2]."""
    acc_bias: float = 0.0
    """Standard deviation of its constant offset, per axis [m/s^2]."""
    lost: float = 0.0
    """Share of the samples that are lost: the one before comes again, and the estimator gets none."""
    delay: float = 0.0
    """Age of the state when the controller gets it [s]; its own time says so."""
    delay_misjudged: float = 0.0
    """How much older it is than its own time says [s]."""
    seed: int = 0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            require_run(name, value, f"sensor setting {name}")


REALISTIC = SensorConfig(
    imu_bias=np.deg2rad(0.3),
    imu_noise=np.deg2rad(0.1),
    gyro_noise=0.01,
    encoder_offset=0.002,
    encoder_noise=0.0002,
    speed_noise=0.02,
    velocity_cutoff=40.0,
)
"""A G1 as assumed for the sensing bars [rad, rad/s, Hz, s], chosen: 0.3 deg of bias, 2 mrad of offsets, 40 Hz; noise as
in the prototype."""


REALISTIC_READINGS = replace(
    REALISTIC, gyro_bias=0.005, yaw_drift=np.deg2rad(10.0) / 60.0, acc_noise=0.1, acc_bias=0.05, lost=0.01
)
"""Sensors of the realistic robot, which has no odometry but what is estimated [rad/s, m/s^2]; chosen, no G1 was
measured: 0.3 degrees a second of bias, 10 degrees a minute of drift, 10 mg of noise and 5 of offset, as calibrated MEMS
sensors have, one sample in a hundred lost."""


class Sensors:
    """Turns true states into measured ones: readings first, from which the state is estimated.

    Args:
        spec: The robot.
        config: Errors of the sensors.
        dt: Time between states [s].
        estimator: Makes the state of the readings; a `StanceOdometry` if not given.

    Attributes:
        encoder_error: Of the last readings of the joints, Pinocchio order, shape (n_joints,), [rad].
    """

    def __init__(self, spec: RobotSpec, config: SensorConfig, dt: float, estimator: Estimator | None = None) -> None:
        self.config, self._dt, self._n = config, dt, spec.n_joints
        self.estimator = StanceOdometry(spec) if estimator is None else estimator
        model = load_pinocchio(spec)
        self._imu, self._gravity = model.frames[frame_id(model, spec.imu_frame)].placement, model.gravity.linear
        self.reset()

    def reset(self) -> None:
        """Draw the constant errors anew from the seed, forget the past."""
        c, n = self.config, self._n
        self._rng, other = np.random.default_rng(c.seed), np.random.default_rng((c.seed, 0))
        self._offset = c.encoder_offset * self._rng.standard_normal(n)
        direction = self._rng.uniform(0.0, 2.0 * np.pi)
        self._tilt = c.imu_bias * np.array([np.cos(direction), np.sin(direction), 0.0])
        self._bias, self._drift = c.gyro_bias * other.standard_normal(3), c.yaw_drift * other.standard_normal()
        self._acc_bias = c.acc_bias * other.standard_normal(3)
        self._other, self.encoder_error = other, self._offset.copy()
        self._filtered: np.ndarray | None = None
        self._began: float | None = None
        self._states_late = round(c.delay / self._dt)
        self._late: deque[RobotState] = deque(maxlen=self._states_late + 1)
        self._moved: tuple[float, np.ndarray] | None = None
        self.estimator.reset()

    def measure(self, state: RobotState) -> RobotState:
        """The state that the controller gets at the time of ``state``: an older one if there is a delay.

        Before the first one the robot has been at rest for as long as that, and as the estimator takes to settle.
        """
        late = self._late
        lost = len(late) > 0 and self._other.random() < self.config.lost
        before = 0 if late else self._states_late + round(self.estimator.settling / self._dt)
        for back in range(before, 0, -1):
            late.append(self.estimator.estimate(self.read(replace(state, time=state.time - back * self._dt))))
        readings = self.read(state)
        late.append(late[-1] if lost else self.estimator.estimate(readings))
        return late[0]

    def read(self, state: RobotState) -> Readings:
        """What the sensors say in a true state."""
        c, n = self.config, self._n
        self._began = state.time if self._began is None else self._began
        self.encoder_error = self._offset + self._noise(c.encoder_noise, n)
        acc, tilt = self._accelerometer(state), self._tilt + self._noise(c.imu_noise, 3)
        tilt[2] += self._drift * (state.time - self._began)
        quat = (pin.Quaternion(pin.exp3(tilt)) * pin.Quaternion(state.q[3:7])).normalized().coeffs()
        v = state.v[3:].copy()
        v[:3] += self._bias + self._noise(c.gyro_noise, 3)
        v[3:] += self._noise(c.speed_noise, n)
        v, time = self._filter(v), state.time + c.delay_misjudged
        return Readings(time, quat, v[:3], state.q[7:] + self.encoder_error, v[3:], state.tau, acc)

    def _accelerometer(self, state: RobotState) -> np.ndarray:
        """What an accelerometer feels that is mounted as crookedly as the IMU's tilt is wrong, mean since last time."""
        c, R = self.config, pin.Quaternion(state.q[3:7]).toRotationMatrix()
        speed = R @ (state.v[:3] + np.cross(state.v[3:6], self._imu.translation))
        before, self._moved = self._moved, (state.time, speed)
        force = -self._gravity
        if before is not None and state.time > before[0]:
            force = (speed - before[1]) / (state.time - before[0]) - self._gravity
        noise = c.acc_noise * self._other.standard_normal(3) if c.acc_noise > 0.0 else 0.0
        return R.T @ pin.exp3(self._tilt).T @ force + self._acc_bias + noise

    def _noise(self, deviation: float, n: int) -> np.ndarray:
        return deviation * self._rng.standard_normal(n)

    def _filter(self, v: np.ndarray) -> np.ndarray:
        if self.config.velocity_cutoff <= 0.0:
            return v
        gain = 1.0 - np.exp(-2.0 * np.pi * self.config.velocity_cutoff * self._dt)
        self._filtered = v.copy() if self._filtered is None else self._filtered + gain * (v - self._filtered)
        return self._filtered.copy()
