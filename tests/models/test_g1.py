"""The G1's description: order, numbers, stance. Physics libraries are used only to judge the stance."""

import re
import subprocess
import sys

import numpy as np
import pinocchio as pin
import pytest

from models import RobotSpecError, g1
from models.pinocchio_model import load_pinocchio, stance_q
from models.unitree_g1 import ACCELERATION, ARMATURE, GAINS, VELOCITY_SHARE

VARIANTS = pytest.mark.parametrize("hands", [True, False])


def stance_state(spec):
    model = load_pinocchio(spec)
    data = model.createData()
    q = stance_q(spec, model)
    pin.framesForwardKinematics(model, data, q)
    return model, data, q


def test_importing_models_loads_no_physics_library():
    code = "import sys, models; print([m for m in ('pinocchio','mujoco','placo','scipy','torch') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_motor_order_is_unitrees():
    names = g1().joint_names
    assert len(names) == 43
    assert len(g1(hands=False).joint_names) == 29
    assert names[:29] == g1(hands=False).joint_names
    assert names[0] == "left_hip_pitch_joint"
    assert names[12:15] == ("waist_yaw_joint", "waist_roll_joint", "waist_pitch_joint")
    assert names[22] == "right_shoulder_pitch_joint"
    fingers = [re.sub(r"_hand|_joint", "", name) for name in names[29:]]
    assert fingers[3:7] == ["left_middle_0", "left_middle_1", "left_index_0", "left_index_1"]
    assert fingers[10:14] == ["right_index_0", "right_index_1", "right_middle_0", "right_middle_1"]


@VARIANTS
def test_limits_come_from_the_urdf(hands):
    spec = g1(hands)
    model = pin.buildModelFromUrdf(str(spec.urdf), pin.JointModelFreeFlyer())
    for joint in spec.joints:
        entry = model.joints[model.getJointId(joint.name)]
        assert joint.position_min == model.lowerPositionLimit[entry.idx_q]
        assert joint.position_max == model.upperPositionLimit[entry.idx_q]
        assert joint.effort_max == model.effortLimit[entry.idx_v]
        assert joint.velocity_max <= model.velocityLimit[entry.idx_v]


def test_linkage_effort_changes_ankles_and_waist_only():
    base, strong = g1(), g1(linkage_effort=50.0)
    changed = {n for n, a, b in zip(base.joint_names, base.effort_max, strong.effort_max, strict=True) if a != b}
    assert changed == {
        "waist_roll_joint",
        "waist_pitch_joint",
        *(f"{side}_ankle_{axis}_joint" for side in ("left", "right") for axis in ("pitch", "roll")),
    }
    assert strong.effort_max[strong.index("waist_pitch_joint")] == 50.0


@pytest.mark.parametrize("table", [ARMATURE, GAINS, VELOCITY_SHARE, ACCELERATION])
def test_every_joint_is_matched_by_exactly_one_pattern(table):
    for name in g1().joint_names:
        assert sum(bool(re.fullmatch(pattern, name)) for pattern in table) == 1
    for pattern in table:
        assert any(re.fullmatch(pattern, name) for name in g1().joint_names)


@VARIANTS
def test_left_and_right_have_equal_numbers(hands):
    spec = g1(hands)
    for joint in spec.joints:
        if not joint.name.startswith("left_"):
            continue
        twin = spec.joints[spec.index(joint.name.replace("left_", "right_", 1))]
        for field in ("velocity_max", "acceleration_max", "effort_max", "armature", "kp", "kd"):
            assert getattr(joint, field) == getattr(twin, field)


@VARIANTS
def test_stance_puts_flat_soles_around_the_world_origin(hands):
    spec = g1(hands)
    model, data, _ = stance_state(spec)
    centers = []
    for foot in spec.feet:
        placement = data.oMf[model.getFrameId(foot.frame)]
        np.testing.assert_allclose(placement.rotation, np.eye(3), atol=1e-6)
        np.testing.assert_allclose(foot.points @ placement.rotation.T[:, 2] + placement.translation[2], 0, atol=1e-6)
        centers.append(placement.act(foot.sole_center))
    np.testing.assert_allclose(0.5 * (centers[0] + centers[1]), 0, atol=1e-6)
    np.testing.assert_allclose(centers[0] - centers[1], [0, 0.238, 0], atol=1e-6)


