"""Observations: what a policy is shown of the robot."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pinocchio as pin

from models.spec import RobotSpec
from policy.joints import layout_robot
from policy.observation import Observation
from wholebody.robot.state import Robot
from wholebody.types import RobotState


def observation_of(
    spec: RobotSpec,
    robot: Robot,
    state: RobotState,
    task: str = "",
    images: Mapping[str, np.ndarray] | None = None,
    objects: np.ndarray | None = None,
) -> Observation:
    """Observation where there is no supervisor: the robot's model knows the order of the joints."""
    joints = state.q[7:][robot.pin_to_motor]
    fingers = fingers_of(spec, joints)
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = pin.Quaternion(state.q[3:7]).toRotationMatrix(), state.q[:3]
    return Observation(
        time=state.time,
        q_body=joints[: len(spec.body_joints)],
        q_lhand=fingers[0],
        q_rhand=fingers[1],
        T_world_base=T,
        images=images or {},
        task=task,
        objects=objects,
    )


def fingers_of(spec: RobotSpec, joints: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Fingers of left and right hand among joints in motor order [rad]; or the relaxed ones of a layout."""
    if sum(spec.fingers):
        left, right = (joints[spec.indices(tool.finger_joints)] for tool in spec.tools)
        return left, right
    robot = layout_robot(spec)
    left, right = robot.by_hand(robot.hand_neutral)
    return left, right
