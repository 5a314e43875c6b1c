"""What the controller is told of the true state: biased, filtered and late, as on a real robot."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from models.pinocchio_model import load_pinocchio
from models.spec import RobotSpec
from wholebody.types import RobotState


@dataclass(frozen=True, kw_only=True)
class SensorConfig:
    """Errors of the sensors; all zero by default."""

    imu_bias: float = 0.0
    """Constant tilt error of the base orientation [rad]."""
    encoder_offset: float = 0.0
    """Standard deviation of the constant offset of each joint [rad]."""
    encoder_noise: float = 0.0
    """Standard deviation of each joint reading [rad]."""
    velocity_cutoff: float = 0.0
    """Cut-off of the first-order filter on all velocities; 0 for none [Hz]."""
    delay: float = 0.0
    """Age of the state when the controller gets it [s]."""
    seed: int = 0


REALISTIC = SensorConfig(imu_bias=np.deg2rad(0.3), encoder_offset=0.002, velocity_cutoff=40.0)
"""Errors of a G1 as assumed for the sensing bars: 0.3 deg, 2 mrad, 40 Hz."""


class Sensors:
    """Turns true states into measured ones.

    The base position is what leg odometry would say: the feet are where they were at the first state, and the legs'
    measured angles and the measured tilt lead from there to the pelvis.

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
        self._tilt = pin.Quaternion(pin.exp3(c.imu_bias * np.array([np.cos(direction), np.sin(direction), 0.0])))
        self._filtered: np.ndarray | None = None
        self._soles: np.ndarray | None = None
        self._late: deque[RobotState] = deque(maxlen=round(c.delay / self._dt) + 1)

    def measure(self, state: RobotState) -> RobotState:
        """The measured state, with the time at which it was true."""
        c, q = self.config, state.q.copy()
        if self._soles is None:
            self._soles = self._middle(q)
        q[7:] += self._offset + c.encoder_noise * self._rng.standard_normal(len(self._offset))
        q[3:7] = (self._tilt * pin.Quaternion(q[3:7])).normalized().coeffs()
        q[:3] += self._soles - self._middle(q)
        self._late.append(RobotState(state.time, q, self._filter(state.v)))
        late = self._late[0]
        return RobotState(state.time, late.q, late.v)

    def _filter(self, v: np.ndarray) -> np.ndarray:
        if self.config.velocity_cutoff <= 0.0:
            return v
        share = 1.0 - np.exp(-2.0 * np.pi * self.config.velocity_cutoff * self._dt)
        self._filtered = v.copy() if self._filtered is None else self._filtered + share * (v - self._filtered)
        return self._filtered.copy()

    def _middle(self, q: np.ndarray) -> np.ndarray:
        pin.framesForwardKinematics(self._model, self._data, q)
        return np.mean([self._data.oMf[frame].translation for frame in self._feet], axis=0)
