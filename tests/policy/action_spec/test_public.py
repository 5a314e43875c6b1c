"""Layouts of public datasets and models against numbers that other code makes.

Strategy: rows are written here column by column, from the order that the sources give, and what they must mean is
computed by `tests.support.urdf_chain` and scipy's rotations, which share no code with the codec. Then what a layout may
not do in silence: ignore numbers, drop legs, or take a mask for granted.
"""

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from models import g1
from policy import ActionSpec, Anchor, ChunkError, SpecError, builtin, decode, encode
from policy.action_spec.parts import grasp, ignored, joints, stack
from policy.action_spec.public import LAYOUTS
from tests.support.urdf_chain import link_pose, sole_middle

ANCHOR = Anchor.nominal()
BODY_JOINTS = g1().body_joints
LEFT_HAND_JOINTS, RIGHT_HAND_JOINTS = (tool.finger_joints for tool in g1().tools)
STANCE = dict(zip(BODY_JOINTS, ANCHOR.q_body, strict=True))
ARM = ("shoulder_pitch", "shoulder_roll", "shoulder_yaw", "elbow", "wrist_roll", "wrist_pitch", "wrist_yaw")
LEG = ("hip_pitch", "hip_roll", "hip_yaw", "knee", "ankle_pitch", "ankle_roll")
WAIST = ("waist_yaw_joint", "waist_roll_joint", "waist_pitch_joint")
SPEC = g1()
OPEN = {"left": np.array(SPEC.hand_open[:7]), "right": np.array(SPEC.hand_open[7:])}
CLOSED = {"left": np.array(SPEC.hand_closed[:7]), "right": np.array(SPEC.hand_closed[7:])}


def named(side, part):
    return [f"{side}_{joint}_joint" for joint in part]


def crouch(depth):
    """Joint angles by name of a robot that went down by bending hips, knees and ankles, feet flat where they were."""
    changed = dict(STANCE)
    for side in ("left", "right"):
        for joint, share in (("hip_pitch", -0.5), ("knee", 1.0), ("ankle_pitch", -0.5)):
            changed[f"{side}_{joint}_joint"] += share * depth
    rng = np.random.default_rng(4)
    for name in (*named("left", ARM), *named("right", ARM), *WAIST):
        changed[name] += rng.uniform(-0.2, 0.2)
    return changed


def expected(angles, side):
    """Where a wrist is in world, the soles where those of the stance are."""
    T_base_hand = link_pose(f"{side}_wrist_yaw_link", angles)
    return ANCHOR.T_world_base @ sole_middle(STANCE) @ np.linalg.inv(sole_middle(angles)) @ T_base_hand


def values(angles, names):
    return [angles[name] for name in names]


def openhlm(angles, grippers=(1.0, 0.0), tilt=(0.0, 0.0), yaw_rate=0.0):
    row = [*values(angles, named("left", ARM)), grippers[0], *values(angles, named("right", ARM)), grippers[1]]
    row += [*values(angles, named("left", LEG)), *values(angles, named("right", LEG)), *values(angles, WAIST)]
    return np.array([*row, *tilt, yaw_rate])


def test_openhlm_puts_the_pelvis_over_the_soles_and_a_gripper_of_one_is_open():
    angles = [crouch(depth) for depth in np.linspace(0.0, 0.5, 6)]
    chunk = decode(builtin("openhlm34"), np.stack([openhlm(one) for one in angles]), ANCHOR)
    for k, one in enumerate(angles):
        np.testing.assert_allclose(chunk.T_world_lhand[k], expected(one, "left"), atol=1e-7)
        np.testing.assert_allclose(chunk.T_world_rhand[k], expected(one, "right"), atol=1e-7)
    assert chunk.base_height[0] - chunk.base_height[-1] > 0.02
    np.testing.assert_allclose(chunk.q_lhand[0], OPEN["left"])
    np.testing.assert_allclose(chunk.q_rhand[0], CLOSED["right"])


