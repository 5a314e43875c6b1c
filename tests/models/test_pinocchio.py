"""The Pinocchio model: limits, frames, payload, collision pairs."""

import dataclasses
import json

import numpy as np
import pinocchio as pin
import pytest

from models import RobotSpecError, g1
from models.pinocchio_model import (
    add_tool_frames,
    frame_id,
    load_collision,
    load_pinocchio,
    palm_frame_ids,
    stance_q,
)
from models.urdf import JointTree, light_urdf, parse


@pytest.mark.parametrize("hands", [True, False])
def test_limits_of_the_base_are_infinite_and_of_the_joints_finite(hands):
    model = load_pinocchio(g1(hands))
    for limit, base in ((model.effortLimit, 6), (model.velocityLimit, 6), (model.upperPositionLimit, 3)):
        assert np.isposinf(limit[:base]).all()
        assert np.isfinite(limit[base + 4 :]).all()
    assert np.isneginf(model.lowerPositionLimit[:3]).all()
    assert np.all(np.abs(model.lowerPositionLimit[7:]) < 4)


def test_changed_numbers_reach_the_model():
    spec = g1(linkage_effort=50.0).with_joints(
        {"left_knee_joint": {"armature": 0.5, "damping": 0.1, "friction_loss": 0.2, "velocity_max": 3.0}}
    )
    model = load_pinocchio(spec)
    v = model.joints[model.getJointId("left_knee_joint")].idx_v
    assert (model.armature[v], model.damping[v], model.friction[v], model.velocityLimit[v]) == (0.5, 0.1, 0.2, 3.0)
    assert model.effortLimit[model.joints[model.getJointId("waist_pitch_joint")].idx_v] == 50.0


@pytest.mark.parametrize("hands", [True, False])
def test_palm_points_are_frames_of_the_wrists(hands):
    spec = g1(hands)
    model = load_pinocchio(spec)
    data = model.createData()
    pin.framesForwardKinematics(model, data, pin.randomConfiguration(model, -np.ones(model.nq), np.ones(model.nq)))
    for tool, index in zip(spec.tools, palm_frame_ids(spec, model), strict=True):
        wrist, body = (data.oMf[frame_id(model, name)] for name in (tool.wrist_frame, tool.palm_body))
        placement = wrist.actInv(data.oMf[index])
        np.testing.assert_allclose(placement.homogeneous[:3, 3], tool.palm_offset, atol=1e-12)
        np.testing.assert_allclose(wrist.actInv(body).translation, tool.palm_body_offset, atol=1e-12)
        np.testing.assert_allclose(body.actInv(data.oMf[index]).translation, [0.08, 0, 0], atol=1e-12)
        assert model.frames[index].type == pin.FrameType.OP_FRAME


def test_tool_frames_are_added_once():
    spec = g1()
    model = load_pinocchio(spec)
    n = model.nframes
    add_tool_frames(spec, model)
    assert model.nframes == n


def test_an_unknown_frame_is_an_error_that_names_bodies():
    with pytest.raises(RobotSpecError, match="left_ankle_roll_link"):
        frame_id(load_pinocchio(g1()), "left_foot")


def test_a_spec_of_another_robot_is_refused():
    hands, none = g1(), g1(hands=False)
    with pytest.raises(RobotSpecError, match="left_hand_thumb_0_joint"):
        load_pinocchio(dataclasses.replace(none, urdf=hands.urdf))


def test_payload_adds_its_mass_ahead_of_the_palm():
    spec = g1()
    plain, loaded = load_pinocchio(spec), load_pinocchio(spec, payload_kg=(2.0, 0.0))
    assert pin.computeTotalMass(loaded) - pin.computeTotalMass(plain) == pytest.approx(2.0, abs=1e-12)
    data, q = loaded.createData(), pin.neutral(loaded)
    pin.framesForwardKinematics(loaded, data, q)
    point = data.oMf[frame_id(loaded, "left_hand_palm_link")].act(np.array([0.10, 0, 0]))
    com = pin.centerOfMass(plain, plain.createData(), q)
    mass = pin.computeTotalMass(plain)
    expected = (mass * com + 2.0 * point) / (mass + 2.0)
    np.testing.assert_allclose(pin.centerOfMass(loaded, data, q), expected, atol=1e-12)
    for wrong in (-1.0, float("nan"), float("inf")):
        with pytest.raises(RobotSpecError, match="right hand"):
            load_pinocchio(spec, payload_kg=(0.0, wrong))


@pytest.mark.parametrize("hands", [True, False])
def test_pairs_leave_out_neighbours_and_the_inside_of_a_hand(hands):
    spec = g1(hands)
    model = load_pinocchio(spec)
    geometry = load_collision(spec, model)
    tree = JointTree(parse(light_urdf(spec)))
    names = [shape.name.rpartition("_")[0] for shape in geometry.geometryObjects]
    pairs = {(names[pair.first], names[pair.second]) for pair in geometry.collisionPairs}
    assert len(geometry.collisionPairs) == (1159 if hands else 612)
    assert all(tree.joints_between(*pair) > 2 for pair in pairs)
    for side in ("left", "right"):
        assert not any(all(name.startswith(f"{side}_hand_") for name in pair) for pair in pairs)
    linked = {frozenset(pair) for pair in pairs}
    assert frozenset(("torso_link", "left_shoulder_yaw_link")) in linked
    assert frozenset(("left_ankle_roll_link", "right_ankle_roll_link")) in linked
    palm = spec.tool("left").palm_body
    assert frozenset((palm, "pelvis_contour_link")) in linked
    assert len(json.loads(light_urdf(spec).with_name("collisions.json").read_text())) == len(pairs)


@pytest.mark.parametrize("hands", [True, False])
def test_the_stance_is_clear_of_itself(hands):
    spec = g1(hands)
    model = load_pinocchio(spec)
    geometry = load_collision(spec, model)
    q = stance_q(spec, model)
    data = geometry.createData()
    pin.computeDistances(model, model.createData(), geometry, data, q)
    assert min(result.min_distance for result in data.distanceResults) > 0.015


def test_joints_between_links_are_counted_through_fixed_ones():
    tree = JointTree(parse(light_urdf(g1())))
    assert tree.joints_between("torso_link", "head_link") == 0
    assert tree.joints_between("left_hand_palm_link", "left_wrist_yaw_link") == 0
    assert tree.joints_between("left_hand_palm_link", "left_hand_thumb_2_link") == 3
    assert tree.joints_between("left_hand_thumb_2_link", "left_hand_index_1_link") == 5
    assert tree.joints_between("pelvis", "left_knee_link") == 4
    assert tree.joints_between("left_ankle_roll_link", "right_ankle_roll_link") == 12
