"""What the controller is told of the true state: biased, noisy, filtered and late, as on a real robot."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from models.pinocchio_model import load_pinocchio
from models.spec import RobotSpec
from wholebody.config.bounds import require_run
from wholebody.types import RobotState


@dataclass(frozen=True, kw_only=True)
class SensorConfig:
    """Errors of the sensors; all zero by default. Noise is white, its standard deviation given."""

    imu_bias: float = 0.0
    """Constant tilt error of the base orientation [rad]."""
    imu_noise: float = 0.0
    """Of the base orientation, per axis [rad]."""
    gyro_noise: float = 0.0
    """Of the base's angular velocity, per axis [rad/s]."""
    encoder_offset: float = 0.0
    """Standard deviation of the constant offset of each joint [rad]."""
    encoder_noise: float = 0.0
    """Of each joint reading [rad]."""
    speed_noise: float = 0.0
    """Of each joint speed before the filter [rad/s]."""
    velocity_cutoff: float = 0.0
    """Cut-off of the first-order filter on joint speeds and angular velocity; 0 for none [Hz]."""
    delay: float = 0.0
    """Age of the state when the controller gets it [s]."""
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


class Sensors:
    """Turns true states into measured ones.

    Position and velocity of the base are what leg odometry would say: the soles' middle stays where it was at the first
    state, and the measured angles, speeds and orientation lead from there to the pelvis.

    Args:
        spec: The robot.
        config: Errors of the sensors.
        dt: Time between states [s].
    """

    def __init__(self, spec: RobotSpec, config: SensorConfig, dt: float) -> None:
        self.config, self._dt = config, dt
        self._model = load_pinocchio(spec)
        self._data = self._model.createData()
        self._feet = [self._model.getFrameId(foot.frame) for foot in spec.feet]
        self.reset()

    def reset(self) -> None:
        """Draw the constant errors anew from the seed, forget the past."""
        c = self.config
        self._rng = np.random.default_rng(c.seed)
        n = self._model.nq - 7
        self._offset = c.encoder_offset * self._rng.standard_normal(n)
        direction = self._rng.uniform(0.0, 2.0 * np.pi)
        self._tilt = c.imu_bias * np.array([np.cos(direction), np.sin(direction), 0.0])
        self._filtered: np.ndarray | None = None
        self._soles: np.ndarray | None = None
        self._late: deque[RobotState] = deque(maxlen=round(c.delay / self._dt) + 1)

    def measure(self, state: RobotState) -> RobotState:
        """The state that the controller gets at the time of ``state``: an older one if there is a delay."""
        c, q, v = self.config, state.q.copy(), state.v.copy()
        if self._soles is None:
            self._soles = self._middle(q, v)[0]
        q[7:] += self._offset + self._noise(c.encoder_noise, len(q) - 7)
        tilt = self._tilt + self._noise(c.imu_noise, 3)
        q[3:7] = (pin.Quaternion(pin.exp3(tilt)) * pin.Quaternion(q[3:7])).normalized().coeffs()
        v[3:6] += self._noise(c.gyro_noise, 3)
        v[6:] += self._noise(c.speed_noise, len(v) - 6)
        v[3:] = self._filter(v[3:])
        soles, motion = self._middle(q, v)
        q[:3] += self._soles - soles
        v[:3] -= pin.Quaternion(q[3:7]).toRotationMatrix().T @ motion
        self._late.append(RobotState(state.time, q, v, state.tau))
        late = self._late[0]
        return RobotState(state.time, late.q, late.v, late.tau)

    def _noise(self, deviation: float, n: int) -> np.ndarray:
        return deviation * self._rng.standard_normal(n)

    def _filter(self, v: np.ndarray) -> np.ndarray:
        if self.config.velocity_cutoff <= 0.0:
            return v
        gain = 1.0 - np.exp(-2.0 * np.pi * self.config.velocity_cutoff * self._dt)
        self._filtered = v.copy() if self._filtered is None else self._filtered + gain * (v - self._filtered)
        return self._filtered.copy()

    def _middle(self, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean position and velocity of the feet's frames in world, shape (3,) each."""
        pin.forwardKinematics(self._model, self._data, q, v)
        places = [pin.updateFramePlacement(self._model, self._data, frame).translation.copy() for frame in self._feet]
        axes = pin.LOCAL_WORLD_ALIGNED
        speeds = [pin.getFrameVelocity(self._model, self._data, frame, axes).linear.copy() for frame in self._feet]
        return np.mean(places, axis=0), np.mean(speeds, axis=0)
