"""The state of a robot whose ankles are taken to stay where they are in the stance."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from models.pinocchio_model import load_pinocchio, stance_q
from models.spec import RobotSpec
from wholebody.estimation.readings import Readings
from wholebody.types import RobotState


class StanceOdometry:
    """Leg odometry for ankles whose middle stays where it is in the stance; the whole orientation is the IMU's.

    Args:
        spec: The robot.
    """

    settling = 0.0
    """Time at rest that it takes [s]; derived: it remembers nothing."""

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
