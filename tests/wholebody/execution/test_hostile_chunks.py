"""Strategy: hostile chunks, a feasible one between them; the robot must stand at the end, and must have got to the
feasible one. An episode from each start has several families; one of each family alone is a long study.
"""

from collections import Counter

import numpy as np
import pytest

from models import g1
from tests.support.hostile_chunks import FAMILIES, STARTS, Episode, MixedEpisode
from wholebody.execution.supervisor import Supervisor
from wholebody.sim.plant import MujocoPlant

CASES = 330
"""Thirty of each family."""


@pytest.fixture(scope="module")
def robot():
    spec = g1()
    return Supervisor(spec), MujocoPlant(spec)


def survives(episode):
    result = episode.run()
    assert result.fall is None, str(result)
    assert np.rad2deg(result.tilt) <= 40.0, str(result)
    assert result.feasible_error <= 5e-3, str(result)


@pytest.mark.parametrize("seed", range(len(STARTS)))
def test_hostile_chunks_do_not_make_it_fall(robot, seed):
    survives(MixedEpisode(*robot, seed))


@pytest.mark.regression
@pytest.mark.parametrize("seed", [223, 276])
def test_a_kilogram_that_nobody_told_does_not_make_it_fall(robot, seed):
    """In these two the way to where the load is held went through with the trunk at 4.6 rad/s."""
    result = Episode(robot[0], MujocoPlant(g1(), payload_kg=(1.0, 0.0)), seed).run()
    assert result.fall is None, str(result)


@pytest.mark.regression
@pytest.mark.timeout(0)
@pytest.mark.parametrize("seed", range(CASES))
def test_hundreds_of_hostile_episodes(robot, seed):
    survives(Episode(*robot, seed))


def test_every_family_is_drawn_equally_often(robot):
    assert len(FAMILIES) * 30 == CASES
    drawn = Counter(kind for seed in range(len(STARTS)) for kind in MixedEpisode(*robot, seed).kinds)
    assert drawn.keys() == FAMILIES.keys()
    assert min(drawn.values()) == 2
