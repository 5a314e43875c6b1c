"""The robot's state as numbers, and back to a posture that has them."""

import dataclasses

import numpy as np
import pytest

from models import g1
from policy import LAYOUTS, ActionSpec, Anchor, ObservationError, builtin
from policy.action_spec.parts import joints, stack, wrist
from policy.action_spec.state import STATE_MAX, observation_of, state_layout, state_numbers
from policy.geometry.rotations import rpy_to_matrix
from policy.geometry.se3 import inverse, make_transform
from policy.kinematics.forward import kinematics
from policy.kinematics.inverse import leg_joints


@pytest.mark.parametrize("name", LAYOUTS)
@pytest.mark.parametrize("lean", [0.0, 0.3])
def test_an_observation_of_some_numbers_has_these_numbers(name, lean):
    layout, rng, anchor = state_layout(builtin(name)), np.random.default_rng(3), Anchor.nominal()
    q = anchor.q_body + rng.uniform(-0.1, 0.1, 29)
    q[g1().limbs["waist"]] = (0.1, 0.0, lean)
    seen = dataclasses.replace(anchor.observation(1.5), q_body=q)
    numbers = state_numbers(layout, seen)
    again = observation_of(layout, numbers, 1.5)
    again.validate()
    assert again.time == 1.5
    # A gripper's number is the nearest to the fingers, which is exact only where it was made from one.
    np.testing.assert_allclose(state_numbers(layout, again), numbers, atol=2e-6)


def test_numbers_that_no_posture_has_are_refused():
    layout = builtin("wbc32-v1")
    numbers = state_numbers(layout, Anchor.nominal().observation())
    with pytest.raises(ObservationError, match="the state is none of 'wbc32': waist and arms cannot reach"):
        observation_of(layout, numbers + 2.0 * (np.arange(32) < 1))
    with pytest.raises(ObservationError, match=r"have shape \(1, 31\)"):
        observation_of(layout, numbers[:31])


def leaning(height=0.6, lean=(0.1, 0.5, -0.1)):
    """A robot whose pelvis has come down and leans, soles where the stance has them."""
    anchor, R = Anchor.nominal(np.eye(4)), rpy_to_matrix(np.array(lean))
    T = make_transform(R, np.array([-0.02, 0.01, height]))
    T_base_soles, soles = inverse(T) @ anchor.T_world_base, kinematics().soles(anchor.q_body[None])
    q = leg_joints({side: T_base_soles @ sole[0] for side, sole in soles.items()}, anchor.q_body)
    q[g1().limbs["waist"]] = (0.1, 0.0, 0.2)
    return Anchor(T, q, anchor.q_lhand, anchor.q_rhand)


def test_the_state_of_wbc32_has_height_and_lean_of_the_pelvis_and_fits_pi0():
    spec = builtin("wbc32")
    layout, anchor = state_layout(spec), leaning()
    assert layout.dim == 23 <= STATE_MAX
    assert layout.feature_names[:18] == spec.feature_names[:18]
    assert layout.feature_names[18:20] == ("left_grasp.pos", "right_grasp.pos")
    assert layout.feature_names[20:] == ("base_height.pos", "base_tilt_roll.pos", "base_tilt_pitch.pos")
    numbers = state_numbers(layout, anchor.observation())
    np.testing.assert_allclose(numbers[20:], [0.6, 0.1, 0.5], atol=1e-6)
    # Wherever the robot stands, and however it is turned, its state is the same.
    T_world_feet = make_transform(rpy_to_matrix(np.array([0.0, 0.0, 2.0])), np.array([3.0, -1.0, 0.4]))
    elsewhere = dataclasses.replace(anchor, T_world_base=T_world_feet @ anchor.T_world_base)
    np.testing.assert_allclose(state_numbers(layout, elsewhere.observation()), numbers, atol=1e-9)


def test_a_leaning_robot_is_found_again_in_its_state():
    layout, anchor = state_layout(builtin("wbc32")), leaning()
    numbers = state_numbers(layout, anchor.observation())
    again = observation_of(layout, numbers)
    np.testing.assert_allclose(state_numbers(layout, again), numbers, atol=2e-6)
    assert abs(again.T_world_base[2, 3] - 0.6) < 1e-6
    with pytest.raises(ObservationError, match="the legs cannot hold the pelvis there"):
        observation_of(layout, numbers + 0.5 * (np.arange(23) == 20))


def test_a_state_of_the_first_version_is_what_it_was():
    first = builtin("wbc32-v1")
    assert state_layout(first) is first
    assert [slot.name for slot in state_layout(builtin("wbc27")).slots] == [s.name for s in builtin("wbc27").slots]


def test_hands_of_a_short_layout_stay_as_they_are():
    parts = [part | {"frame": "stance"} for side in ("left", "right") for part in wrist(side)[:1]]
    spec = ActionSpec(name="short", slots=stack(*parts, joints(g1(), "left_hand")))
    names = [slot.name for slot in state_layout(spec).slots]
    assert names == ["left_wrist_position", "right_wrist_position", "left_hand", "base_height", "base_tilt"]
