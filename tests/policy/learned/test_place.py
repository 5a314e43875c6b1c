"""The policy in the package that puts something down: what it is told, and what it does without; on the robot:
`test_learned.py`."""

from dataclasses import replace

import numpy as np
import pytest

from lerobot_robot_wholebody.tasks import task_of
from models.places import ON_TABLE
from policy import Anchor, ObservationError, PolicyError
from policy.learned.act import FILE_MAX
from policy.learned.place import SPOT, WEIGHTS, LearnedPlace, off_spot
from policy.learned.stance_act import FIRST_SEED, JOINED
from policy.learned.things import shown_of, thing_in_stance
from tests.support.policy_cases import observation

USUAL = np.array([[*ON_TABLE[:2], ON_TABLE[2] + 0.08, 1.0, 0.0, 0.0, 0.0]])


def seen(time, objects=USUAL):
    """The robot in its stance before a table."""
    return replace(observation(time), objects=objects)


def test_it_goes_to_where_the_thing_is():
    aside = USUAL + np.array([0.0, 0.04, 0.0, 0.0, 0.0, 0.0, 0.0])
    chunks = [LearnedPlace().infer(seen(1.0, objects)) for objects in (USUAL, aside)]
    assert np.abs(chunks[0].T_world_lhand[0] - chunks[1].T_world_lhand[0]).max() < 1e-9  # no jump
    assert np.abs(chunks[0].T_world_lhand[-1] - chunks[1].T_world_lhand[-1]).max() > 1e-4


def test_a_chunk_goes_on_from_what_was_asked_and_not_from_what_fingers_do():
    policy = LearnedPlace()
    first = policy.infer(seen(1.0))
    squeezed = replace(seen(1.0 + JOINED / 30.0), q_lhand=first.q_lhand[JOINED] + 0.2)
    assert np.abs(policy.infer(squeezed).q_lhand[0] - first.q_lhand[JOINED]).max() < 1e-9


def test_it_is_told_nothing_is_a_clear_error():
    with pytest.raises(ObservationError, match="needs to know where things are"):
        LearnedPlace().infer(observation(1.0))
    with pytest.raises(ObservationError, match="none in this scene"):
        LearnedPlace().infer(seen(1.0, np.zeros((0, 7))))
    with pytest.raises(PolicyError, match="none in this one"):
        LearnedPlace().arranged(np.zeros((0, 7)))


@pytest.mark.parametrize("objects", [np.zeros(7), np.zeros((1, 6)), np.full((1, 7), np.nan)])
def test_poses_of_things_that_are_none_are_refused(objects):
    with pytest.raises(ObservationError, match=r"objects have shape"):
        seen(1.0, objects).validate()


def test_the_thing_stands_where_it_does_in_the_environment_of_the_seed():
    task = task_of("place", 0)
    task.draw(np.random.default_rng(FIRST_SEED + 7))
    assert np.array_equal(LearnedPlace(7).arranged(USUAL), task.objects(USUAL))
    assert not np.array_equal(LearnedPlace(8).arranged(USUAL), task.objects(USUAL))


def test_what_is_told_of_a_thing_is_in_the_stance():
    turned = np.array([[0.0, -1.0, 0.0, 2.0], [1.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
    here, poses = seen(1.0), USUAL.copy()
    poses[0, :3] = turned[:3, :3] @ USUAL[0, :3] + turned[:3, 3]
    elsewhere = replace(here, T_world_base=turned @ here.T_world_base, objects=poses)
    there = [thing_in_stance(one, Anchor.measured(one)) for one in (here, elsewhere)]
    assert there[0] == pytest.approx(there[1], abs=1e-9)
    palms = np.array([[0.2, 0.1, 0.9], [0.2, -0.1, 0.9]])
    assert shown_of(there[0], palms).reshape(3, 3)[1:] + palms == pytest.approx(np.tile(there[0], (2, 1)))


def test_a_thing_is_put_down_on_the_spot_alone():
    begin, there, away = USUAL[0, :3], np.array([*SPOT, USUAL[0, 2]]), np.array([[0.3, 0.3, 0.9], [0.2, -0.3, 0.9]])
    assert off_spot(begin, there, away) <= 0.0
    assert off_spot(begin, begin, away) == pytest.approx(0.13 - 0.03)
    assert off_spot(begin, there - [0.0, 0.0, 0.7], away) > 0.5  # on the floor below


def test_it_is_small_and_says_what_became_of_it():
    assert WEIGHTS.stat().st_size <= FILE_MAX
    policy = LearnedPlace()
    policy.infer(seen(1.0))
    assert "not put down" in policy.told
