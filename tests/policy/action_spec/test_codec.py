"""Raw actions to chunks and back.

Strategy: single numbers are decoded against formulas written out here; then every layout, and every combination of
rotation form, mode, frame, unit and tool offset, encodes and decodes to what it was, at an anchor with nothing aligned.
"""

import dataclasses
import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from models import g1
from policy import LAYOUTS, ActionSpec, Anchor, ChunkError, builtin, decode, encode
from policy.action_spec.builtin import joints, stack
from policy.action_spec.codec import HINT_TOLERANCE
from policy.action_spec.hands import closing_of, grasp_posture
from policy.action_spec.mask import full_mask
from policy.action_spec.state import state_numbers
from policy.geometry.rotations import angle_between, matrix_to_rot6d, rotvec_to_matrix
from policy.geometry.se3 import inverse, make_transform, yaw_frame
from policy.joints import joints_of
from policy.kinematics.forward import kinematics
from tests.support.policy_cases import anchor_somewhere, observation, rotation_vectors, wandering_chunk

ANCHOR, G1 = anchor_somewhere(), g1()
RIGHT_HAND_JOINTS = joints_of(G1, "right_hand")
ROTATIONS = [
    {"kind": "rot6d", "size": 6, "unit": "1", "rot6d_layout": "rows"},
    {"kind": "rot6d", "size": 6, "unit": "1", "rot6d_layout": "cols"},
    {"kind": "quaternion", "size": 4, "unit": "1", "quaternion_order": "xyzw"},
    {"kind": "quaternion", "size": 4, "unit": "1", "quaternion_order": "wxyz"},
    {"kind": "rotvec", "size": 3, "unit": "rad"},
    {"kind": "rotvec", "size": 3, "unit": "deg"},
    {"kind": "rpy", "size": 3, "unit": "rad"},
    {"kind": "rpy", "size": 3, "unit": "deg"},
    {"kind": "rot6d", "size": 6, "unit": "1", "rot6d_layout": "interleaved"},
]
MODES = ("absolute", "relative_se3", "relative_add", "delta", "delta_se3")
FRAMES = ("pelvis", "pelvis_yaw", "torso", "stance", "world")


def pose_spec(rotation, mode, frame="pelvis", *, unit="m", tcp_offset=(0.0, 0.0, 0.0), hand_mode="absolute"):
    parts = []
    for side in ("left", "right"):
        shared = {"frame": frame, "mode": mode}
        position = {"kind": "position", "size": 3, "unit": unit, "tcp_offset": tcp_offset}
        parts += [
            {"name": f"{side}_wrist_position", **position, **shared},
            {"name": f"{side}_wrist_rotation", **rotation, **shared},
        ]
    hands = [joints(G1, "left_hand"), joints(G1, "right_hand", order=tuple(sorted(RIGHT_HAND_JOINTS)))]
    return ActionSpec(name="x", slots=stack(*parts, *[{**hand, "mode": hand_mode} for hand in hands]))


def assert_same_targets(found, expected, tolerance=1e-9):
    for name in ("T_world_lhand", "T_world_rhand", "q_lhand", "q_rhand"):
        assert np.abs(getattr(found, name) - getattr(expected, name)).max() < tolerance, name


@pytest.mark.parametrize(("rotation", "mode", "frame"), list(itertools.product(ROTATIONS, MODES, FRAMES)))
def test_every_form_mode_and_frame_comes_back(rotation, mode, frame):
    chunk = wandering_chunk(ANCHOR)
    hand_mode = {"relative_se3": "relative_add", "delta_se3": "delta"}.get(mode, mode)
    spec = pose_spec(rotation, mode, frame, unit="mm", tcp_offset=(0.05, -0.01, 0.02), hand_mode=hand_mode)
    actions = encode(spec, chunk, ANCHOR)
    again = decode(spec, actions, ANCHOR, seq=chunk.seq, t_obs=chunk.t_obs)
    assert_same_targets(again, chunk)
    assert np.allclose(again.times, chunk.times)
    assert again.spec_id == spec.id


