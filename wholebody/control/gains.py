"""Gains that motors allow which answer slowly, or whose commands are late."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np
import pinocchio as pin

from models.pinocchio_model import stance_q
from models.spec import RobotSpec
from wholebody.config import ControllerConfig
from wholebody.estimation.motor_response import MotorResponse
from wholebody.robot.state import Robot

TASK_PHASE, SECOND_ORDER = 0.6, 1.5
"""Damping of hands and fingers in the program times the time from a command to its torque [rad], and the multiple of
its lag that a motor of second order counts for; chosen: phase margins of 12 degrees and more down to 15 Hz
(`benchmarks/motors.py margin`); with 0.9 and 1 there is none at 20 Hz."""
JOINT_SHARE, FINGER_SHARE = 0.1, 0.15
"""Damping of a joint over its inertia, as a share of the motor's natural frequency [no unit]; chosen likewise: joints
of an arm and the waist, coupled, shake above 0.2, a finger above 0.35."""
LAG_MIN, LAG_PHASE = 0.012, 0.9
"""Time constant of first order from which joints are damped less [s], and their damping over inertia times it; chosen:
with 10 ms the loop is stable as it is, with 15 ms it is not."""
RIGID = 1e-9
"""Singular values of the feet's inertia below this share are left out [no unit]; chosen: rounding."""


@dataclass(frozen=True)
class Gains:
    """Gains of position loops, motor order (n_joints,) [N m/rad, N m s/rad], and of tasks [1/s^2, 1/s]."""

    kp: np.ndarray
    kd: np.ndarray
    hand_kp: float
    hand_kd: float
    finger_kp: float
    finger_kd: float


class GainSchedule:
    """Gains by the response of the motors; quick motors have the gains of the configuration.

    Two loops go through a motor: its own position loop, which its lag limits, and the tasks of the program, which the
    delay of commands limits, too. Feedback of the program is even over the whole body; that of position loops is not:
    a wrist of 40 N m/rad and 0.005 kg m^2 shakes first. So slow motors are left to the program.

    Args:
        spec: The robot. robot: Its model.
        config: Whose gains are the largest.
    """

    def __init__(self, spec: RobotSpec, robot: Robot, config: ControllerConfig) -> None:
        self._spec, self._config = spec, config
        self._inertia = inertia_of_joints(spec, robot.model)[robot.pin_to_motor]
        fingers = {name for tool in spec.tools for name in tool.finger_joints}
        self._fingers = np.array([name in fingers for name in spec.joint_names])

    def gains(self, response: MotorResponse) -> Gains:
        """Gains for motors that answer so."""
        spec, hand, body = self._spec, self._config.hand, self._config.body
        kp, kd = spec.kp, spec.kd
        # Motors that are led by positions have nothing but their loops.
        rates = self._rates(response) if self._config.robot.torque >= 1.0 else None
        if rates is not None:
            # Critically damped; fingers, which press on things, are as stiff as they may be.
            stiff = np.where(self._fingers, 1.0, 0.25) * rates**2 * self._inertia
            kp, kd = np.minimum(kp, stiff), np.minimum(kd, rates * self._inertia)
        late = response.delay + response.lag + SECOND_ORDER * (response.torque_lag - response.lag)
        tasks = [_slowed(*of, late) for of in ((hand.kp, hand.kd), (body.finger_kp, body.finger_kd))]
        return Gains(kp, kd, *tasks[0], *tasks[1])

    def _rates(self, response: MotorResponse) -> np.ndarray | None:
        """Damping over inertia that each joint may have, (n_joints,), [1/s]; None for motors that are quick."""
        if response.bandwidth > 0.0:
            return 2.0 * pi * response.bandwidth * np.where(self._fingers, FINGER_SHARE, JOINT_SHARE)
        return np.full(self._spec.n_joints, LAG_PHASE / response.lag) if response.lag >= LAG_MIN else None


def _slowed(kp: float, kd: float, late: float) -> tuple[float, float]:
    """Gains of a task whose torques are late [1/s^2, 1/s]: damped less, and with the same damping ratio."""
    share = min(1.0, TASK_PHASE / (kd * late)) if kd * late > 0.0 else 1.0
    return share**2 * kp, share * kd


def inertia_of_joints(spec: RobotSpec, model: pin.Model) -> np.ndarray:
    """Inertia that each joint moves in the stance, all others free, feet on the floor, Pinocchio order [kg m^2]."""
    data, q = model.createData(), stance_q(spec, model)
    M = np.triu(pin.crba(model, data, q))
    inverse = np.linalg.inv(M + np.triu(M, 1).T)
    pin.computeJointJacobians(model, data, q)
    pin.updateFramePlacements(model, data)
    frames = [model.getFrameId(foot.frame) for foot in spec.feet]
    J = np.vstack([pin.getFrameJacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED) for frame in frames])
    feet = J @ inverse
    moved = inverse - feet.T @ np.linalg.pinv(feet @ J.T, rcond=RIGID) @ feet
    return 1.0 / np.diag(moved)[6:]
