"""The robot's state as numbers, and back to a posture that has them."""

import dataclasses

import numpy as np
import pytest

from models import g1
from policy import LAYOUTS, Anchor, ObservationError, builtin
from policy.action_spec.state import observation_of, state_layout, state_numbers


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
    layout = builtin("wbc32")
    numbers = state_numbers(layout, Anchor.nominal().observation())
    with pytest.raises(ObservationError, match="the state is none of 'wbc32': waist and arms cannot reach"):
        observation_of(layout, numbers + 2.0 * (np.arange(32) < 1))
    with pytest.raises(ObservationError, match=r"have shape \(1, 31\)"):
        observation_of(layout, numbers[:31])
