"""Action specs: the contract about what numbers mean.

Strategy: the built-in layouts are pinned by hash and by reading single numbers; every field of a slot changes the
hash; JSON comes back; each malformed spec is refused with a sentence that says what would work.
"""

import dataclasses
import json

import pytest

from models import g1
from policy import LAYOUTS, ActionSpec, Slot, SpecError, builtin, require_same
from policy.action_spec.builtin import joints, scalar, stack, wrist
from policy.action_spec.slot import OF_TOUCH, TARGETS
from policy.action_spec.spec import differences
from policy.joints import joints_of, permutation

# A released layout never changes: whoever has to change these numbers has to make a new version.
PINNED = {
    "wbc32": (32, "ed4f53491c16"),
    "wbc32-v1": (32, "9425ce13fd02"),
    "wbc32_forces": (38, "6923b5f37734"),
    "wbc27": (27, "84dcda68c48a"),
    "unifolm23": (23, "51f33e72dede"),
    "joint28": (28, "1ba219932771"),
    "joint16": (16, "af775e7fda01"),
    "gr00t_g1": (53, "24257b52ea30"),
    "openhlm34": (34, "205c7fb86eca"),
    "unifolm_wla54": (54, "d033537d72f6"),
    "decoupled_wbc43": (43, "765109a8f403"),
    "decoupled_wbc_eef14": (14, "082fcbc177c8"),
    "inspire26": (26, "05c855ec47fe"),
    "inspire26_by_side": (26, "d3c3cd4d37e6"),
    "brainco26": (26, "26d0e668ec15"),
    "joint14": (14, "89ac7a005257"),
    "joint29": (29, "7a103ba1e65e"),
    "joint23": (23, "dd86896a8d30"),
}

LEFT, RIGHT = wrist("left"), wrist("right")
LEFT_HAND_JOINTS, RIGHT_HAND_JOINTS = (joints_of(g1(), f"{side}_hand") for side in ("left", "right"))


def changed(spec, name, **changes):
    slots = tuple(dataclasses.replace(s, **changes) if s.name == name else s for s in spec.slots)
    return dataclasses.replace(spec, slots=slots)


@pytest.mark.parametrize("name", LAYOUTS)
def test_built_in_layouts_are_pinned(name):
    spec = builtin(name)
    assert (spec.dim, spec.hash[:12]) == PINNED[name]
    assert spec.id == f"{spec.name}-v{spec.version}-{spec.hash[:12]}"
    assert name in (spec.name, f"{spec.name}-v{spec.version}")


def test_a_layout_is_found_by_name_by_version_and_by_its_whole_id():
    first, last = builtin("wbc32-v1"), builtin("wbc32")
    assert (first.name, first.version, last.version) == ("wbc32", 1, 2)
    assert builtin(first.id) == first
    assert builtin("wbc32-v2") == builtin(last.id) == last
    assert first.hash == "9425ce13fd0246dbd3e6b0df97f92ec2a3dfb8f3b4a5e46a51b4fe12f53186d5"
    with pytest.raises(SpecError, match="did you mean 'wbc32-v1'"):
        builtin("wbc32-v3")
    with pytest.raises(SpecError, match="version is 1, expected 2; slot 'left_wrist_position' has frame pelvis"):
        require_same(last, first)


@pytest.mark.parametrize("name", LAYOUTS)
def test_json_gives_the_same_spec_back(name):
    spec = builtin(name)
    again = ActionSpec.from_json(spec.to_json())
    assert again == spec
    assert again.hash == spec.hash


@pytest.mark.parametrize("name", LAYOUTS)
def test_feature_names_are_one_each_and_end_as_lerobot_wants(name):
    names = builtin(name).feature_names
    assert len(names) == len(set(names)) == builtin(name).dim
    assert all(feature.endswith((".pos", ".vel")) for feature in names)


def test_wbc32_says_what_the_design_says():
    spec = builtin("wbc32")
    assert (spec.fps, spec.horizon) == (30.0, 50)
    assert spec.feature_names[0] == "left_wrist_x.pos"
    assert spec.feature_names[9] == "right_wrist_x.pos"
    assert spec.feature_names[18] == "left_hand_thumb_0.pos"
    assert spec.feature_names[21] == "left_hand_middle_0.pos"
    assert spec.feature_names[28] == "right_hand_index_0.pos"
    assert {s.frame for s in spec.slots if "wrist" in s.name} == {"stance"}
    assert {s.frame for s in builtin("wbc32-v1").slots} == {"pelvis"}
    assert {s.mode for s in spec.slots} == {"absolute"}
    assert spec.slot("left_wrist_rotation").rot6d_layout == "cols"


def test_unifolm_has_the_right_gripper_first_and_waist_yaw_roll_pitch():
    names = builtin("unifolm23").feature_names
    assert names[18:] == ("right_grasp.pos", "left_grasp.pos", "waist_yaw.pos", "waist_roll.pos", "waist_pitch.pos")


