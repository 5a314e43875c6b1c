"""The state of a robot whose standing ankles are taken to stay where they are planned."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from models.pinocchio_model import load_pinocchio, stance_q
from models.spec import RobotSpec
from wholebody.estimation.readings import Readings
from wholebody.robot.contact_schedule import ContactSchedule
from wholebody.robot.feet import Feet
from wholebody.types import RobotState


class StanceOdometry:
    """Leg odometry for standing ankles whose middle stays where it is planned; the whole orientation is the IMU's.

    Both stand where the stance has them, until another schedule is expected.

    Args:
        spec: The robot.
    """

    settling = 0.0
    """Time at rest that it takes [s]; derived: it remembers nothing."""

    def __init__(self, spec: RobotSpec) -> None:
        self._model = load_pinocchio(spec)
        self._data = self._model.createData()
        self._frames = [self._model.getFrameId(foot.frame) for foot in spec.feet]
        self._nominal = ContactSchedule.standing(Feet.at(spec, self._model, stance_q(spec, self._model)))
        self.expect(None)

    def expect(self, contacts: ContactSchedule | None) -> None:
        """Count on a schedule on the clock of the readings; without one, on both feet where the stance has them."""
        self._contacts = contacts or self._nominal

    def reset(self) -> None:
        """Nothing is remembered."""

    def estimate(self, readings: Readings) -> RobotState:
        """The state for the readings of an instant."""
        q = np.concatenate([np.zeros(3), readings.quat_xyzw, readings.q])
        v = np.concatenate([np.zeros(3), readings.gyro, readings.dq])
        now = self._contacts.at(readings.time)
        standing = [k for k, stands in enumerate(now.stands) if stands]
        place, motion = self._ankles(q, v, [self._frames[k] for k in standing])
        q[:3] += np.mean(now.feet.p[standing], axis=0) - place
        v[:3] -= pin.Quaternion(q[3:7]).toRotationMatrix().T @ motion
        return RobotState(readings.time, q, v, readings.tau)

    def _ankles(self, q: np.ndarray, v: np.ndarray, frames: Sequence[int]) -> tuple[np.ndarray, np.ndarray]:
        """Mean position and velocity of frames in world, shape (3,) each."""
        pin.forwardKinematics(self._model, self._data, q, v)
        places = [pin.updateFramePlacement(self._model, self._data, frame).translation.copy() for frame in frames]
        axes = pin.LOCAL_WORLD_ALIGNED
        speeds = [pin.getFrameVelocity(self._model, self._data, frame, axes).linear.copy() for frame in frames]
        return np.mean(places, axis=0), np.mean(speeds, axis=0)