@given(st.lists(rotation_vectors(), min_size=2, max_size=4), st.sampled_from(ROTATIONS), st.sampled_from(MODES))
@settings(max_examples=150)
def test_any_rotation_comes_back_in_every_form_and_mode(vectors, rotation, mode):
    R = rotvec_to_matrix(np.array(vectors))
    chunk = dataclasses.replace(
        wandering_chunk(ANCHOR, steps=len(R)),
        T_world_lhand=make_transform(R, np.zeros(3)),
        T_world_rhand=make_transform(R, np.ones(3)),
    )
    spec = pose_spec(rotation, mode)
    again = decode(spec, encode(spec, chunk, ANCHOR), ANCHOR)
    assert angle_between(again.T_world_lhand[:, :3, :3], R).max() < 1e-6
    assert_same_targets(again, chunk, 1e-6)


@pytest.mark.parametrize("name", [name for name in LAYOUTS if name != "joint23"])
def test_every_layout_comes_back(name):
    spec = builtin(name)
    chunk = wandering_chunk(ANCHOR)
    closing = np.linspace(0.1, 0.9, len(chunk))
    if spec.slot("left_grasp") or (spec.slot("left_hand") and spec.slot("left_hand").kind == "fingers"):
        chunk = dataclasses.replace(
            chunk, q_lhand=grasp_posture("left", closing), q_rhand=grasp_posture("right", 1.0 - closing)
        )
    if not (spec.slot("left_grasp") or spec.slot("left_hand")):
        still = {"q_lhand": ANCHOR.q_lhand, "q_rhand": ANCHOR.q_rhand}
        chunk = dataclasses.replace(chunk, **{hand: np.tile(q, (len(chunk), 1)) for hand, q in still.items()})
    mask = full_mask(spec)
    actions = encode(spec, chunk, ANCHOR)
    assert actions.shape == (len(chunk), spec.dim)
    once = decode(spec, actions, ANCHOR, mask=mask)
    # Joint layouts go through inverse kinematics, which stops at a micrometre.
    assert_same_targets(once, chunk, 1e-5)
    again = decode(spec, encode(spec, once, ANCHOR), ANCHOR, mask=mask)
    assert_same_targets(again, once)
    assert np.abs(encode(spec, again, ANCHOR) - encode(spec, once, ANCHOR)).max() < 1e-9


@pytest.mark.parametrize(
    ("name", "T_world_frame"), [("wbc32", ANCHOR.T_world_stance), ("wbc32-v1", ANCHOR.T_world_base)]
)
def test_wbc32_is_its_frame_times_the_numbers(name, T_world_frame):
    R = rotvec_to_matrix(np.array([0.3, -0.2, 0.9]))
    row = np.concatenate([[0.3, 0.2, 0.1], R[:, 0], R[:, 1], [0.3, -0.2, 0.1], R[:, 0], R[:, 1], np.arange(14) / 20.0])
    chunk = decode(builtin(name), row[None], ANCHOR)
    assert np.allclose(chunk.T_world_lhand[0], T_world_frame @ make_transform(R, np.array([0.3, 0.2, 0.1])))
    assert np.allclose(chunk.q_rhand[0], np.arange(7, 14) / 20.0)


def test_an_absolute_pose_layout_needs_no_kinematics(monkeypatch):
    monkeypatch.setattr("policy.action_spec.anchor.kinematics", lambda: pytest.fail("kinematics were used"))
    actions = np.tile([0.3, 0.2, 0.1, 1, 0, 0, 0, 1, 0], 2)
    fresh = dataclasses.replace(ANCHOR)
    decode(builtin("wbc32-v1"), np.concatenate([actions, np.zeros(14)])[None], fresh)


def test_gr00t_is_the_reference_times_the_relative_pose():
    spec = builtin("gr00t_g1")
    actions = np.zeros((2, spec.dim))
    R = rotvec_to_matrix(np.array([0.0, 0.4, 0.2]))
    for at in (0, 9):
        actions[:, at : at + 3] = [0.1, 0.0, 0.05]
        actions[:, at + 3 : at + 9] = matrix_to_rot6d(R, "rows")
    chunk = decode(spec, actions, ANCHOR)
    T_rel = make_transform(R, np.array([0.1, 0.0, 0.05]))
    assert np.allclose(chunk.T_world_rhand[1], ANCHOR.T_world_base @ ANCHOR.poses["rhand"] @ T_rel)
    assert np.allclose(chunk.q_rhand, ANCHOR.q_rhand)
    assert np.allclose(chunk.q_larm, ANCHOR.q_body[15:22])


