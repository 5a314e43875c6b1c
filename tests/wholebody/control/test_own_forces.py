"""Strategy: postures whose arms are at the end of a joint or into the trunk; touches are begun with sizes made up."""

from types import SimpleNamespace

import numpy as np
import pytest

from models import g1
from wholebody.config.touch import TouchConfig
from wholebody.control.controller import WholeBodyController
from wholebody.control.own_forces import OwnForces
from wholebody.control.touch import Touch
from wholebody.sim.plant import MujocoPlant

SPEC = g1()
JOINT = "right_shoulder_roll_joint"


@pytest.fixture(scope="module")
def state():
    return MujocoPlant(SPEC).state()


def at(state, controller, off):
    """The controller with a joint so far from the end of its range [rad]."""
    q = state.q.copy()
    j = controller.robot.joint_indices([JOINT])[0]
    q[7 + j] = controller.robot.model.lowerPositionLimit[7 + j] + off
    controller.robot.update(q, np.zeros_like(state.v))
    return controller


def test_an_arm_at_the_end_of_a_joint_is_pushed_by_its_stop(state):
    controller = WholeBodyController(SPEC)
    controller.reset(state)
    robot = controller.robot
    own = OwnForces(controller, [robot.joint_indices(robot.arm_joints(tool.side)) for tool in SPEC.tools])
    assert not own.at_stop(0)
    assert not own.at_stop(1)
    at(state, controller, 0.005)
    assert not own.at_stop(0)
    assert own.at_stop(1)
    at(state, controller, 0.05)
    assert not own.at_stop(1)


@pytest.mark.parametrize(("off", "touches"), [(0.005, False), (0.5, True)])
def test_no_touch_begins_there_and_one_that_began_goes_on(state, off, touches):
    """Stopped in a dance with a shoulder at its stop, a realistic robot felt its hand touch for 0.2 s."""
    controller = WholeBodyController(SPEC)
    controller.reset(state)
    observer = SimpleNamespace(sizes=[0.0, 20.0], wrenches=np.zeros((2, 6)))
    observer.wrenches[1, 0] = -20.0
    touch, row = Touch(controller, TouchConfig(), observer), np.zeros(1000)
    touch.look(row, 0.0, 0.002)
    assert touch.shares[1] > 0.0
    at(state, controller, off)
    for k in range(1, 20):
        touch.look(row, 0.002 * k, 0.002)
    assert touch.shares[1] == 1.0
    touch.reset()
    for k in range(20):
        touch.look(row, 0.002 * k, 0.002)
    assert (touch.shares[1] > 0.0) == touches
