"""Strategy: torques of a robot at rest that is pushed at a palm, from statics, and what is seen of the push."""

import numpy as np
import pinocchio as pin
import pytest

from models import g1
from models.pinocchio_model import stance_q
from wholebody.estimation.body_push import BodyPush
from wholebody.robot.state import Robot
from wholebody.types import RobotState

SPEC = g1()


def pushed_at_rest(robot, q, push):
    """Torques (n_joints,) of a robot that stands still on both feet, pushed at its left palm (3,) [N]; where [m]."""
    robot.update(q, np.zeros(robot.nv))
    palm = SPEC.tool("left").palm_frame
    feet = np.vstack([robot.jacobian(foot.frame) for foot in SPEC.feet])
    needed = robot.nle - robot.jacobian(palm)[:3].T @ push
    floor = np.linalg.lstsq(feet[:, :6].T, needed[:6], rcond=None)[0]
    return (needed - feet.T @ floor)[6:], robot.pose(palm).translation.copy()


@pytest.mark.parametrize("push", [(0.0, 0.0, 0.0), (25.0, 0.0, 0.0), (-10.0, 15.0, -20.0)])
def test_a_push_is_seen_whole_and_where_it_acts_by_what_the_floor_gives(push):
    robot = Robot(SPEC)
    q, zero = stance_q(SPEC, robot.model), np.zeros(robot.nv)
    tau, palm = pushed_at_rest(robot, q, np.array(push))
    body = BodyPush(robot)
    for k in range(1000):
        body.look(RobotState(0.002 * k, q, zero, tau))
    np.testing.assert_allclose(body.wrench, [*push, *np.cross(palm, push)], atol=0.05)


def test_a_robot_that_falls_freely_is_pushed_by_nothing():
    """Its momentum grows as gravity has it, and legs that only carry themselves push no floor."""
    robot = Robot(SPEC)
    q, v, body = stance_q(SPEC, robot.model), np.zeros(robot.nv), BodyPush(robot)
    own = pin.nonLinearEffects(robot.model, robot.scratch, q, v)[6:]
    for time in 0.05 * np.arange(20):
        v[2], q[2] = -9.81 * time, 1.0 - 0.5 * 9.81 * time**2
        body.look(RobotState(time, q.copy(), v.copy(), own))
    assert np.abs(body.wrench).max() < 1e-6 * robot.mass


def test_a_state_without_torques_and_one_after_a_gap_say_nothing():
    robot = Robot(SPEC)
    q, zero, body = stance_q(SPEC, robot.model), np.zeros(robot.nv), BodyPush(robot)
    assert not body.look(RobotState(0.0, q, zero, None))
    for time in (0.0, 0.1, 5.0):
        assert body.look(RobotState(time, q, zero, np.zeros(robot.n_joints)))
    assert not body.wrench.any()
    assert not body.look(RobotState(5.01, q, zero, np.zeros(robot.n_joints)))