def test_legs_that_ask_for_a_step_are_refused_by_name():
    rows = np.stack([openhlm(crouch(0.1))] * 8)
    rows[5:, 16] -= 0.3  # the left hip pitches: that foot comes forward
    with pytest.raises(ChunkError, match=r"the legs ask for a step: at step 5 one foot is 0\.2") as refused:
        decode(builtin("openhlm34"), rows, ANCHOR)
    assert (refused.value.step, refused.value.slot) == (5, "left_leg")
    hands = builtin("openhlm34").without(["left_leg", "right_leg"], "hands alone are judged")
    assert "left_leg is ignored: hands alone are judged" in decode(hands, rows, ANCHOR).notes


def test_a_yaw_rate_and_a_tilt_that_are_not_followed_are_said():
    rows = openhlm(STANCE, yaw_rate=0.4, tilt=(0.0, 0.3))[None]
    notes = decode(builtin("openhlm34"), rows, ANCHOR).notes
    assert any("base_velocity asks for up to 0.4" in note for note in notes)
    assert any("base_tilt differs by up to 0.3 rad" in note for note in notes)
    assert decode(builtin("openhlm34"), openhlm(STANCE)[None], ANCHOR).notes == ()


def wla(left, right):
    row = np.zeros(54)
    row[0:6], row[13:19] = left, right
    row[26:29] = values(STANCE, WAIST)
    mask = np.zeros(54, dtype=bool)
    mask[0:7] = mask[13:20] = mask[26:29] = True
    return row, mask


def test_wla_moves_each_hand_in_its_own_frame_where_its_mask_says_so():
    left, right = [0.05, -0.02, 0.1, 0.3, -0.2, 0.1], [0.0, 0.03, -0.05, -0.4, 0.0, 0.2]
    row, mask = wla(left, right)
    chunk = decode(builtin("unifolm_wla54"), np.stack([0.0 * row, row]), ANCHOR, mask=mask)
    for side, numbers, T in (("left", left, chunk.T_world_lhand), ("right", right, chunk.T_world_rhand)):
        T_rel = np.eye(4)
        T_rel[:3, :3], T_rel[:3, 3] = Rotation.from_rotvec(numbers[3:]).as_matrix(), numbers[:3]
        now = ANCHOR.T_world_base @ link_pose(f"{side}_wrist_yaw_link", STANCE)
        np.testing.assert_allclose(T[0], now, atol=1e-7)
        np.testing.assert_allclose(T[1], now @ T_rel, atol=1e-7)
    assert chunk.q_legs is None
    assert chunk.spec_id == builtin("unifolm_wla54").id


@pytest.mark.parametrize(
    ("mask", "said"),
    [
        (None, "says with a mask of 54"),
        (np.arange(54) < 3, "does not say where the right hand goes"),
        (np.arange(54) < 5, "the mask has 2 of the 3 numbers of left_wrist_rotation"),
        (np.ones(53, dtype=bool), r"shape \(53,\); true or false"),
        (np.full(54, 0.5), "true or false"),
        (np.zeros(54, dtype=bool), "does not say where"),
        (np.array([True, False, True]), "in the midst of the chunk"),
    ],
)
def test_a_mask_that_is_none_is_refused(mask, said):
    rows = np.zeros((3, 54))
    with pytest.raises(ChunkError, match=said):
        decode(builtin("unifolm_wla54"), rows, ANCHOR, mask=mask)


def test_a_mask_of_steps_ends_the_chunk_and_one_that_varies_is_refused():
    row, columns = wla(np.zeros(6), np.zeros(6))
    rows, steps = np.tile(row, (5, 1)), np.arange(5) < 3
    both = steps[:, None] & columns
    assert len(decode(builtin("unifolm_wla54"), rows, ANCHOR, mask=both)) == 3
    both[0, 26:29] = False
    with pytest.raises(ChunkError, match="other numbers in one step than in another"):
        decode(builtin("unifolm_wla54"), rows, ANCHOR, mask=both)


