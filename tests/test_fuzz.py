"""Strategy: hostile chunks, a feasible one between them; the robot must stand at the end. Families in `fuzz.py`."""

import numpy as np
import pytest
from fuzz import FAMILIES, Episode

from models.g1 import g1
from wholebody.sim.plant import MujocoPlant
from wholebody.supervisor import Supervisor


@pytest.fixture(scope="module")
def robot():
    spec = g1()
    return Supervisor(spec), MujocoPlant(spec)


@pytest.mark.parametrize("seed", range(40))
def test_hostile_chunks_do_not_make_it_fall(robot, seed):
    result = Episode(*robot, seed).run()
    assert result.fall is None, str(result)
    assert np.rad2deg(result.tilt) <= 40.0, str(result)


@pytest.mark.regression
@pytest.mark.timeout(0)
@pytest.mark.parametrize("seed", range(300))
def test_three_hundred_hostile_episodes(robot, seed):
    result = Episode(*robot, seed).run()
    assert result.fall is None, str(result)
    assert np.rad2deg(result.tilt) <= 40.0, str(result)


def test_every_family_is_drawn_equally_often():
    assert 300 // len(FAMILIES) >= 27