def test_delta_adds_up_along_the_axes_of_the_frame():
    spec = pose_spec(ROTATIONS[4], "delta")
    actions = np.zeros((3, spec.dim))
    actions[:, 0:3] = [0.01, 0.0, 0.0]
    actions[:, 3:6] = [0.0, 0.0, 0.1]
    T = inverse(ANCHOR.T_world_base) @ decode(spec, actions, ANCHOR).T_world_lhand
    reference = ANCHOR.poses["lhand"]
    assert np.allclose(T[:, :3, 3], reference[:3, 3] + np.outer([1, 2, 3], [0.01, 0.0, 0.0]))
    assert np.allclose(T[2, :3, :3], rotvec_to_matrix(np.array([0.0, 0.0, 0.3])) @ reference[:3, :3])


def test_frames_are_what_their_names_say():
    expected = {
        "world": np.eye(4),
        "pelvis": ANCHOR.T_world_base,
        "pelvis_yaw": yaw_frame(ANCHOR.T_world_base),
        "torso": ANCHOR.T_world_base @ ANCHOR.poses["torso"],
        "stance": ANCHOR.T_world_stance,
    }
    for frame, T_world_frame in expected.items():
        spec = pose_spec(ROTATIONS[4], "absolute", frame)
        chunk = decode(spec, np.zeros((1, spec.dim)), ANCHOR)
        assert np.allclose(chunk.T_world_lhand[0], T_world_frame), frame


def test_a_tool_offset_is_taken_off():
    spec = pose_spec(ROTATIONS[4], "absolute", "world", tcp_offset=(0.05, 0.0, 0.0))
    actions = np.zeros((1, spec.dim))
    actions[0, 3:6] = [0.0, 0.0, np.pi / 2]
    assert np.allclose(decode(spec, actions, ANCHOR).T_world_lhand[0, :3, 3], [0.0, -0.05, 0.0])


def test_a_position_alone_keeps_the_orientation():
    parts = [
        {"name": f"{side}_wrist_position", "kind": "position", "size": 3, "unit": "cm"} for side in ("left", "right")
    ]
    spec = ActionSpec(name="x", slots=stack(*parts))
    chunk = decode(spec, np.full((2, 6), 30.0), ANCHOR)
    assert np.allclose(chunk.T_world_rhand[1, :3, :3], (ANCHOR.T_world_base @ ANCHOR.poses["rhand"])[:3, :3])
    assert np.allclose((inverse(ANCHOR.T_world_base) @ chunk.T_world_rhand)[1, :3, 3], 0.3)
    assert np.allclose(chunk.q_lhand, ANCHOR.q_lhand)
    assert_same_targets(decode(spec, encode(spec, chunk, ANCHOR), ANCHOR), chunk)


def test_joint_layouts_decode_by_forward_kinematics_with_the_measured_waist():
    rng = np.random.default_rng(5)
    arms = rng.uniform(-0.4, 0.4, (3, 14))
    actions = np.concatenate([arms, np.zeros((3, 14))], axis=1)
    chunk = decode(builtin("joint28"), actions, ANCHOR)
    q = ANCHOR.q_body.copy()
    q[G1.limbs["right_arm"]] = arms[2, 7:]
    assert np.allclose(chunk.T_world_rhand[2], ANCHOR.T_world_base @ kinematics().poses(q)["rhand"])
    q[G1.limbs["waist"]] = 0.0
    assert not np.allclose(chunk.T_world_rhand[2], ANCHOR.T_world_base @ kinematics().poses(q)["rhand"])


def test_a_waist_in_the_layout_moves_the_arms_with_it():
    parts = [
        joints(G1, "waist", order=("waist_pitch_joint", "waist_roll_joint", "waist_yaw_joint")),
        joints(G1, "left_arm"),
        joints(G1, "right_arm"),
    ]
    spec = ActionSpec(name="x", slots=stack(*parts))
    actions = np.zeros((1, 17))
    actions[0, :3] = [0.3, 0.2, 0.1]
    chunk = decode(spec, actions, ANCHOR)
    q = np.concatenate([np.zeros(12), [0.1, 0.2, 0.3], np.zeros(14)])
    assert np.allclose(chunk.T_world_lhand[0], ANCHOR.T_world_base @ kinematics().poses(q)["lhand"])
    assert np.allclose(encode(spec, chunk, ANCHOR), actions)