def test_increments_in_the_hand_are_products_of_poses():
    rng = np.random.default_rng(2)
    part = {"frame": "torso", "mode": "delta_se3"}
    rotation = {"kind": "rotvec", "size": 3, "unit": "rad"}
    position = {"kind": "position", "size": 3, "unit": "m"}
    pairs = (({"name": f"{s}_wrist_position", **position, **part}, {"name": f"{s}_wrist_rotation", **rotation, **part})
             for s in ("left", "right"))  # fmt: skip
    spec = ActionSpec(name="increments", slots=stack(*(one for pair in pairs for one in pair)))
    rows = rng.uniform(-0.05, 0.05, (7, 12))
    chunk = decode(spec, rows, ANCHOR)
    T = ANCHOR.T_world_base @ link_pose("right_wrist_yaw_link", STANCE)
    for k, row in enumerate(rows):
        step = np.eye(4)
        step[:3, :3], step[:3, 3] = Rotation.from_rotvec(row[9:]).as_matrix(), row[6:9]
        T = T @ step
        np.testing.assert_allclose(chunk.T_world_rhand[k], T, atol=1e-7)


def test_eef14_has_w_first():
    R = Rotation.from_euler("xyz", [0.3, -0.4, 0.8])
    x, y, z, w = R.as_quat()
    row = np.array([0.3, 0.2, 0.1, w, x, y, z, 0.3, -0.2, 0.1, 1.0, 0.0, 0.0, 0.0])
    chunk = decode(builtin("decoupled_wbc_eef14"), row[None], ANCHOR)
    T_base = np.linalg.inv(ANCHOR.T_world_base) @ chunk.T_world_lhand[0]
    np.testing.assert_allclose(T_base[:3, :3], R.as_matrix(), atol=1e-7)
    np.testing.assert_allclose(T_base[:3, 3], row[:3], atol=1e-7)


def test_decoupled_wbc43_has_each_hand_behind_its_arm_in_pinocchios_order():
    angles, rng = crouch(0.2), np.random.default_rng(5)
    fingers = {name: rng.uniform(0.0, 0.1) for name in (*LEFT_HAND_JOINTS, *RIGHT_HAND_JOINTS)}
    palm = ("hand_index_0", "hand_index_1", "hand_middle_0", "hand_middle_1", "hand_thumb_0", "hand_thumb_1",
            "hand_thumb_2")  # fmt: skip
    order = [*named("left", LEG), *named("right", LEG), *WAIST, *named("left", ARM), *named("left", palm)]
    order += [*named("right", ARM), *named("right", palm)]
    chunk = decode(builtin("decoupled_wbc43"), np.array([values(angles | fingers, order)]), ANCHOR)
    np.testing.assert_allclose(chunk.T_world_rhand[0], expected(angles, "right"), atol=1e-7)
    np.testing.assert_allclose(chunk.q_rhand[0], values(fingers, RIGHT_HAND_JOINTS))
    np.testing.assert_allclose(chunk.q_lhand[0], values(fingers, LEFT_HAND_JOINTS))


def test_a_robot_of_23_joints_has_its_missing_wrists_at_zero():
    angles = crouch(0.1) | {"waist_roll_joint": 0.0, "waist_pitch_joint": 0.0}
    for side in ("left", "right"):
        angles |= {f"{side}_wrist_pitch_joint": 0.0, f"{side}_wrist_yaw_joint": 0.0}
    order = [*named("left", LEG), *named("right", LEG), "waist_yaw_joint", *named("left", ARM[:5])]
    order += named("right", ARM[:5])
    chunk = decode(builtin("joint23"), np.array([values(angles, order)]), ANCHOR)
    np.testing.assert_allclose(chunk.T_world_lhand[0], expected(angles, "left"), atol=1e-7)
    everything = decode(builtin("joint29"), np.array([values(angles, BODY_JOINTS)]), ANCHOR)
    np.testing.assert_allclose(everything.T_world_lhand, chunk.T_world_lhand, atol=1e-12)
    with pytest.raises(ChunkError, match="its wrist lacks pitch and yaw"):
        encode(builtin("joint23"), decode(builtin("joint29"), np.array([ANCHOR.q_body]), ANCHOR), ANCHOR)


@pytest.mark.parametrize("layout", ["joint23", "joint29", "decoupled_wbc43", "openhlm34"])
def test_numbers_of_joints_come_back(layout):
    spec, rng = builtin(layout), np.random.default_rng(5)
    stance = dict(zip(BODY_JOINTS, ANCHOR.q_body, strict=True))
    numbers = np.full((6, spec.dim), 0.3)
    for slot in spec.slots:
        names = slot.joint_names or [slot.name] * slot.size
        moved = 0.2 * rng.uniform(-1.0, 1.0, (6, slot.size)) * slot.name.endswith("_arm")
        rest = [stance.get(name, 0.5 if slot.name.endswith("_grasp") else 0.0) for name in names]
        numbers[:, slot.indices] = np.array(rest) + moved
    again = encode(spec, decode(spec, numbers, ANCHOR), ANCHOR)
    np.testing.assert_allclose(again, numbers, atol=1e-9)


