"""Strategy: which step catches a pendulum, at places with known answers."""

import pytest

from wholebody.walking.catch import SHIFTS, choose
from wholebody.walking.footsteps import LEFT, RIGHT
from wholebody.walking.gait import Gait
from wholebody.walking.places import Place
from wholebody.walking.pressure import Sole

SOLE, OMEGA, GAIT = Sole(0.073, 0.019), 3.8, Gait()
STAND = Place(0.119j, 0.0), Place(-0.119j, 0.0)


def test_a_foot_may_be_set_down_further_out_than_it_need_be():
    """Split after a step back, it leant over the inner edge of its right sole: no step was found, and it fell."""
    step = choose(-0.318 - 0.153j, OMEGA, (Place(0.11j, 0.0), Place(-0.5 - 0.17j, 0.0)), SOLE, GAIT)
    assert step is not None
    assert step.foot == LEFT


def test_no_step_catches_what_runs_away_beyond_the_sole_that_would_carry():
    assert choose(-0.25j, OMEGA, STAND, SOLE, GAIT) is None


@pytest.mark.parametrize("foot", [LEFT, RIGHT])
def test_a_foot_is_lifted_at_once_where_a_shift_of_the_weight_has_to_lead_far(foot):
    """Pushed back and aside by 15 N s, at 135 degrees, the robot shifted its weight, its trunk leant, and it fell."""
    step = choose(complex(-0.065, 0.06 if foot == RIGHT else -0.06), OMEGA, STAND, SOLE, GAIT)
    assert step is not None
    assert (step.foot, step.gait.shift) == (foot, SHIFTS[0])


@pytest.mark.parametrize("way", [0.11, -0.11])
def test_a_push_ahead_or_back_is_caught(way):
    step = choose(complex(way), OMEGA, STAND, SOLE, GAIT)
    assert step is not None
    assert step.beyond == pytest.approx(0.0, abs=0.04)
