"""Strategy: random postures around the stance; poses of the wrists by Pinocchio."""

import numpy as np
import pinocchio as pin
import pytest

from models import g1
from models.pinocchio_model import stance_q
from wholebody.config import TrajectoryConfig
from wholebody.execution.ahead.deviation import Deviation
from wholebody.reference import HandMotion
from wholebody.robot.state import Robot

SPEC = g1()


@pytest.fixture(scope="module")
def robot():
    return Robot(SPEC)


def drawn(robot, rng, q, size):
    """A configuration whose joints are up to ``size`` [rad] away, pelvis by a tenth of it [m] and 0.3 of it [rad]."""
    step = size * rng.uniform(-1.0, 1.0, robot.nv)
    step[:3], step[3:6] = 0.1 * step[:3], 0.3 * step[3:6]
    return pin.integrate(robot.model, q, step)


def wrists(robot, q):
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    return [data.oMf[robot.frame_id(tool.wrist_frame)].copy() for tool in SPEC.tools]


def test_wrists_stay_as_far_off_the_plan_as_they_are_in_whatever_posture_it_goes_to(robot):
    """With joints alone as far off as they are, a wrist was 26 mm elsewhere (median), and the next plan began so."""
    deviation, rng, missed, turned = Deviation(robot, TrajectoryConfig()), np.random.default_rng(3), [], []
    for _ in range(100):
        present = drawn(robot, rng, stance_q(SPEC, robot.model), 0.4)
        later, q = drawn(robot, rng, present, 0.3), drawn(robot, rng, present, 0.25)
        found = deviation.carried(present, later, q)
        for a, b, c, T in zip(*(wrists(robot, x) for x in (present, q, later, found)), strict=True):
            error = (c * a.inverse() * b).actInv(T)
            missed.append(np.linalg.norm(error.translation))
            turned.append(np.linalg.norm(pin.log3(error.rotation)))
    assert np.quantile(missed, 0.95) < 1e-3
    assert np.quantile(turned, 0.95) < 1e-2


def test_a_robot_on_its_plan_is_foreseen_on_it_and_legs_waist_and_fingers_are_carried_as_they_are(robot):
    deviation, rng, q0 = Deviation(robot, TrajectoryConfig()), np.random.default_rng(4), stance_q(SPEC, robot.model)
    present = drawn(robot, rng, q0, 0.3)
    later, q = drawn(robot, rng, present, 0.3), drawn(robot, rng, present, 0.2)
    np.testing.assert_allclose(deviation.carried(present, later, present), later, atol=1e-9)
    off = pin.difference(robot.model, later, deviation.carried(present, later, q))
    rest = [i for i, name in enumerate(robot.joint_names) if not any(x in name for x in ("shoulder", "elbow", "wrist"))]
    expected = pin.difference(robot.model, present, q)
    np.testing.assert_allclose(off[6:][rest], expected[6:][rest], atol=1e-9)
    np.testing.assert_allclose(off[:6], expected[:6], atol=1e-9)


def test_arms_move_wrists_as_hands_are_led_and_begin_no_plan_past_a_limit(robot):
    deviation, rng, config = Deviation(robot, TrajectoryConfig()), np.random.default_rng(5), TrajectoryConfig()
    model, missed, slipped = robot.model, [], []
    for _ in range(50):
        q, v = drawn(robot, rng, stance_q(SPEC, model), 0.2), rng.normal(0.0, 0.1, model.nv)
        rows = np.zeros((2, 40))
        for row, T in zip(rows, wrists(robot, drawn(robot, rng, q, 0.1)), strict=True):
            row[:3], row[9:13] = T.translation, pin.Quaternion(T.rotation).coeffs()
            row[3:6], row[13:16] = rng.normal(0.0, 0.2, 3), rng.normal(0.0, 0.3, 3)
        found, rates = deviation.reaching(q, v, HandMotion(rows))
        arms = [i for i, name in enumerate(robot.joint_names) if any(x in name for x in ("shoulder", "elbow", "wrist"))]
        low, high = model.lowerPositionLimit[7:][arms], model.upperPositionLimit[7:][arms]
        assert (found[7:][arms] >= low + config.joint_margin - 1e-9).all()
        assert (found[7:][arms] <= high - config.joint_margin + 1e-9).all()
        assert (np.abs(rates[6:][arms]) <= config.speed_share * model.velocityLimit[6:][arms]).all()
        others = np.setdiff1d(np.arange(model.nv - 6), arms)
        np.testing.assert_array_equal(rates[:6], v[:6])
        np.testing.assert_array_equal(rates[6:][others], v[6:][others])
        data = model.createData()
        pin.forwardKinematics(model, data, found, rates)
        pin.updateFramePlacements(model, data)
        for row, tool in zip(rows, SPEC.tools, strict=True):
            frame = robot.frame_id(tool.wrist_frame)
            twist = pin.getFrameVelocity(model, data, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
            missed.append(np.linalg.norm(data.oMf[frame].translation - row[:3]))
            slipped.append(np.linalg.norm(twist.linear - row[3:6]))
    assert np.median(missed) < 1e-3
    assert np.median(slipped) < 0.05
