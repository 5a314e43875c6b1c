"""Strategy: a layout with every slot of hands that touch, beside one without; the same chunk goes through both.

Forces are turned by a frame that stands askew, so that a transpose or the wrong frame would be seen.
"""

from dataclasses import replace

import numpy as np
import pytest

from policy import ActionSpec, ChunkError, SpecError, builtin, decode, encode
from policy.action_spec.describe import lines
from policy.action_spec.parts import scalar, stack, wrist
from policy.action_spec.slot import OF_TOUCH, Slot
from policy.action_spec.slot_values import NOT_SAID
from policy.action_spec.state import state_layout
from tests.support.policy_cases import anchor_somewhere, wandering_chunk
from wholebody.config import ControllerConfig

ANCHOR = anchor_somewhere()


def part(name, frame="stance"):
    if name.endswith("force"):
        return {"name": name, "kind": "force", "size": 3, "unit": "N", "frame": frame}
    return scalar(name, "N" if name.endswith("force_max") else "N/m")


def layout(*names, frame="stance"):
    wrists = [*wrist("left", frame=frame), *wrist("right", frame=frame)]
    return ActionSpec(name="x", slots=stack(*wrists, *(part(name, frame) for name in names)))


def chunk_that_touches():
    chunk = wandering_chunk(ANCHOR, seed=1)
    rng, steps = np.random.default_rng(0), len(chunk)
    forces = {name: rng.normal(scale=10.0, size=(steps, 3)) for name in ("f_world_lpalm", "f_world_rpalm")}
    limits = {"force_max": rng.uniform(5.0, 60.0, (steps, 2)), "stiffness": rng.uniform(100.0, 900.0, (steps, 2))}
    return replace(chunk, **forces, **limits)


@pytest.mark.parametrize("frame", ["pelvis", "pelvis_yaw", "torso", "stance", "world"])
def test_forces_limits_and_stiffnesses_go_through_a_layout_in_any_frame(frame):
    spec, chunk = layout(*OF_TOUCH, frame=frame), chunk_that_touches()
    found = decode(spec, encode(spec, chunk, ANCHOR), ANCHOR)
    for name in ("f_world_lpalm", "f_world_rpalm", "force_max", "stiffness"):
        np.testing.assert_allclose(getattr(found, name), getattr(chunk, name), atol=1e-9)


def test_axes_go_through_a_layout_and_one_number_is_the_least_of_them():
    chunk, axes = chunk_that_touches(), {"kind": "axes", "size": 3, "frame": "stance"}
    both = [{"name": f"{side}_force_max", "unit": "N", **axes} for side in ("left", "right")]
    wrists = [*wrist("left"), *wrist("right")]
    spec = ActionSpec(name="x", slots=stack(*wrists, *both, {"name": "left_stiffness", "unit": "N/m", **axes}))
    assert ActionSpec.from_json(spec.to_json()) == spec
    assert "left_force_max: axes [N], ahead, to the left and up in the stance, either way" in lines(spec)
    assert spec.feature_names[-3:] == tuple(f"left_stiffness_{axis}.pos" for axis in "xyz")
    rng, steps = np.random.default_rng(1), len(chunk)
    told = replace(chunk, force_max=rng.uniform(5.0, 60.0, (steps, 2, 3)))
    found = decode(spec, encode(spec, told, ANCHOR), ANCHOR)
    np.testing.assert_allclose(found.force_max, told.force_max)
    np.testing.assert_allclose(found.stiffness[:, 0], np.tile(chunk.stiffness[:, :1], 3))
    assert (found.stiffness[:, 1] == NOT_SAID["stiffness"]).all()
    plain = layout("left_force_max")
    least = decode(plain, encode(plain, told, ANCHOR), ANCHOR).force_max[:, 0]
    np.testing.assert_allclose(least, told.force_max[:, 0].min(axis=1))