def test_fingers_are_mapped_by_name():
    spec = pose_spec(ROTATIONS[4], "absolute")
    actions = np.zeros((1, spec.dim))
    column = spec.feature_names.index("right_hand_middle_1.pos")
    actions[0, column] = 0.7
    q = decode(spec, actions, ANCHOR).q_rhand[0]
    assert q[RIGHT_HAND_JOINTS.index("right_hand_middle_1_joint")] == 0.7
    assert np.count_nonzero(q) == 1


def test_grippers_become_closings():
    spec = builtin("unifolm23")
    chunk = wandering_chunk(ANCHOR, steps=2)
    actions = encode(spec, chunk, ANCHOR)
    actions[:, 18], actions[:, 19] = 5.4, 0.0
    hands = decode(spec, actions, ANCHOR)
    assert np.allclose(hands.q_rhand, grasp_posture("right", 0.0))
    assert np.allclose(hands.q_lhand, grasp_posture("left", 1.0))


@given(st.floats(0.0, 1.0), st.sampled_from(["left", "right"]))
def test_a_closing_comes_back(closing, side):
    assert abs(closing_of(side, grasp_posture(side, closing)) - closing) < 1e-12


def test_base_slots_reach_the_chunk():
    spec = builtin("wbc27")
    actions = encode(spec, wandering_chunk(ANCHOR, steps=2), ANCHOR)
    actions[:, 20:23] = [0.1, 0.2, 0.3]
    actions[:, 23] = 0.7
    actions[:, 24:] = [0.01, 0.02, 0.03]
    chunk = decode(spec, actions, ANCHOR)
    # The layout has roll, pitch, yaw; motor order is yaw, roll, pitch.
    assert np.allclose(chunk.q_waist, [0.3, 0.1, 0.2])
    assert np.allclose(chunk.base_height, 0.7)
    assert np.allclose(chunk.base_velocity, [0.01, 0.02, 0.03])


@pytest.mark.parametrize("mode", ["relative_add", "delta"])
def test_height_and_grasp_can_be_relative(mode):
    base = builtin("wbc27")
    slots = [dataclasses.replace(s, mode=mode, limits=None) if s.kind == "scalar" else s for s in base.slots]
    spec = dataclasses.replace(base, slots=tuple(slots))
    chunk = dataclasses.replace(
        wandering_chunk(ANCHOR),
        base_height=np.linspace(0.7, 0.75, 6),
        q_lhand=grasp_posture("left", np.linspace(0.2, 0.8, 6)),
        q_rhand=grasp_posture("right", 0.5 * np.ones(6)),
    )
    again = decode(spec, encode(spec, chunk, ANCHOR), ANCHOR)
    assert np.allclose(again.base_height, chunk.base_height)
    assert np.allclose(again.q_lhand, chunk.q_lhand)


def test_limits_clip_and_say_so():
    base = builtin("wbc32")
    slots = [dataclasses.replace(s, limits=((-0.4, 0.4),) * 7) if s.name == "left_hand" else s for s in base.slots]
    spec = dataclasses.replace(base, slots=tuple(slots))
    actions = encode(base, wandering_chunk(ANCHOR), ANCHOR)
    actions[:, 18:25] = 0.1
    actions[2, 18] = 0.9
    chunk = decode(spec, actions, ANCHOR)
    assert chunk.q_lhand[2, 0] == 0.4
    assert chunk.notes[0] == "left_hand: 1 numbers clipped to their limits, by up to 0.5 rad"


def test_rows_read_as_columns_is_a_large_error_without_an_exception():
    actions = encode(builtin("wbc32"), wandering_chunk(ANCHOR, turn=1.5, steps=50), ANCHOR)
    base = builtin("wbc32")
    slots = [dataclasses.replace(s, rot6d_layout="rows") if s.kind == "rot6d" else s for s in base.slots]
    misread = decode(dataclasses.replace(base, slots=tuple(slots)), actions, ANCHOR)
    right = decode(base, actions, ANCHOR)
    error = np.rad2deg(angle_between(right.T_world_lhand[:, :3, :3], misread.T_world_lhand[:, :3, :3]))
    assert error.mean() > 60.0


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_number_that_is_not_finite_is_named(value):
    actions = encode(builtin("wbc32"), wandering_chunk(ANCHOR), ANCHOR)
    actions[3, 27] = value
    with pytest.raises(ChunkError, match=r"action 27 \(right_hand_thumb_2.pos\) is .* at step 3") as refusal:
        decode(builtin("wbc32"), actions, ANCHOR)
    assert (refusal.value.step, refusal.value.slot) == (3, "right_hand")


