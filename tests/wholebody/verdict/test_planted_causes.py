"""Strategy: a case of each kind of `tests/support/planted_causes.py` that is quick to tell; the whole is a study."""

import pytest

from tests.support.planted_causes import is_right, passes_drop_one, planted, told


@pytest.mark.parametrize("kind", ["reach", "floor", "start", "jerk", "finger_range", "waist_torque", "scene"])
def test_what_was_planted_is_the_first_cause_and_nothing_of_it_can_be_left_out(kind):
    one = planted(kind, 0)
    found, program = told(one)
    assert one.value > one.bound
    assert is_right(one, [cause.kinds for cause in found])
    assert all(cause.irreducible and passes_drop_one(one, cause, program) for cause in found)
