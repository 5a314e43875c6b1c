"""Strategy: hostile chunks, a feasible one between them; the robot must stand at the end, and must have got to the
feasible one. Families in `fuzz.py`.
"""

import numpy as np
import pytest

from models import g1
from tests.support.hostile_chunks import FAMILIES, Episode
from wholebody.execution.supervisor import Supervisor
from wholebody.sim.plant import MujocoPlant

CASES = 330
"""Thirty of each family."""
SHARP = (0, 12, 24, 14, 4, 16, 28, 18, 8, 20, 32)
"""One of each family, from every start."""


@pytest.fixture(scope="module")
def robot():
    spec = g1()
    return Supervisor(spec), MujocoPlant(spec)


def survives(robot, seed):
    result = Episode(*robot, seed).run()
    assert result.fall is None, str(result)
    assert np.rad2deg(result.tilt) <= 40.0, str(result)
    assert result.feasible_error <= 5e-3, str(result)


@pytest.mark.parametrize("seed", SHARP)
def test_hostile_chunks_do_not_make_it_fall(robot, seed):
    survives(robot, seed)


@pytest.mark.regression
@pytest.mark.parametrize("seed", [223, 276])
def test_a_kilogram_that_nobody_told_does_not_make_it_fall(robot, seed):
    """In these two the way to where the load is held went through with the trunk at 4.6 rad/s."""
    result = Episode(robot[0], MujocoPlant(g1(), payload_kg=(1.0, 0.0)), seed).run()
    assert result.fall is None, str(result)


@pytest.mark.regression
@pytest.mark.timeout(0)
@pytest.mark.parametrize("seed", sorted({*range(CASES)} - {*SHARP}))
def test_hundreds_of_hostile_episodes(robot, seed):
    survives(robot, seed)


def test_every_family_is_drawn_equally_often():
    assert len(FAMILIES) * 30 == CASES
    assert sorted(seed % len(FAMILIES) for seed in SHARP) == list(range(len(FAMILIES)))
