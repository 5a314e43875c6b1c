"""The policy in the package as commands find it, and one of its reaches on the simulated robot."""

from policy.learned.reach import REACHED
from wholebody.cli.sources import expanded, open_source
from wholebody.episode.run import EpisodeConfig
from wholebody.verdict.check import Checker


def test_it_is_a_source_with_a_seed_of_its_goals():
    assert open_source("learned", None, None).name == "learned#0"
    assert open_source("learned#12", None, None).name == "learned#12"
    assert expanded("learned", "") == ["learned"]
    assert expanded("learned", "3,5-6") == ["learned#3", "learned#5", "learned#6"]


def test_both_palms_reach_their_goals_and_the_robot_stands():
    policy = open_source("learned", None, None)
    verdict, _ = Checker(episode=EpisodeConfig(hold=0.5)).check(policy, policy.name, 3.5)
    assert not verdict.fell
    assert policy.off <= REACHED
    assert "reached" in policy.told