def test_gr00t_is_relative_and_by_rows():
    spec = builtin("gr00t_g1")
    assert spec.slot("left_wrist_rotation").rot6d_layout == "rows"
    assert {
        spec.slot(f"{side}_wrist_{what}").mode for side in ("left", "right") for what in ("position", "rotation")
    } == {"relative_se3"}


def test_joint_names_are_those_of_the_robot_in_motor_order():
    assert (*g1().body_joints, *LEFT_HAND_JOINTS, *RIGHT_HAND_JOINTS) == g1().joint_names
    assert tuple(name.replace("left", "right") for name in LEFT_HAND_JOINTS) != RIGHT_HAND_JOINTS


def test_permutation_goes_by_name():
    urdf_order = [name.replace("left", "right") for name in LEFT_HAND_JOINTS]
    indices = permutation(urdf_order, RIGHT_HAND_JOINTS)
    assert [urdf_order[i] for i in indices] == list(RIGHT_HAND_JOINTS)
    with pytest.raises(SpecError, match="missing"):
        permutation(urdf_order[:3], RIGHT_HAND_JOINTS)
    with pytest.raises(SpecError, match="twice"):
        permutation(["a", "a"], ["a"])


@pytest.mark.parametrize(
    ("slot", "change"),
    [
        ("left_wrist_rotation", {"rot6d_layout": "rows"}),
        ("left_wrist_position", {"tcp_offset": (0.05, 0.0, 0.0)}),
        ("left_wrist_position", {"unit": "mm"}),
        ("left_wrist_position", {"mode": "delta"}),
        ("right_hand", {"joint_names": tuple(sorted(RIGHT_HAND_JOINTS))}),
        ("right_hand", {"limits": ((-1.0, 1.0),) * 7}),
        ("left_wrist_rotation", {"orientation": "free"}),
    ],
)
def test_every_convention_changes_the_hash_but_not_the_dimension(slot, change):
    mine, theirs = builtin("wbc32"), changed(builtin("wbc32"), slot, **change)
    assert mine.dim == theirs.dim
    with pytest.raises(SpecError, match=f"slot '{slot}' has {next(iter(change))}"):
        require_same(mine, theirs)
    with pytest.raises(SpecError, match="layouts differ"):
        require_same(mine, theirs.hash)


def test_3_a_free_orientation_is_in_the_json_and_the_hash_and_a_given_one_leaves_both_as_they_were():
    spec, free = builtin("wbc32"), builtin("wbc32").with_free_orientation()
    assert (spec.orientation_free, free.orientation_free) == ((False, False), (True, True))
    assert "orientation" not in spec.to_json().replace("_orientation", "")
    assert ActionSpec.from_json(free.to_json()) == free
    assert free.hash != spec.hash
    old = spec.to_dict() | {"hash": spec.hash}
    assert ActionSpec.from_dict(old) == spec
    one = changed(spec, "left_wrist_rotation", orientation="free")
    assert one.orientation_free == (True, False)
    with pytest.raises(SpecError, match="orientation only goes with a rotation"):
        changed(spec, "left_wrist_position", orientation="free")
    assert builtin("joint28").orientation_free == (False, False), "arm joints say how the hands are turned"


def test_fps_horizon_and_version_are_part_of_the_contract_and_the_name_is_not():
    spec = builtin("wbc32")
    for change in ({"fps": 50.0}, {"horizon": 10}, {"version": 3}):
        assert dataclasses.replace(spec, **change).hash != spec.hash
    require_same(spec, dataclasses.replace(spec, name="mine"))


def test_a_missing_spec_is_refused():
    spec = builtin("wbc32")
    with pytest.raises(SpecError, match="--assume-spec wbc32"):
        require_same(spec, None)
    require_same(spec, spec.hash)


def test_differences_name_missing_and_unexpected_slots():
    said = " ".join(differences(builtin("wbc32"), builtin("wbc27")))
    assert "slot 'left_hand' is missing" in said
    assert "slot 'left_grasp' is not expected" in said
    assert "dim is 27, expected 32" in said


