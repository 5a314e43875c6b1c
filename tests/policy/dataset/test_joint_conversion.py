"""Joints to wrists and back: against Pinocchio, against a round trip, and against what cannot be known."""

import numpy as np
import pytest

from models import g1
from policy.action_spec.anchor import Anchor
from policy.action_spec.builtin import builtin
from policy.action_spec.slot import DEX1_OPEN
from policy.dataset.joint_conversion import JointConversion, round_trip
from policy.dataset.joint_layout import joint_layout
from policy.dataset.naming.meaning import UNITREE_DEX3
from policy.errors import ChunkError, DatasetError, SpecError
from policy.geometry.rotations import matrix_to_rot6d
from policy.kinematics.forward import IK_TOLERANCE, kinematics
from policy.kinematics.inverse import ARMS, reach
from tests.support.joint_cases import DEX1, DEX3, swinging

WBC32, WBC27 = builtin("wbc32"), builtin("wbc27")
WITH_WAIST = joint_layout([*UNITREE_DEX3, "kWaistYaw", "kWaistRoll", "kWaistPitch"], 31)
MM, HUNDREDTH_DEGREE = 1e-3, np.deg2rad(0.01)


def test_wrists_are_where_pinocchio_puts_them():
    q = swinging(frames=3).astype(float)
    numbers = JointConversion(DEX3, builtin("wbc32-v1"), waist=(0.2, -0.1, 0.15)).forward(q)
    q_body = Anchor.nominal().q_body.copy()
    for joint, angle in zip(
        ("waist_yaw_joint", "waist_roll_joint", "waist_pitch_joint"), (0.2, -0.1, 0.15), strict=True
    ):
        q_body[g1().body_joints.index(joint)] = angle
    for name, angle in zip(DEX3.names[:14], q[1], strict=False):
        q_body[g1().body_joints.index(name)] = angle
    T = kinematics().poses(q_body)
    assert np.allclose(numbers[1, :3], T["lhand"][:3, 3], atol=1e-12)
    assert np.allclose(numbers[1, 3:9], matrix_to_rot6d(T["lhand"][:3, :3], "cols"), atol=1e-12)
    assert np.allclose(numbers[1, 9:12], T["rhand"][:3, 3], atol=1e-12)


@pytest.mark.parametrize("share", [0.1, 0.25, 0.35])
def test_a_round_trip_through_float32_is_within_a_tenth_of_a_millimetre(share):
    q = swinging(frames=150, seed=2, share=share)
    conversion = JointConversion(DEX3, WBC32)
    trip = round_trip(conversion, q, conversion.forward(q).astype(np.float32))
    assert trip.frames == 150
    assert trip.unreached == 0
    assert trip.position <= 0.1 * MM
    assert trip.rotation <= HUNDREDTH_DEGREE
    assert trip.fingers == 0.0


def test_fingers_are_bit_for_bit_what_they_were():
    q = swinging()
    numbers = JointConversion(DEX3, WBC32).forward(q).astype(np.float32)
    assert np.array_equal(numbers[:, 18:], q[:, 14:])


def test_a_recorded_waist_is_used_and_not_assumed():
    q = swinging(WITH_WAIST, share=0.1)
    conversion = JointConversion(WITH_WAIST, WBC27, waist=(9.0, 9.0, 9.0), synergy="dex3_open_close")
    numbers = conversion.forward(q)
    roll, pitch, yaw = numbers[:, WBC27.slot("waist").indices].T
    assert np.allclose(np.stack([yaw, roll, pitch], axis=1), q[:, 28:], atol=1e-7)
    assert not any(name.startswith("waist") for name in conversion.assumptions)


def test_a_waist_that_was_not_recorded_is_an_assumption():
    assert JointConversion(DEX3, WBC32, waist=(0.0, 0.0, 0.1)).assumptions == {
        "waist_yaw_joint [rad]": 0.0,
        "waist_roll_joint [rad]": 0.0,
        "waist_pitch_joint [rad]": 0.1,
    }


def test_grippers_become_closings_and_come_back():
    q = swinging(DEX1)
    conversion = JointConversion(DEX1, WBC27)
    numbers = conversion.forward(q)
    assert np.allclose(numbers[:, WBC27.slot("left_grasp").start], 1.0 - q[:, 14] / DEX1_OPEN, atol=1e-6)
    assert conversion.assumptions["base_velocity [m/s, rad/s]"] == 0.0
    trip = round_trip(conversion, q, numbers.astype(np.float32))
    assert trip.position <= 0.1 * MM
    assert trip.fingers <= 1e-5


