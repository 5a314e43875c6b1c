"""Strategy: a robot in MuJoCo is told to walk near, too far, and where it may not; what is said is where it then is."""

import numpy as np
import pytest

from models import g1
from wholebody import Supervisor, WalkedTo, walk_to
from wholebody.config import ControllerConfig
from wholebody.errors import StateError
from wholebody.execution.states import State
from wholebody.sim.plant import MujocoPlant
from wholebody.types import Reason

SPEC = g1()


@pytest.fixture(scope="module")
def supervisor():
    return Supervisor(SPEC, ControllerConfig(steps="reach"))


def test_it_stands_where_it_was_told_to_and_says_so(supervisor):
    plant = MujocoPlant(SPEC)
    supervisor.reset(plant.reset())
    went = walk_to((0.15, -0.05, 0.1), supervisor, plant)
    soles = plant.soles()
    assert isinstance(went, WalkedTo)
    assert went.stands
    assert went.fall is None
    assert supervisor.state is State.HOLDING
    np.testing.assert_allclose(went.base[:2], soles[:, :2].mean(axis=0), atol=3e-3)
    assert went.off < 0.03
    assert went.turned < 0.05
    assert 2 <= went.steps <= 6
    assert str(went).startswith("stands at (0.1")


@pytest.mark.parametrize("base", [(20.0, 0.0, 0.0), (np.nan, 0.0, 0.0), (0.1, 0.2)])
def test_a_base_that_is_none_is_refused_and_nothing_moves(supervisor, base):
    plant = MujocoPlant(SPEC)
    supervisor.reset(plant.reset())
    went = walk_to(base, supervisor, plant)
    assert not went.stands
    assert went.status.reason is Reason.WALK_REFUSED
    assert str(went).startswith("does not walk: ")
    assert plant.state().time == 0.0


def test_a_supervisor_that_does_not_walk_says_what_would_do():
    plant, stays = MujocoPlant(SPEC), Supervisor(SPEC, ControllerConfig())
    with pytest.raises(StateError):
        walk_to((0.1, 0.0, 0.0), stays, plant)
    stays.reset(plant.reset())
    assert "steps: reach" in walk_to((0.1, 0.0, 0.0), stays, plant).status.detail


def test_a_supervisor_without_the_plant_that_it_drives_is_not_left_out_silently(supervisor):
    with pytest.raises(TypeError, match="or neither"):
        walk_to((0.1, 0.0, 0.0), supervisor)
