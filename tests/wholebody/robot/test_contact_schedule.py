"""Strategy: a schedule answers by time, refuses what contradicts itself, and tells feet that step from feet that stand.

What reads it is tested where that is: program, estimators, what judges a run, plans.
"""

import numpy as np
import pytest

from models import g1
from models.pinocchio_model import load_pinocchio, stance_q
from wholebody.errors import InputError
from wholebody.robot.contact_schedule import Contacts, ContactSchedule
from wholebody.robot.feet import Feet

SPEC = g1()
MODEL = load_pinocchio(SPEC)
FEET = Feet.at(SPEC, MODEL, stance_q(SPEC, MODEL))
BOTH, LEFT = Contacts(FEET), Contacts(FEET, (1.0, 0.0))


def test_contacts_are_those_of_the_last_time_that_has_come():
    schedule = ContactSchedule((BOTH, LEFT, BOTH), (1.0, 2.0))
    assert [schedule.at(time).stands for time in (-9.0, 0.999, 1.0, 1.5, 2.0, 99.0)] == [
        (True, True), (True, True), (True, False), (True, False), (True, True), (True, True)
    ]  # fmt: skip


def test_feet_that_stand_for_ever_are_known_and_feet_that_step_are_refused():
    assert ContactSchedule.standing(FEET).feet() is FEET
    for stepping in (ContactSchedule((BOTH, LEFT), (1.0,)), ContactSchedule((LEFT,))):
        with pytest.raises(InputError, match="both must stand from its beginning to its end"):
            stepping.feet()


@pytest.mark.parametrize("times", [(), (1.0, 2.0), (np.nan,), (np.inf,)])
def test_times_that_do_not_fit_are_refused(times):
    with pytest.raises(InputError, match="finite time at which it begins"):
        ContactSchedule((BOTH, LEFT), times)
    with pytest.raises(InputError, match="must rise"):
        ContactSchedule((BOTH, LEFT, BOTH), (2.0, 1.0))


@pytest.mark.parametrize("load", [(0.0, 0.0), (1.1, 1.0), (-0.1, 1.0), (np.nan, 1.0)])
def test_loads_that_no_feet_have_are_refused(load):
    with pytest.raises(InputError, match="one share of 0 to 1 a foot"):
        Contacts(FEET, load)


def test_a_foot_that_is_relieved_stands_until_it_carries_nothing():
    assert Contacts(FEET, (1.0, 0.01)).stands == (True, True)
    assert Contacts(FEET, (0.0, 1.0)).stands == (False, True)


def test_schedules_are_the_same_to_the_bit_or_not():
    one, moved = ContactSchedule((BOTH, LEFT), (1.0,)), Feet(FEET.R, FEET.p + 1e-15)
    assert one.same(ContactSchedule((Contacts(Feet(FEET.R.copy(), FEET.p.copy())), LEFT), (1.0,)))
    others = (((BOTH, LEFT), (1.5,)), ((BOTH, BOTH), (1.0,)), ((Contacts(moved), LEFT), (1.0,)), ((BOTH,), ()))
    assert not any(one.same(ContactSchedule(*other)) for other in others)
