"""Columns by name, never by position: what is understood, and what is refused with which cure."""

import numpy as np
import pytest

from models import g1
from policy.action_spec.builtin import builtin
from policy.dataset.joint_layout import joint_layout
from policy.dataset.joint_values import check_values
from policy.dataset.naming.meaning import UNITREE_DEX3, flat_names
from policy.errors import DatasetError
from tests.support.joint_cases import DEX1, DEX3, swinging

NAMES = list(UNITREE_DEX3)


def swapped(names, first, second):
    names = list(names)
    i, j = names.index(first), names.index(second)
    names[i], names[j] = names[j], names[i]
    return names


def test_unitree_dex3_names_are_the_layout_joint28():
    slots = builtin("joint28").slots
    assert DEX3.names == tuple(name for slot in slots for name in slot.joint_names)
    assert DEX3.columns.tolist() == list(range(28))
    assert DEX3.spec.hash == builtin("joint28").hash


def test_unitree_dex1_names_are_the_layout_joint16():
    assert DEX1.names[-2:] == ("left_grasp", "right_grasp")
    assert DEX1.dex1
    assert DEX1.spec.hash == builtin("joint16").hash


def test_the_right_hand_lists_its_index_finger_before_its_middle_finger():
    assert DEX3.names[14 + 3] == "left_hand_middle_0_joint"
    assert DEX3.names[21 + 3] == "right_hand_index_0_joint"


@pytest.mark.parametrize(
    "spelt",
    [
        lambda name: name,
        lambda name: f"{name}.q",
        lambda name: f"{name}.pos",
        lambda name: DEX3.names[NAMES.index(name)],
        lambda name: DEX3.names[NAMES.index(name)].removesuffix("_joint") + ".pos",
    ],
)
def test_spellings_of_unitree_urdf_and_lerobot_are_the_same_joint(spelt):
    assert joint_layout([spelt(name) for name in NAMES], 28).names == DEX3.names


@pytest.mark.parametrize("form", [NAMES, [NAMES], {"motors": NAMES}, {"motors": [NAMES]}, tuple(NAMES)])
def test_names_are_found_in_every_form_that_datasets_have(form):
    assert flat_names(form) == UNITREE_DEX3


@pytest.mark.parametrize("form", [None, [], {}, "kLeftElbow", [1, 2], {"a": NAMES, "b": NAMES}])
def test_other_forms_have_no_names(form):
    assert flat_names(form) == ()


def test_columns_in_another_order_are_mapped_by_their_names():
    order = np.random.default_rng(3).permutation(28)
    layout = joint_layout([NAMES[i] for i in order], 28)
    q = swinging()
    assert np.array_equal(q[:, order][:, layout.columns], q)


def test_waist_columns_come_last_in_the_spec_and_legs_are_left_out():
    names = ["kLeftHipPitch", "kWaistYaw", "kWaistRoll", "kWaistPitch", *NAMES]
    layout = joint_layout(names, 32)
    assert layout.has_waist
    assert layout.spec.dim == 31
    assert layout.columns[-3:].tolist() == [1, 2, 3]


@pytest.mark.parametrize(
    ("names", "dim", "says"),
    [
        (None, 28, "--assume-spec joint28"),
        (NAMES[:27], 28, "one name a column"),
        ([*NAMES[:27], "kRightHandRing0"], 28, "which is no joint of the G1"),
        ([*NAMES[:27], "kRightHandMidle1"], 28, "did you mean"),
        ([*NAMES[:27], "kLeftElbow"], 28, "two columns for left_elbow_joint"),
        (NAMES[:21], 21, "both hands"),
        ([*NAMES, "kLeftGripper", "kRightGripper"], 30, "both Dex3 fingers and grippers"),
        ([f"motor_{i}" for i in range(28)], 28, "say --assume-spec joint28"),
    ],
)
def test_names_that_do_not_say_which_joints_are_refused_with_a_cure(names, dim, says):
    with pytest.raises(DatasetError, match=says) as caught:
        joint_layout(names, dim, feature="observation.state")
    assert caught.value.feature == "observation.state"


def test_a_user_may_vouch_for_columns_without_names():
    assert joint_layout(None, 28, assume=builtin("joint28")).names == DEX3.names
    assert joint_layout([f"m{i}" for i in range(16)], 16, assume=builtin("joint16")).dex1


@pytest.mark.parametrize(
    ("names", "dim", "assume", "says"),
    [
        (None, 26, "joint28", "'joint28' has 28"),
        (None, 32, "wbc32", "is no joint layout"),
        (swapped(NAMES, "kRightHandIndex0", "kRightHandMiddle0"), 28, "joint28", "the order is another one"),
    ],
)
def test_vouching_does_not_override_what_names_and_sizes_say(names, dim, assume, says):
    with pytest.raises(DatasetError, match=says):
        joint_layout(names, dim, assume=builtin(assume))


def test_an_unknown_unit_is_refused():
    with pytest.raises(DatasetError, match="'rad' or 'deg'"):
        joint_layout(NAMES, 28, unit="grad")


def test_values_within_limits_need_no_note():
    assert check_values(DEX3, swinging()) == ()


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_the_first_number_that_is_not_finite_is_named(bad):
    q = swinging()
    q[7, 3], q[9, 5] = bad, bad
    with pytest.raises(DatasetError, match=r"column 3 \(kLeftElbow\) is -?(nan|inf) at frame 7; 2 of") as caught:
        check_values(DEX3, q)
    assert caught.value.frame == 7


def test_degrees_are_recognised_and_their_option_named():
    with pytest.raises(DatasetError, match="look like degrees, say --unit deg"):
        check_values(DEX3, np.rad2deg(swinging()))
    degrees = joint_layout(NAMES, 28, unit="deg")
    assert check_values(degrees, np.rad2deg(swinging())) == ()


def test_fingers_under_each_others_names_are_recognised():
    q = swinging(frames=60)
    left, right = DEX3.names.index("left_hand_thumb_1_joint"), DEX3.names.index("left_hand_middle_0_joint")
    q[:, left], q[:, right] = 0.9, -1.4
    q[:, [left, right]] = q[:, [right, left]]
    with pytest.raises(DatasetError, match="another order than their names say"):
        check_values(DEX3, q)


def test_small_excursions_beyond_limits_are_noted_not_refused():
    q = swinging()
    elbow = DEX3.names.index("left_elbow_joint")
    q[5, elbow] = g1().position_max[g1().index("left_elbow_joint")] + 0.05
    (note,) = check_values(DEX3, q)
    assert "left_elbow_joint is beyond its limits in 1 frames, by up to 0.05 rad" in note


def test_grippers_in_another_unit_are_refused_and_overshoot_is_noted():
    q = swinging(DEX1)
    q[:, 14] = 55.0
    with pytest.raises(DatasetError, match="a Dex1 motor angle is between 0"):
        check_values(DEX1, q)
    q[:, 14] = -0.1
    (note,) = check_values(DEX1, q)
    assert "kLeftGripper is outside" in note


def test_a_table_of_another_width_is_refused():
    with pytest.raises(DatasetError, match=r"has shape \(40, 16\)"):
        check_values(DEX3, swinging(DEX1))