@pytest.mark.parametrize("shape", [(5, 31), (32,), (0, 32), (1, 5, 32)])
def test_a_wrong_shape_is_refused(shape):
    with pytest.raises(ChunkError, match=r"has \(steps, 32\)"):
        decode(builtin("wbc32"), np.zeros(shape), ANCHOR)


def test_things_that_are_no_numbers_are_refused():
    with pytest.raises(ChunkError, match="numbers are expected"):
        decode(builtin("wbc32"), np.full((1, 32), "a"), ANCHOR)


def test_numbers_that_are_no_rotation_are_named():
    actions = encode(builtin("wbc32"), wandering_chunk(ANCHOR), ANCHOR)
    actions[4, 12:18] = 0.0
    with pytest.raises(ChunkError, match="right_wrist_rotation at step 4") as refusal:
        decode(builtin("wbc32"), actions, ANCHOR)
    assert refusal.value.step == 4


def test_a_joint_layout_refuses_what_the_arms_cannot_reach():
    chunk = wandering_chunk(ANCHOR)
    far = chunk.T_world_lhand.copy()
    far[3, :3, 3] += 2.0
    with pytest.raises(ChunkError, match="left arm cannot reach its pose at step 3") as refusal:
        encode(builtin("joint28"), dataclasses.replace(chunk, T_world_lhand=far), ANCHOR)
    assert refusal.value.slot == "left_arm"


def test_arm_joints_that_do_not_match_the_pose_are_not_used():
    spec = builtin("joint28")
    chunk = wandering_chunk(ANCHOR)
    actions = encode(spec, dataclasses.replace(chunk, q_larm=np.zeros((6, 7)), q_rarm=np.zeros((6, 7))), ANCHOR)
    assert_same_targets(decode(spec, actions, ANCHOR), chunk, HINT_TOLERANCE)


def test_the_measured_anchor_follows_the_pelvis_and_the_nominal_one_does_not():
    leaning = Anchor.measured(observation(lean=0.3))
    assert not np.allclose(leaning.T_world_base, Anchor.nominal().T_world_base)
    assert np.allclose(leaning.T_world_base, observation(lean=0.3).T_world_base)


def test_the_nominal_anchor_goes_with_the_feet_but_stays_upright():
    feet = make_transform(
        rotvec_to_matrix(np.array([0.1, 0.0, 0.0])) @ rotvec_to_matrix([0, 0, 0.7]), np.array([1, 2, 0.0])
    )
    moved = Anchor.nominal(feet).T_world_base
    upright = yaw_frame(feet)
    assert np.allclose(moved, upright @ Anchor.nominal().T_world_base)
    assert np.allclose(moved[2, :3], [0.0, 0.0, 1.0])


def test_rounding_in_the_measured_rotation_does_not_reach_the_chunk():
    seen = observation(lean=0.2)
    noisy = dataclasses.replace(seen, T_world_base=seen.T_world_base + 1e-7 * np.diag([1.0, -1.0, 1.0, 0.0]))
    anchor = Anchor.measured(noisy)
    decode(builtin("wbc32"), encode(builtin("wbc32"), wandering_chunk(anchor), anchor), anchor)


@pytest.mark.parametrize(("layout", "number"), [("wbc32", 5.0), ("wbc32", 1e4), ("wbc27", 1.5)])
def test_4_decoding_tells_of_fingers_out_of_range(layout, number):
    spec = builtin(layout)
    spec = dataclasses.replace(spec, slots=tuple(dataclasses.replace(slot, limits=None) for slot in spec.slots))
    actions = np.tile(state_numbers(spec, observation()), (4, 1))
    anchor, slot = Anchor.measured(observation()), spec.slot("left_hand") or spec.slot("left_grasp")
    assert decode(spec, actions, anchor).notes == ()
    actions[2, slot.start] = number
    (note,) = decode(spec, actions, anchor).notes
    assert note.startswith(f"{slot.name}: 1 numbers out of the fingers' range, by up to ")
