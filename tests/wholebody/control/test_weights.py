"""Strategy: weights applied to a controller, read back from its tasks and from the memory of its program."""

import numpy as np
import pytest

from models import g1
from wholebody.config import ControllerConfig
from wholebody.control.controller import WholeBodyController
from wholebody.control.weights import RECOVERING, WALKING, Weights


@pytest.mark.parametrize("weights", [WALKING, RECOVERING])
def test_tasks_and_program_weigh_the_same(weights):
    controller = WholeBodyController(g1(), ControllerConfig())
    tasks, tick = controller.tasks, controller.compiled.tick
    fingers = tasks.posture.weight[tasks.fingers].copy()
    controller.weigh(weights)
    assert np.array_equal(tasks.com.weight, tick.com_weight)
    assert tasks.momentum.weight[0] == tick.momentum_weight == weights.momentum
    for name in ("pelvis", "torso", "height"):
        assert getattr(tasks, name).weight[0] == getattr(tick, f"{name}_gain")[3] == getattr(weights, name)
    assert np.array_equal(tasks.posture.weight, tick.posture_weight)
    knee = controller.robot.joint_names.index("left_knee_joint")
    elbow = controller.robot.joint_names.index("left_elbow_joint")
    assert (tick.posture_weight[knee], tick.posture_weight[elbow]) == (weights.legs, weights.upper)
    assert np.array_equal(tick.posture_weight[tasks.fingers], fingers)
    assert tick.foot_kd == controller.feet[0].kd == weights.landing
    assert not controller.balance.active


def test_those_of_standing_are_those_of_the_configuration():
    controller, fresh = (WholeBodyController(g1(), ControllerConfig()) for _ in range(2))
    controller.weigh(WALKING)
    controller.weigh(Weights.standing(controller.config))
    assert np.array_equal(controller.compiled.tick.memory, fresh.compiled.tick.memory)
    assert controller.balance.active