def slot(**changes):
    data = {"name": "left_wrist_position", "kind": "position", "start": 0, "size": 3, "unit": "m"}
    return Slot(**(data | changes))


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"name": "left_wrist_positon"}, "did you mean 'left_wrist_position'"),
        ({"kind": "rot6d"}, "possible: position"),
        ({"unit": "inch"}, "possible: m, cm, mm"),
        ({"frame": "base"}, "possible: pelvis"),
        ({"mode": "relative"}, "did you mean 'relative_"),
        ({"size": 4}, "has 3 numbers"),
        ({"start": -1}, "negative"),
        ({"rot6d_layout": "rows"}, "only goes with the kind 'rot6d'"),
        ({"quaternion_order": "xyzw"}, "only goes with the kind 'quaternion'"),
        ({"joint_names": ("a",)}, "only go with the kind 'joint'"),
        ({"tcp_offset": (0.0, float("nan"), 0.0)}, "three finite metres"),
        ({"limits": ((1.0, 0.0),) * 3}, "pairs"),
        ({"limits": ((0.0, 1.0),)}, "3 pairs"),
    ],
)
def test_a_malformed_slot_is_refused(changes, complaint):
    with pytest.raises(SpecError, match=complaint):
        slot(**changes)


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"kind": "rot6d", "size": 6}, "rot6d_layout None is unknown"),
        ({"kind": "quaternion", "size": 4}, "quaternion_order None is unknown"),
        ({"kind": "rotvec", "size": 3, "unit": "rad", "limits": ((-1.0, 1.0),) * 3}, "would bend it"),
        ({"kind": "rpy", "size": 3, "unit": "rad", "tcp_offset": (0.05, 0.0, 0.0)}, "only goes with a position"),
    ],
)
def test_a_malformed_rotation_slot_is_refused(changes, complaint):
    with pytest.raises(SpecError, match=complaint):
        slot(name="left_wrist_rotation", unit=changes.pop("unit", "1"), **changes)


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"joint_names": LEFT_HAND_JOINTS[:6]}, "has 6 numbers"),
        ({"joint_names": LEFT_HAND_JOINTS[:6], "size": 6}, "each of"),
        ({"joint_names": (*LEFT_HAND_JOINTS[:6], LEFT_HAND_JOINTS[0])}, "once"),
        ({"joint_names": RIGHT_HAND_JOINTS}, "each of"),
        ({"mode": "relative_se3"}, "use relative_add"),
    ],
)
def test_a_malformed_joint_slot_is_refused(changes, complaint):
    with pytest.raises(SpecError, match=complaint):
        ActionSpec(name="x", slots=stack(*LEFT, *RIGHT, {**joints(g1(), "left_hand"), **changes}))


def test_a_velocity_is_absolute_and_a_height_has_a_length():
    with pytest.raises(SpecError, match="a velocity is absolute"):
        slot(name="base_velocity", kind="velocity", unit="m/s, rad/s", mode="delta")
    with pytest.raises(SpecError, match="possible: m, cm, mm"):
        slot(name="base_height", kind="scalar", size=1, unit="percent")


@pytest.mark.parametrize(
    ("parts", "complaint"),
    [
        ((*LEFT,), "does not say where the right hand goes"),
        ((*LEFT, *RIGHT, RIGHT[0]), "occur twice"),
        ((*LEFT, RIGHT[1], joints(g1(), "right_arm")), "a rotation but no position"),
        ((*LEFT, *RIGHT, scalar("left_grasp", "1"), joints(g1(), "left_hand")), "both 'left_hand' and"),
        ((*LEFT, RIGHT[0], {**RIGHT[1], "frame": "world"}), "both must be in one"),
    ],
)
def test_a_spec_that_does_not_add_up_is_refused(parts, complaint):
    with pytest.raises(SpecError, match=complaint):
        ActionSpec(name="x", slots=stack(*parts))


def test_gaps_and_overlaps_are_refused():
    slots = builtin("wbc32").slots
    with pytest.raises(SpecError, match="starts at 3; 0 is next"):
        ActionSpec(name="x", slots=slots[1:])


@pytest.mark.parametrize("change", [{"fps": 0.0}, {"fps": float("nan")}, {"horizon": 0}, {"version": 0}])
def test_impossible_rates_and_horizons_are_refused(change):
    with pytest.raises(SpecError):
        dataclasses.replace(builtin("wbc32"), **change)


@pytest.mark.parametrize(
    ("edit", "complaint"),
    [
        (lambda d: d["slots"][1].update(rot6d_layout="rows"), "it was edited"),
        (lambda d: d.update(horizn=3), "did you mean 'horizon'"),
        (lambda d: d["slots"][0].update(frames="pelvis"), "did you mean 'frame'"),
        (lambda d: d["slots"][0].pop("unit"), r"keys \['unit'\] are missing"),
        (lambda d: d.pop("slots"), "needs 'slots'"),
        (lambda d: d["slots"][0].update(start="zero"), "wrong type"),
        (lambda d: d["slots"][0].update(kind=["position"]), "is unknown"),
    ],
)
def test_edited_json_is_refused(edit, complaint):
    data = json.loads(builtin("wbc32").to_json())
    edit(data)
    with pytest.raises(SpecError, match=complaint):
        ActionSpec.from_json(json.dumps(data))


@pytest.mark.parametrize("text", ["", "{", "[]", "3", '"wbc32"', '{"slots": [1]}'])
def test_text_that_is_no_spec_is_refused(text):
    with pytest.raises(SpecError):
        ActionSpec.from_json(text)


def test_an_unknown_layout_is_refused_with_the_nearest():
    with pytest.raises(SpecError, match="did you mean 'wbc32'"):
        builtin("wbc23x")


def test_every_target_is_reachable_by_a_slot():
    used = {s.name for name in LAYOUTS for s in builtin(name).slots if s.kind != "ignored"}
    assert used | set(OF_TOUCH) == set(TARGETS)  # none bounds a hand's force or stiffness
