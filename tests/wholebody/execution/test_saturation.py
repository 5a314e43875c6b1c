"""Strategy: torques by hand: which hand gives way, when, and that a short spell does not count."""

import numpy as np
import pytest

from models import g1
from wholebody.control.reference_packet import PALM, row_length
from wholebody.execution.saturation import Saturation
from wholebody.robot.state import Robot

SPEC = g1()
ROBOT = Robot(SPEC)
EFFORT = SPEC.effort_max[ROBOT.motor_to_pin]


@pytest.fixture
def saturation():
    return Saturation(SPEC, ROBOT, EFFORT)


def spent(*joints):
    tau = 0.5 * EFFORT
    for joint in joints:
        tau[ROBOT.joint_names.index(joint)] *= -2.0
    return tau


PALMS = np.zeros((2, 3))


def row(off):
    """A packed reference with both palms that far ahead [m]."""
    out = np.zeros(row_length(ROBOT.n_joints))
    out[[9, PALM + 9]] = off
    return out


OFF = row(0.1)


def test_a_hand_that_is_where_it_should_be_is_held_on_to(saturation):
    for _ in range(100):
        trust = saturation.trust(spent("left_wrist_pitch_joint"), PALMS, row(0.004), 0.002)
    assert trust == (1.0, 1.0)


def test_an_arm_without_torque_left_lets_go_of_its_hand_and_takes_it_again(saturation):
    for _ in range(100):
        trust = saturation.trust(spent("left_wrist_pitch_joint"), PALMS, OFF, 0.002)
    np.testing.assert_allclose(trust, (0.0, 1.0), atol=0.01)
    for _ in range(50):
        trust = saturation.trust(spent(), PALMS, OFF, 0.002)
    assert trust == (1.0, 1.0)


def test_a_waist_without_torque_left_lets_go_of_both_hands(saturation):
    for _ in range(200):
        trust = saturation.trust(spent("waist_pitch_joint"), PALMS, OFF, 0.002)
    assert max(trust) < 0.01


def test_a_spell_of_20_ms_and_spent_legs_and_fingers_are_nothing(saturation):
    for _ in range(10):
        trust = saturation.trust(spent("left_elbow_joint"), PALMS, OFF, 0.002)
    assert trust == (1.0, 1.0)
    for _ in range(200):
        trust = saturation.trust(spent("left_knee_joint", "right_hand_thumb_0_joint"), PALMS, OFF, 0.002)
    assert trust == (1.0, 1.0)


def test_a_waist_that_has_no_torque_left_for_long_is_said_to_sink(saturation):
    for seconds, joint in ((0.25, "waist_roll_joint"), (0.1, "left_elbow_joint"), (0.25, "waist_roll_joint")):
        for _ in range(round(seconds / 0.002)):
            saturation.trust(spent(joint), PALMS, row(0.0), 0.002)
        assert not saturation.sinks
    for _ in range(100):
        saturation.trust(spent("waist_roll_joint"), PALMS, row(0.0), 0.002)
    assert saturation.sinks


def test_joints_of_the_waist_that_have_none_left_one_after_the_other_are_no_trunk_that_sinks(saturation):
    for joint in ("waist_pitch_joint", "waist_roll_joint", "waist_pitch_joint"):
        for _ in range(100):
            saturation.trust(spent(joint), PALMS, row(0.0), 0.002)
            assert not saturation.sinks


def test_where_the_waist_is_spent_hands_give_way_with_how_far_the_body_is_off_its_plan(saturation):
    assert not saturation.waist_is_spent
    for _ in range(100):
        trust = saturation.trust(spent("waist_pitch_joint"), PALMS, row(0.0), 0.002)
    assert trust == (1.0, 1.0)  # both palms are where they should be
    assert saturation.waist_is_spent
    assert [saturation.trust_off_plan(x) for x in (0.05, 0.19, 0.4)] == pytest.approx([1.0, 0.5, 0.0], abs=1e-2)
    for _ in range(50):
        saturation.trust(spent(), PALMS, row(0.0), 0.002)
    assert not saturation.waist_is_spent