def test_grippers_become_fingers_only_by_a_named_synergy():
    with pytest.raises(DatasetError, match="--synergy dex3_open_close, or keep the hands as they are with --to wbc27"):
        JointConversion(DEX1, WBC32)
    conversion = JointConversion(DEX1, WBC32, synergy="dex3_open_close")
    assert conversion.assumptions["synergy"] == "dex3_open_close"
    assert conversion.forward(swinging(DEX1)).shape == (40, 32)


def test_fingers_become_one_number_only_by_a_named_synergy():
    with pytest.raises(DatasetError, match="--to wbc32"):
        JointConversion(DEX3, WBC27)
    with pytest.raises(DatasetError, match="no synergy is called 'open'"):
        JointConversion(DEX3, WBC27, synergy="open")


@pytest.mark.parametrize("name", ["joint28", "gr00t_g1"])
def test_layouts_that_are_no_absolute_wrists_in_the_pelvis_are_refused(name):
    with pytest.raises(SpecError, match=r"such as wbc32|cannot be filled"):
        JointConversion(DEX3, builtin(name))


@pytest.mark.parametrize("waist", [(0.0, 0.0), (0.0, np.nan, 0.0)])
def test_a_waist_that_is_no_three_angles_is_refused(waist):
    with pytest.raises(DatasetError, match="waist_yaw_joint, waist_roll_joint"):
        JointConversion(DEX3, WBC32, waist=waist)


def test_the_waist_moves_only_where_there_is_a_place_for_it():
    with pytest.raises(SpecError, match="moving='arms'"):
        JointConversion(DEX3, WBC32, moving="upper_body")


def test_upper_body_leans_where_the_arms_alone_do_not_reach():
    layout = WITH_WAIST
    rest = JointConversion(layout, WBC32)
    start = rest.backward(JointConversion(DEX3, WBC32).forward(swinging(frames=1, share=0.0)))[0][0]
    leaning = start.copy()
    leaning[30], leaning[3], leaning[0] = 0.45, 1.5, -1.2
    leaning[10], leaning[7] = 1.5, -1.2
    goal = rest.forward(leaning[None])
    _, errors = rest.backward(goal, start)
    assert errors[0] > IK_TOLERANCE
    back, errors = JointConversion(layout, WBC32, moving="upper_body").backward(goal, start)
    assert errors[0] <= IK_TOLERANCE
    assert abs(back[0, 30]) > 0.05


def test_a_pose_out_of_reach_is_reported_and_the_nearest_is_taken():
    conversion = JointConversion(DEX3, WBC32)
    numbers = conversion.forward(swinging(frames=2))
    numbers[1, 0] += 1.0
    joints, errors = conversion.backward(numbers)
    assert errors[0] <= IK_TOLERANCE < errors[1]
    assert np.isfinite(joints).all()


def test_joint_vectors_of_another_width_are_refused():
    with pytest.raises(ChunkError, match=r"\(n, 28\) is expected"):
        JointConversion(DEX3, WBC32).forward(swinging(DEX1))


def test_poses_at_the_joint_limits_are_found_from_the_stance():
    """Steps that were only clipped stalled at limits: 114 mm were left on a large swing."""
    q0, spread = Anchor.nominal().q_body, np.random.default_rng(4)
    model = kinematics().model
    low, high = (x[kinematics().idx_q] for x in (model.lowerPositionLimit, model.upperPositionLimit))
    missed = 0
    for _ in range(40):
        share = spread.uniform(0.0, 0.1, 29)
        q = np.where(spread.uniform(size=29) < 0.5, low + share * (high - low), high - share * (high - low))
        for hand, limb in ARMS.items():
            arm = g1().limbs[limb]
            posture = q0.copy()
            posture[arm] = q[arm]
            found, error = reach({hand: kinematics().poses(posture)[hand]}, arm, q0, q0)
            missed += not error <= IK_TOLERANCE
            assert (found[arm] >= low[arm] - 1e-12).all()
            assert (found[arm] <= high[arm] + 1e-12).all()
    assert missed <= 1
