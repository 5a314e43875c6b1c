"""The policy in the package as commands find it, and one of its reaches on the simulated robot."""

import numpy as np
import pytest

from policy import ObservationError, PolicyError
from policy.learned.place import ON_SPOT, SPOT
from policy.learned.reach import REACHED
from wholebody.cli.options import Simulation
from wholebody.cli.simulated import scene_for
from wholebody.cli.sources import expanded, open_source, require_blind
from wholebody.episode.run import EpisodeConfig
from wholebody.verdict.check import Checker
from wholebody.verdict.fast import FastChecker


def test_it_is_a_source_with_a_seed_of_its_goals():
    assert open_source("learned", None, None).name == "learned#0"
    assert open_source("learned#12", None, None).name == "learned#12"
    assert expanded("learned", "") == ["learned"]
    assert expanded("learned", "3,5-6") == ["learned#3", "learned#5", "learned#6"]
    assert expanded("learned_place", "3") == ["learned_place#3"]
    assert open_source("learned_place#3", None, None).name == "learned_place#3"


def test_both_palms_reach_their_goals_and_the_robot_stands():
    policy = open_source("learned", None, None)
    verdict, _ = Checker(episode=EpisodeConfig(hold=0.5)).check(policy, policy.name, 3.5)
    assert not verdict.fell
    assert policy.off <= REACHED
    assert "reached" in policy.told


@pytest.fixture(scope="module")
def at_table():
    return Checker("table_cylinder", episode=EpisodeConfig(hold=0.5))


@pytest.mark.regression
def test_the_cylinder_is_picked_up_and_put_down_on_the_spot(at_table):
    policy, recorder = open_source("learned_place#1", None, None), at_table.recorder()
    verdict, _ = at_table.check(policy, policy.name, policy.duration, recorder=recorder)
    thing = recorder.record()["objects"][:, 0, :3]
    assert not verdict.fell
    assert policy.told.endswith(": put down")
    assert thing[:, 2].max() - thing[0, 2] > 0.04  # carried, not pushed
    assert np.linalg.norm(thing[-1, :2] - SPOT) < ON_SPOT


def test_where_things_stand_is_of_one_policy_alone(at_table):
    at_table.plant.reset()
    usual = at_table.plant.objects()[0, :2]
    for name, moved in (("learned_place#3", True), ("learned", False)):
        policy = open_source(name, None, None)
        at_table.check(policy, name, 0.1)
        assert (np.abs(at_table.plant.objects()[0, :2] - usual).max() > 2e-3) == moved


def test_it_has_its_scene_and_is_refused_where_nobody_tells_it_of_things():
    policy = open_source("learned_place", None, None)
    assert scene_for("learned_place#7", Simulation()) == "table_cylinder"
    with pytest.raises(PolicyError, match="where things are"):
        require_blind({"learned_place": policy}, "live")
    require_blind({"learned": open_source("learned", None, None)}, "live")
    with pytest.raises(ObservationError, match="where things are"):
        FastChecker().check(policy, "learned_place", 1.0, start="stance")