@VARIANTS
def test_stance_has_the_com_over_the_sole_midpoint_and_bent_knees(hands):
    spec = g1(hands)
    model, data, q = stance_state(spec)
    assert np.abs(pin.centerOfMass(model, data, q)[:2]).max() < 1e-3
    for side in ("left", "right"):
        assert 0.3 <= spec.stance.joints[spec.index(f"{side}_knee_joint")] <= 0.5


@VARIANTS
def test_stance_has_level_hands_in_front(hands):
    spec = g1(hands)
    model, data, _ = stance_state(spec)
    for tool, sign in zip(spec.tools, (1, -1), strict=True):
        wrist = data.oMf[model.getFrameId(tool.wrist_frame)]
        np.testing.assert_allclose(wrist.rotation, np.eye(3), atol=1e-6)
        np.testing.assert_allclose(wrist.act(np.array(tool.palm_offset)), [0.26, 0.20 * sign, 0.86], atol=2e-5)


@VARIANTS
def test_stance_keeps_a_margin_to_every_limit(hands):
    spec = g1(hands)
    assert (spec.stance.joints - spec.position_min).min() > 0.05
    assert (spec.position_max - spec.stance.joints).min() > 0.05


def test_relaxed_fingers_bend_the_same_way_on_both_hands():
    spec = g1()
    left, right = spec.group_indices("left_hand"), spec.group_indices("right_hand")
    by_name = {spec.joint_names[i].split("hand_")[1]: spec.stance.joints[i] for i in left}
    for i in right:
        assert spec.stance.joints[i] == -by_name[spec.joint_names[i].split("hand_")[1]]
    assert spec.hand_neutral == tuple(spec.stance.joints[29:])


@pytest.mark.parametrize("pose", ["hand_neutral", "hand_open", "hand_closed"])
def test_hand_poses_are_inside_the_limits(pose):
    spec = g1()
    angles = np.array(getattr(spec, pose))
    assert angles.shape == (14,)
    assert (angles >= spec.position_min[29:]).all()
    assert (angles <= spec.position_max[29:]).all()
    assert getattr(g1(hands=False), pose) == ()


def test_foot_support_is_centred_ahead_of_the_ankle():
    np.testing.assert_allclose(g1().foot("left").sole_center, [0.035, 0, -0.035], atol=1e-15)


def test_an_unknown_joint_is_answered_with_near_names():
    with pytest.raises(RobotSpecError, match="left_knee_joint"):
        g1().index("left_kne_joint")
    with pytest.raises(RobotSpecError, match="groups: left_arm"):
        g1().group_indices("tail")
    with pytest.raises(RobotSpecError, match="sides: left, right"):
        g1().tool("middle")


def test_with_joints_changes_what_the_pattern_matches():
    spec = g1().with_joints({".*_hand_.*": {"kp": 3.0}, "left_hand_thumb_0_joint": {"kp": 4.0}})
    assert spec.kp[29] == 4.0
    assert set(spec.kp[30:]) == {3.0}
    assert g1().kp[29] == 1.5
    with pytest.raises(RobotSpecError, match="matches no joint"):
        g1().with_joints({"hand": {"kp": 3.0}})
    with pytest.raises(RobotSpecError, match="do not exist"):
        g1().with_joints({".*": {"gain": 3.0}})


@pytest.mark.parametrize(
    ("field", "value"),
    [("effort_max", float("nan")), ("effort_max", 0.0), ("kp", -1.0), ("armature", float("inf")), ("velocity_max", -1)],
)
def test_senseless_numbers_are_refused_by_name(field, value):
    with pytest.raises(RobotSpecError, match=rf"left_knee_joint.*{field}"):
        g1().with_joints({"left_knee_joint": {field: value}})


def test_arrays_of_a_spec_cannot_be_written_to():
    with pytest.raises(ValueError, match="read-only"):
        g1().kp[0] = 1.0
