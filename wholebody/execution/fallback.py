"""Joint commands without a whole-body program: once standing is lost, and while there is no usable state."""

from __future__ import annotations

import numpy as np

from models.spec import RobotSpec
from wholebody.robot.state import Robot
from wholebody.types import JointCommand, RobotState

DAMPING_KD = 8.0
"""Joint damping once standing is lost: what Unitree's own damping command uses [N m s/rad]."""


def damping_command(spec: RobotSpec, robot: Robot, state: RobotState) -> JointCommand:
    """Joints only damped. Wrists and fingers are too light for the full damping: at 500 Hz it would shake them."""
    zero = np.zeros(spec.n_joints)
    light = [("_wrist_" in name or "_hand_" in name) for name in spec.joint_names]
    kd = np.where(light, spec.kd, DAMPING_KD)
    return JointCommand(state.time, state.q[7:][robot.pin_to_motor], zero, zero, zero, kd)


def standing_command(spec: RobotSpec, robot: Robot, state: RobotState) -> JointCommand:
    """Hold a configuration, with the torques that carry it on both feet unaccounted for: gravity and bias only.

    Args:
        spec: The robot.
        robot: At the state.
        state: What is held.
    """
    order = robot.pin_to_motor
    return JointCommand(state.time, state.q[7:][order], np.zeros(spec.n_joints), robot.nle[6:][order], spec.kp, spec.kd)


def held_command(before: JointCommand, time: float) -> JointCommand:
    """The last command again, at rest."""
    return JointCommand(time, before.q, np.zeros_like(before.dq), before.tau, before.kp, before.kd)
