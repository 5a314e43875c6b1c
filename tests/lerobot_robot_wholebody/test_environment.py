"""Strategy: the real environment, state alone, checked by Gymnasium itself, then solved by saying the goals outright.

What `lerobot-eval` makes of it, pictures included, is in `test_stock_commands.py`.
"""

import json

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from lerobot_robot_wholebody.config_environment import WholebodyEnvConfig
from lerobot_robot_wholebody.environment import G1Env
from lerobot_robot_wholebody.target import wrist_at
from policy.action_spec.codec import encode_valid
from policy.action_spec.state import state_numbers
from policy.chunk import ActionChunk


@pytest.fixture(scope="module")
def env():
    with gymnasium.make("wholebody/G1-v0") as env:
        yield env


def at_goals(env):
    """Action whose palms are at their goals, turned as they are."""
    plain = env.unwrapped
    numbers, seen = plain._numbers, plain._seen.observation
    anchor = numbers.anchor(seen)
    T = anchor.T_world_stance
    poses = []
    for hand, side, goal in zip(("lhand", "rhand"), ("left", "right"), plain._task.goals, strict=True):
        R = (anchor.T_world_base @ anchor.poses[hand])[:3, :3]
        poses.append(T @ wrist_at(goal, T[:3, :3].T @ R, side, numbers))
    rows = [part[None] for part in (*poses, seen.q_lhand, seen.q_rhand)]
    return encode_valid(numbers.spec, ActionChunk(numbers.spec.id, 0, 0.0, 30.0, *rows), anchor)[0].astype(np.float32)


def stay(env):
    """Action that has both hands where they are."""
    numbers = env.unwrapped._numbers
    return state_numbers(numbers.aligned, env.unwrapped._seen.observation).astype(np.float32)


@pytest.mark.filterwarnings("ignore:.*symmetric and normalized.*")
def test_gymnasium_finds_nothing_wrong_with_it(env):
    check_env(env.unwrapped, skip_render_check=True)


def test_the_same_actions_after_the_same_seed_have_the_same_outcome_to_the_bit(env):
    last = []
    for seed in (3, 4, 3):
        env.reset(seed=seed)
        action = stay(env)
        action[2] += 0.1
        for _ in range(15):
            observation, *_ = env.step(action)
        last.append(observation["agent_pos"])
    assert np.array_equal(last[0], last[2])
    assert not np.array_equal(last[0], last[1])  # other goals


def test_palms_that_stay_at_their_goals_are_a_success_that_ends_the_episode(env):
    env.reset(seed=5)
    action, rewards = at_goals(env), []
    for _ in range(env.unwrapped._max_episode_steps):
        _, reward, terminated, truncated, info = env.step(action)
        rewards.append(reward)
        assert info["is_success"] == terminated
        if terminated or truncated:
            break
    assert info["is_success"]
    assert not info["fell"]
    assert rewards[-1] > 0.9 > 0.0 > rewards[0]
    assert len(rewards) > env.unwrapped._task.held


def test_an_episode_in_which_nothing_is_done_ends_without_success_and_is_counted_once(tmp_path):
    """`lerobot-eval` resets twice before it steps: twenty episodes were reported as forty."""
    env = G1Env(steps=5, report=str(tmp_path / "report.json"))
    env.reset(seed=6)
    env.reset(seed=6)
    ends = [env.step(stay(type("", (), {"unwrapped": env})))[2:4] for _ in range(5)]
    env.close()
    assert ends == [(False, False)] * 4 + [(False, True)]
    assert json.loads((tmp_path / "report.json").read_text()) == {"episodes": 1, "successes": 0, "falls": 0}


def test_an_action_that_is_none_is_not_taken_and_the_robot_stands(env):
    observation, _ = env.reset(seed=7)
    for action in (np.zeros(32, np.float32), np.full(32, np.nan, np.float32)):
        later, *_, info = env.step(action)
        assert not info["taken"]
    assert later["agent_pos"][:3] == pytest.approx(observation["agent_pos"][:3], abs=2e-3)


def test_goals_are_among_the_observations(env):
    observation, _ = env.reset(seed=8)
    assert observation["environment_state"].tolist() == observation["agent_pos"][-6:].tolist()


@pytest.fixture(scope="module")
def picking():
    env = G1Env(task="pick")
    yield env
    env.close()


def test_a_thing_stands_elsewhere_by_the_seed_and_is_put_back(picking):
    places = []
    for seed in (1, 2, 1):
        observation, _ = picking.reset(seed=seed)
        assert observation["environment_state"].tolist() == observation["agent_pos"][-9:].tolist()
        palms = picking._numbers.palms(picking._seen.observation)
        place, ways = observation["environment_state"][:3], observation["environment_state"][3:].reshape(2, 3)
        assert np.allclose(palms + ways, place, atol=1e-6)
        places.append(place)
    assert np.abs(places[0] - places[1]).max() > 5e-3
    assert np.array_equal(places[0], places[2])


def test_a_thing_that_was_lifted_far_enough_for_long_enough_is_a_success(picking):
    picking.reset(seed=3)
    *_, terminated, _, info = picking.step(stay(type("", (), {"unwrapped": picking})))
    assert not terminated
    assert not info["is_success"]
    poses = picking._seen.objects.copy()
    poses[0, 2] += 0.5  # in the air: it falls for 0.3 s
    picking._robot.place(poses)
    seen = 0
    while not info["is_success"] and seen < 12:
        *_, info = picking.step(stay(type("", (), {"unwrapped": picking})))
        seen += 1
    assert not info["is_success"]  # it is above the mark for nine steps
    assert picking._held < picking._task.held


@pytest.mark.parametrize(("name", "value"), [("task", "dance"), ("fps", 50)])
def test_a_setting_that_cannot_be_is_refused_by_its_name(name, value):
    with pytest.raises(ValueError, match=f"{name}={value}"):
        WholebodyEnvConfig(**{name: value})


@pytest.mark.parametrize("task", ["reach", "pick", "lift", "wipe"])
def test_lerobots_features_are_the_environments(task, env, picking):
    config = WholebodyEnvConfig(task=task)
    there = {"reach": env, "pick": picking}
    env = there.get(task) or G1Env(**config.gym_kwargs)
    shapes = {name: feature.shape for name, feature in config.features.items()}
    assert shapes.pop("action") == env.action_space.shape
    assert shapes == {name: space.shape for name, space in env.observation_space.items()}
    if task not in there:
        env.close()