def test_a_force_in_the_pelvis_is_turned_as_the_pelvis_is():
    spec = layout("left_force", frame="pelvis")
    actions = encode(spec, wandering_chunk(ANCHOR, seed=1), ANCHOR)
    actions[:, -3:] = [1.0, 2.0, 3.0]
    found = decode(spec, actions, ANCHOR)
    np.testing.assert_allclose(found.f_world_lpalm[0], ANCHOR.T_world_base[:3, :3] @ [1.0, 2.0, 3.0])
    assert [found.f_world_rpalm, found.force_max, found.stiffness] == [None] * 3


def test_a_layout_without_such_slots_says_nothing_of_touch_and_one_of_one_hand_leaves_the_other_as_usual():
    chunk = chunk_that_touches()
    plain = decode(layout(), encode(layout(), chunk, ANCHOR), ANCHOR)
    assert [plain.f_world_lpalm, plain.f_world_rpalm, plain.force_max, plain.stiffness] == [None] * 4
    spec = layout("right_force_max", "left_stiffness")
    found = decode(spec, encode(spec, chunk, ANCHOR), ANCHOR)
    np.testing.assert_allclose(found.force_max, np.column_stack([np.full(len(chunk), 1e3), chunk.force_max[:, 1]]))
    assert (found.stiffness[:, 1] == NOT_SAID["stiffness"]).all()
    assert NOT_SAID["stiffness"] == ControllerConfig().touch.stiffness
    assert NOT_SAID["force_max"] > ControllerConfig().touch.force_max


def test_a_chunk_that_says_nothing_of_touch_is_encoded_as_no_force_and_the_usual_hand():
    spec, chunk = layout(*OF_TOUCH), wandering_chunk(ANCHOR, seed=1)
    numbers = encode(spec, chunk, ANCHOR)[:, spec.slot("left_force").start :]
    assert (numbers == [0.0] * 6 + [1e3] * 2 + [600.0] * 2).all()


def test_a_state_has_no_slots_of_touch():
    with_touch, without = state_layout(layout(*OF_TOUCH)), state_layout(layout())
    assert with_touch.slots == without.slots
    assert state_layout(layout("left_force", frame="pelvis")).dim == layout(frame="pelvis").dim


def test_the_page_of_a_layout_says_whose_force_it_is_and_specs_keep_their_hash():
    said = lines(layout("left_force", "left_force_max"))
    assert "left_force: force [N], of the world on the palm, in the stance" in said
    assert "left_force_max: scalar [N]" in said
    spec = layout(*OF_TOUCH)
    assert ActionSpec.from_json(spec.to_json()) == spec
    assert builtin("wbc32").id == "wbc32-v2-" + builtin("wbc32").hash[:12]


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"name": "left_force", "unit": "kg"}, "unit 'kg' is unknown"),
        ({"name": "left_force", "mode": "delta"}, "is absolute, not 'delta'"),
        ({"name": "left_force", "size": 2}, "size 2; the kind 'force' has 3 numbers"),
        ({"name": "left_stiffness", "kind": "scalar", "size": 1, "unit": "N"}, "unit 'N' is unknown"),
        ({"name": "left_stiffness", "kind": "axes", "frame": "stance"}, "unit 'N' is unknown"),
        ({"name": "left_force_max", "kind": "axes"}, "of the kind 'axes', frame 'pelvis' is unknown; possible: stance"),
        ({"name": "left_force_max", "kind": "axes", "frame": "stance", "size": 2}, "size 2; the kind 'axes' has 3"),
        (
            {"name": "left_force_max", "kind": "scalar", "size": 1, "unit": "N", "mode": "relative_add"},
            "is absolute, not 'relative_add'",
        ),
    ],
)
def test_a_slot_of_touch_that_makes_no_sense_is_refused(wrong, said):
    with pytest.raises(SpecError, match=said):
        Slot(**{"kind": "force", "start": 0, "size": 3, "unit": "N", **wrong})


def test_a_negative_limit_is_refused_by_name():
    spec = layout("left_force_max")
    actions = encode(spec, wandering_chunk(ANCHOR, seed=1), ANCHOR)
    actions[3, -1] = -1.0
    with pytest.raises(ChunkError, match="force_max is -1; it must not be negative"):
        decode(spec, actions, ANCHOR)
