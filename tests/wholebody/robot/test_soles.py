"""Strategy: the stance, where soles are known; then the pelvis is turned, and the soles with it."""

import numpy as np
import pinocchio as pin
import pytest

from models import g1
from models.pinocchio_model import stance_q
from wholebody.robot.soles import sole_poses
from wholebody.robot.state import Robot
from wholebody.sim.plant import MujocoPlant

SPEC = g1()
ROBOT = Robot(SPEC)


def test_soles_of_the_stance_lie_where_mujoco_has_them_and_flat():
    left, right = sole_poses(ROBOT, stance_q(SPEC, ROBOT.model))
    np.testing.assert_allclose([left.position, right.position], MujocoPlant(SPEC).soles(), atol=1e-6)
    for sole in (left, right):
        np.testing.assert_allclose(sole.normal, [0.0, 0.0, 1.0], atol=1e-6)
        assert abs(sole.yaw) < 1e-6


def test_a_robot_that_leans_as_a_whole_stands_on_a_slope_of_that_angle():
    q, turn = (
        stance_q(SPEC, ROBOT.model),
        pin.exp3(np.array([0.0, np.deg2rad(5.0), 0.0])) @ pin.exp3(np.array([0, 0, 0.3])),
    )
    q[3:7] = pin.Quaternion(turn).coeffs()
    for sole in sole_poses(ROBOT, q):
        np.testing.assert_allclose(sole.normal, turn[:, 2], atol=1e-6)
        assert sole.yaw == pytest.approx(0.3, abs=0.01)
