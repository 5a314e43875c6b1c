"""The tasks and contacts that a configuration asks for."""

from __future__ import annotations

import numpy as np

from models.spec import RobotSpec
from wholebody.config import ControllerConfig
from wholebody.contacts.foot import FootContact
from wholebody.robot.state import Robot
from wholebody.tasks.body_tasks import BodyTasks
from wholebody.tasks.com import ComTask
from wholebody.tasks.foot import FootTask
from wholebody.tasks.hand import HandTask
from wholebody.tasks.height import HeightTask
from wholebody.tasks.momentum import AngularMomentumTask
from wholebody.tasks.orientation import OrientationTask
from wholebody.tasks.posture import PostureTask


def make_tasks(spec: RobotSpec, config: ControllerConfig, robot: Robot) -> BodyTasks:
    """Tasks with the gains and weights of a configuration."""
    body = config.body
    trunk = {"kp": body.trunk_kp, "kd": body.trunk_kd}
    fingers = np.flatnonzero(spec.is_finger[robot.motor_to_pin])
    kp, kd, weight = (
        np.full(robot.n_joints, value) for value in (body.posture_kp, body.posture_kd, body.posture_weight)
    )
    for array, value in ((kp, body.finger_kp), (kd, body.finger_kd), (weight, body.finger_weight)):
        array[fingers] = value
    return BodyTasks(
        palms=_hands(spec, config),
        pelvis=OrientationTask(spec.base_body, weight=body.pelvis_weight, **trunk),
        torso=OrientationTask(spec.torso_body, weight=body.torso_weight, **trunk),
        height=HeightTask(spec.base_body, weight=body.height_weight, **trunk),
        com=ComTask(kp=body.com_kp, kd=body.com_kd, weight=body.com_weight),
        momentum=AngularMomentumTask(kd=body.momentum_kd, weight=body.momentum_weight),
        posture=PostureTask(kp=kp, kd=kd, weight=weight),
        feet=tuple(_foot_up(foot.frame, config) for foot in spec.feet),
        fingers=fingers,
    )


def _foot_up(frame: str, config: ControllerConfig) -> FootTask:
    """Task of a foot that is up: gains and weights are those of a hand, which has to meet its target likewise."""
    hand = config.hand
    weights = {"position_weight": hand.position_weight, "orientation_weight": hand.orientation_weight}
    return FootTask(frame, kp=hand.kp, kd=hand.kd, **weights)


def _hands(spec: RobotSpec, config: ControllerConfig) -> tuple[HandTask, ...]:
    hand = config.hand
    weights = {"position_weight": hand.position_weight, "orientation_weight": hand.orientation_weight}
    return tuple(HandTask(tool.palm_frame, kp=hand.kp, kd=hand.kd, **weights) for tool in spec.tools)


def make_feet(spec: RobotSpec, config: ControllerConfig) -> tuple[FootContact, ...]:
    """Both feet on the floor."""
    return tuple(
        FootContact(
            foot.frame,
            foot.points,
            friction=config.friction,
            force_min=config.force_min,
            force_max=config.force_max,
            kp=config.foot_kp,
            kd=config.foot_kd,
        )
        for foot in spec.feet
    )
