"""The policy in the package: what it says in the stance, and what it refuses; on the robot: `test_learned.py`."""

import numpy as np
import pytest

from lerobot_robot_wholebody.tasks import Reach
from models import g1
from policy import PolicyError
from policy.learned.act import FILE_MAX
from policy.learned.reach import FIRST_SEED, WEIGHTS, LearnedReach, network
from policy.scripted.policy import palm_offset, stance_pose
from tests.support.policy_cases import observation


def palms(chunk):
    """Palm points in world, (H, 2, 3)."""
    pairs = ((chunk.T_world_lhand, "left"), (chunk.T_world_rhand, "right"))
    return np.stack([T[:, :3, 3] + T[:, :3, :3] @ palm_offset(side) for T, side in pairs], axis=1)


def test_from_the_stance_it_sets_off_to_its_goals():
    for seed in range(5):
        policy = LearnedReach(seed)
        way = palms(policy.infer(observation(1.0)))
        assert len(way) == network().horizon
        begin = np.stack([stance_pose().p_world_lpalm, stance_pose().p_world_rpalm])
        far = [np.linalg.norm(policy.goals - p, axis=1).max() for p in (begin, way[0], way[-1])]
        assert np.linalg.norm(way[0] - begin, axis=1).max() < 1e-6  # no jump
        assert far[2] < far[1]


def test_its_goals_are_those_of_the_environment_by_seed():
    task = Reach(0)
    task.draw(np.random.default_rng(FIRST_SEED + 7))
    assert np.array_equal(LearnedReach(7).goals, task.goals)
    assert not np.array_equal(LearnedReach(8).goals, task.goals)


def test_it_is_small_and_says_the_same_each_time():
    assert WEIGHTS.stat().st_size <= FILE_MAX
    chunks = [LearnedReach(3).infer(observation(1.0)) for _ in range(2)]
    assert np.array_equal(chunks[0].T_world_lhand, chunks[1].T_world_lhand)


def test_another_robot_is_refused():
    assert LearnedReach(0, g1()).spec.robot == g1()
    with pytest.raises(PolicyError, match="Dex3"):
        LearnedReach(0, g1(hands=False))
