"""The joint command without a whole-body program: once standing is lost."""

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
