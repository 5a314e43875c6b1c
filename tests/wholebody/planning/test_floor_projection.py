"""Strategy: chunks whose hands are in the floor, over it, and turned so that the fingers point into it."""

import dataclasses

import numpy as np
import pytest

from policy.geometry.rotations import rotvec_to_matrix
from policy.scripted.library import scripted_policy
from tests.support.policy_cases import observation
from wholebody.planning.floor_projection import CLEARANCE, HAND_BOX, above_floor


def chunk_at(height, turn=(0.0, 0.0, 0.0)):
    policy = scripted_policy("wave")
    policy.reset()
    chunk = policy.infer(observation(0.0))
    T = chunk.T_world_lhand.copy()
    T[:, 2, 3], T[:, :3, :3] = height, rotvec_to_matrix(np.array(turn))
    return dataclasses.replace(chunk, T_world_lhand=T)


def lowest(T):
    return (T[:, 2, 3] + (T[:, 2, :3] @ HAND_BOX.T).min(axis=1)).min()


def test_a_hand_in_the_floor_is_lifted_over_it_and_moved_no_other_way():
    chunk = chunk_at(-0.4)
    lifted, most = above_floor(chunk)
    assert lowest(lifted.T_world_lhand) == pytest.approx(CLEARANCE)
    assert most == pytest.approx(np.max(lifted.T_world_lhand[:, 2, 3] + 0.4))
    assert np.array_equal(lifted.T_world_lhand[:, :2], chunk.T_world_lhand[:, :2])
    assert np.array_equal(lifted.T_world_rhand, chunk.T_world_rhand)


def test_fingers_that_point_down_count():
    assert above_floor(chunk_at(0.15))[1] == 0.0
    assert above_floor(chunk_at(0.15, (0.0, 1.57, 0.0)))[1] > 0.05


def test_a_chunk_above_the_floor_is_left_as_it_is():
    chunk = chunk_at(0.8)
    assert above_floor(chunk) == (chunk, 0.0)
