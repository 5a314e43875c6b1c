"""`wholebody layouts`: what is printed of a layout is what its codec does."""

import dataclasses
import re

import numpy as np
import pytest

from policy import LAYOUTS, Anchor, builtin, decode
from policy.action_spec.describe import lines, stance_numbers, summary
from policy.action_spec.mask import full_mask
from policy.geometry.rotations import matrix_to_rot6d, rotvec_to_matrix


def rows(spec):
    """Index, feature, and the numbers of every row."""
    return [line.split() for line in lines(spec) if re.match(r"  \d+ ", line)]


@pytest.mark.parametrize("name", LAYOUTS)
def test_layouts_print_every_number_once_in_its_order_with_its_slot_unit_and_frame(name):
    spec = builtin(name)
    used = [i for slot in spec.slots if slot.kind != "ignored" for i in range(slot.start, slot.start + slot.size)]
    assert [(int(row[0]), row[1]) for row in rows(spec)] == [(i, spec.feature_names[i]) for i in used]
    text = "\n".join(lines(spec))
    assert spec.id in text
    assert f"{spec.horizon} steps a chunk at {spec.fps:g} Hz" in text
    for slot in spec.slots:
        heading = next(line for line in lines(spec) if line.startswith(f"{slot.name}: "))
        assert slot.unit in ("1", "") or f"[{slot.unit}]" in heading
        assert slot.reason in heading
        assert slot.closing is None or f"{slot.closing[0]:g} open, {slot.closing[1]:g} closed" in heading
        assert "wrist" not in slot.name or f"in the {slot.frame}" in heading
    assert max(map(len, lines(spec))) <= 120


@pytest.mark.parametrize("name", [name for name in LAYOUTS if name != "joint23"])  # it lacks six joints of the stance
def test_the_stances_values_are_those_of_a_robot_that_stays_where_it_is(name):
    spec, anchor = builtin(name), Anchor.nominal()
    chunk = decode(spec, stance_numbers(spec)[None], anchor, mask=full_mask(spec))
    for hand in ("lhand", "rhand"):
        np.testing.assert_allclose(
            getattr(chunk, f"T_world_{hand}")[0], anchor.T_world_base @ anchor.poses[hand], atol=1e-9
        )


def test_limits_are_the_layouts_own_or_the_joints():
    (grasp,) = (row for row in rows(builtin("wbc27")) if row[1] == "left_grasp.pos")
    assert grasp[-2:] == ["0.000", "1.000"]
    (thumb,) = (row for row in rows(builtin("wbc32")) if row[1] == "right_hand_thumb_1.pos")
    assert thumb[-2:] == ["-1.047", "0.611"]
    (wrist,) = (row for row in rows(builtin("wbc32")) if row[1] == "left_wrist_x.pos")
    assert wrist == ["0", "left_wrist_x.pos", "0.138"]
    (wrist,) = (row for row in rows(builtin("wbc32-v1")) if row[1] == "left_wrist_x.pos")
    assert wrist == ["0", "left_wrist_x.pos", "0.177"]


@pytest.mark.parametrize("layout", ["cols", "rows"])
def test_each_number_of_a_rotation_is_the_element_that_its_line_names(layout):
    slots = tuple(
        dataclasses.replace(s, rot6d_layout=layout) if s.kind == "rot6d" else s for s in builtin("wbc32").slots
    )
    R = rotvec_to_matrix(np.array([0.3, -0.5, 0.7]))
    named = [line for line in lines(dataclasses.replace(builtin("wbc32"), slots=slots)) if "left_wrist_r6_" in line]
    places = [tuple(map(int, re.search(r"R\[(\d), (\d)\]", line).groups())) for line in named]
    assert [R[place] for place in places] == matrix_to_rot6d(R, layout).tolist()


def test_a_tool_point_is_said():
    slots = builtin("wbc32").slots
    moved = (dataclasses.replace(slots[0], tcp_offset=(0.05, 0.0, 0.0)), *slots[1:])
    assert "left_wrist_yaw_link moved by (0.05, 0.0, 0.0) m in the stance" in "\n".join(
        lines(dataclasses.replace(builtin("wbc32"), slots=moved))
    )


def test_a_summary_is_one_line():
    assert summary("wbc32").startswith("wbc32               Two wrist poses in the stance, all fingers: 32 numbers")
    assert summary("wbc32-v1").startswith("wbc32-v1            The first wbc32")


def test_a_version_names_the_other_its_frame_and_the_state_that_goes_with_it():
    said = lines(builtin("wbc32"))
    assert "version 1 has the wrists in the pelvis: wbc32-v1-9425ce13fd02" in said
    assert "version 2 has the wrists in the stance: wbc32-v2-ed4f53491c16" in lines(builtin("wbc32-v1"))
    (state,) = (line for line in said if line.startswith("state: "))
    assert state.startswith("state: 23 numbers, with left_grasp, right_grasp, base_height, base_tilt in place")
    assert state.endswith(" of left_hand, right_hand")


def test_an_orientation_that_is_free_is_said():
    said = [line for line in lines(builtin("wbc32").with_free_orientation()) if "free: " in line]
    assert [line.split(":")[0] for line in said] == ["left_wrist_rotation", "right_wrist_rotation"]
    assert not [line for line in lines(builtin("wbc32")) if "free: " in line]
