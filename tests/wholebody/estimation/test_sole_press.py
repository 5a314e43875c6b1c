"""Strategy: torques that a known force on a sole makes, at rest and while the leg swings; it is found, and no other."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from models import g1
from models.pinocchio_model import frame_id, load_pinocchio, stance_q
from wholebody.estimation.sole_press import GAP_MAX, SolePress
from wholebody.types import RobotState

DT, PUSH = 0.002, np.array([12.0, -7.0, 80.0, 1.0, -4.0, 0.5])


@pytest.fixture(scope="module")
def robot():
    spec = g1()
    return spec, load_pinocchio(spec)


def states(spec, model, speed, pushed):
    """States of a robot whose left knee and hip turn to and fro, with a force and moment on its left foot."""
    data, q_0 = model.createData(), stance_q(spec, model)
    turns = np.zeros(model.nv)
    for name in ("left_knee_joint", "left_hip_pitch_joint"):
        turns[model.idx_vs[model.getJointId(name)]] = speed
    for k in range(60):
        t = k * DT
        q, v = pin.integrate(model, q_0, turns * np.sin(8.0 * t) / 8.0), turns * np.cos(8.0 * t)
        needed = pin.rnea(model, data, q, v, -8.0 * turns * np.sin(8.0 * t))
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacements(model, data)
        J = pin.getFrameJacobian(model, data, frame_id(model, spec.feet[0].frame), pin.LOCAL_WORLD_ALIGNED)
        yield RobotState(t, q, v, (needed - J.T @ (pushed * PUSH))[6:])


@pytest.mark.parametrize("speed", [0.0, 1.5])
@pytest.mark.parametrize("pushed", [0.0, 1.0])
def test_a_force_on_a_sole_is_found_also_while_the_leg_swings(robot, speed, pushed):
    press = SolePress(*robot)
    found = [press.look(state) for state in states(*robot, speed, pushed)]
    assert found[0] is None
    left, right = found[-1]
    assert left == pytest.approx(pushed * PUSH[2], rel=0.03, abs=1.0)  # torques are filtered, and levers turn
    assert right == pytest.approx(0.0, abs=1.0)


def test_nothing_is_told_without_torques_or_after_a_gap(robot):
    press, given = SolePress(*robot), list(states(*robot, 0.0, 1.0))
    assert press.look(given[0]) is None
    known = press.look(given[1])
    assert known is not None
    assert press.look(given[1]) is known, "the same state again"
    assert press.look(replace(given[2], time=given[1].time + 2.0 * GAP_MAX)) is None
    assert press.look(replace(given[3], tau=None)) is None
    assert press.look(given[4]) is None
