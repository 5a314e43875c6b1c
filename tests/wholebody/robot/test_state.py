"""Strategy: every Jacobian and drift against central differences of the velocity along a constant acceleration."""

import numpy as np
import pinocchio as pin
import pytest

from models import g1
from models.pinocchio_model import stance_q
from wholebody.errors import InputError
from wholebody.robot.state import Robot

STEP = 1e-5


@pytest.fixture(scope="module")
def robot():
    return Robot(g1())


def random_state(robot, seed):
    rng = np.random.default_rng(seed)
    q = pin.integrate(robot.model, stance_q(robot.spec, robot.model), 0.3 * rng.normal(size=robot.nv))
    return q, rng.normal(size=robot.nv), 3.0 * rng.normal(size=robot.nv)


def along(robot, q, v, dv, s):
    robot.update(pin.integrate(robot.model, q, v * s + 0.5 * dv * s * s), v + dv * s)
    return {
        "hand": robot.velocity("left_palm_point").copy(),
        "pelvis": robot.velocity("pelvis").copy(),
        "com": robot.com_velocity.copy(),
        "momentum": robot.momentum.copy(),
    }


@pytest.mark.parametrize("seed", range(5))
def test_accelerations_are_jacobian_times_dv_plus_drift(robot, seed):
    q, v, dv = random_state(robot, seed)
    after, before = along(robot, q, v, dv, STEP), along(robot, q, v, dv, -STEP)
    measured = {name: (after[name] - before[name]) / (2.0 * STEP) for name in after}
    robot.update(q, v)
    predicted = {
        "hand": robot.jacobian("left_palm_point") @ dv + robot.drift("left_palm_point"),
        "pelvis": robot.jacobian("pelvis") @ dv + robot.drift("pelvis"),
        "com": robot.J_com @ dv + robot.drift_com,
        "momentum": robot.J_momentum @ dv + robot.drift_momentum,
    }
    for name, value in predicted.items():
        np.testing.assert_allclose(value, measured[name], atol=1e-5, err_msg=name)


def test_the_equation_of_motion_is_that_of_inverse_dynamics(robot):
    q, v, dv = random_state(robot, 11)
    robot.update(q, v)
    expected = pin.rnea(robot.model, robot.model.createData(), q, v, dv)
    np.testing.assert_allclose(robot.M @ dv + robot.nle, expected, atol=1e-10)


def test_unknown_frames_and_joints_are_named(robot):
    with pytest.raises(InputError, match="no frame 'left_paw'"):
        robot.frame_id("left_paw")
    with pytest.raises(InputError, match="unknown joints"):
        robot.joint_indices(["left_wing_joint"])