@pytest.mark.parametrize(
    ("name", "left", "right", "is_open"),
    [("inspire26", 14, 20, 1.0), ("inspire26_by_side", 7, 20, 1.0), ("brainco26", 14, 20, 0.0)],
)
def test_fingers_of_other_hands_close_the_finger_in_their_place(name, left, right, is_open):
    spec, arms = builtin(name), {"left": slice(0, 7), "right": slice(13, 20) if "side" in name else slice(7, 14)}
    row = np.full(26, is_open)
    for side, columns in arms.items():
        row[columns] = values(STANCE, named(side, ARM))
    opened = decode(spec, row[None], ANCHOR)
    np.testing.assert_allclose(opened.q_lhand[0], OPEN["left"])
    np.testing.assert_allclose(opened.T_world_rhand[0], ANCHOR.T_world_base @ ANCHOR.poses["rhand"], atol=1e-7)
    fingers = spec.slot("left_hand").joint_names
    index = row.copy()
    index[left + fingers.index("index")] = 1.0 - is_open
    changed = np.flatnonzero(decode(spec, index[None], ANCHOR).q_lhand[0] - OPEN["left"])
    assert [LEFT_HAND_JOINTS[i] for i in changed] == ["left_hand_index_0_joint", "left_hand_index_1_joint"]
    pinky = row.copy()
    pinky[right + fingers.index("pinky")] = 1.0 - is_open
    middle = [i for i, joint in enumerate(RIGHT_HAND_JOINTS) if "_middle_" in joint]
    third = OPEN["right"] + (CLOSED["right"] - OPEN["right"]) / 3.0
    np.testing.assert_allclose(decode(spec, pinky[None], ANCHOR).q_rhand[0][middle], third[middle])


@pytest.mark.parametrize("ends", [(1.0, 0.0), (-1.0, 1.0), (100.0, 0.0), (5.4, 0.0)])
def test_a_closing_number_is_what_it_is_open_and_closed(ends):
    arms = joints(g1(), "left_arm"), joints(g1(), "right_arm")
    spec = ActionSpec(name="mine", slots=stack(*arms, grasp("left", *ends), grasp("right", *ends)))
    row = np.array([*values(STANCE, named("left", ARM)), *values(STANCE, named("right", ARM)), *ends])
    chunk = decode(spec, row[None], ANCHOR)
    np.testing.assert_allclose(chunk.q_lhand[0], OPEN["left"])
    np.testing.assert_allclose(chunk.q_rhand[0], CLOSED["right"])
    assert chunk.notes == ()
    assert ActionSpec.from_json(spec.to_json()) == spec


def test_what_is_ignored_is_said_with_its_reason_and_written_as_zero():
    arms = joints(g1(), "left_arm"), joints(g1(), "right_arm")
    spec = ActionSpec(name="mine", slots=stack(arms[0], ignored("torque", 3, "no motor has it"), arms[1]))
    row = np.array([*values(STANCE, named("left", ARM)), 7.0, 8.0, 9.0, *values(STANCE, named("right", ARM))])
    chunk = decode(spec, row[None], ANCHOR)
    assert chunk.notes == ("torque is ignored: no motor has it",)
    assert (encode(spec, chunk, ANCHOR)[0, 7:10] == 0.0).all()
    assert ActionSpec.from_json(spec.to_json()).hash == spec.hash
    for wrong in ({"reason": " "}, {"name": "left_leg"}, {"unit": "m"}, {"size": 0}):
        with pytest.raises(SpecError):
            dataclasses.replace(spec.slots[1], **wrong)


@pytest.mark.parametrize("layout", LAYOUTS, ids=lambda layout: layout.__name__)
def test_each_has_its_source(layout):
    assert "Source:" in layout.__doc__
