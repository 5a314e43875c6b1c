"""Strategy: dragged palms, asked as an executor asks: where they go, how smoothly, how fast."""

import numpy as np
import pytest

from policy.observation import Observation
from policy.scripted.policy import palm_offset
from policy.targets.dragged_hands import FPS, RESTING_HORIZON, SPEED_MAX, DraggedHands

PALMS = {"left": np.eye(4), "right": np.eye(4)}
PALMS["left"][:3, 3], PALMS["right"][:3, 3] = (0.25, 0.2, 0.85), (0.25, -0.2, 0.85)


def observation(time):
    return Observation(time, np.zeros(29), np.zeros(7), np.zeros(7), np.eye(4))


def palms_of(chunk):
    """Palm points, shape (2, H, 3)."""
    poses = ((chunk.T_world_lhand, "left"), (chunk.T_world_rhand, "right"))
    return np.stack([T[:, :3, 3] + T[:, :3, :3] @ palm_offset(side) for T, side in poses])


def moved(hands):
    hands.targets = np.stack([PALMS["left"], PALMS["right"]])
    hands.targets[0, 2, 3] += 0.05
    return hands


@pytest.fixture
def hands():
    return DraggedHands(lambda: PALMS)


def test_palms_that_nobody_holds_stay(hands):
    chunk = hands.infer(observation(1.0))
    chunk.validate()
    np.testing.assert_allclose(palms_of(chunk)[0], np.tile(PALMS["left"][:3, 3], (len(chunk), 1)), atol=1e-12)


def test_palms_that_stay_are_asked_for_less_often(hands):
    assert len(hands.infer(observation(0.0))) > 2 * len(moved(hands).infer(observation(0.1)))
    assert len(hands.infer(observation(3.0))) == RESTING_HORIZON


def test_palms_go_to_where_they_are_held_and_the_way_has_no_seam(hands):
    hands.infer(observation(0.0))
    hands.targets = np.stack([PALMS["left"], PALMS["right"]])
    hands.targets[0, :3, 3] += (0.1, 0.0, 0.1)
    before = hands.infer(observation(0.1))
    for k in range(2, 30):
        after = hands.infer(observation(0.1 * k))
        np.testing.assert_allclose(palms_of(after)[:, 0], palms_of(before)[:, 3], atol=1e-9)
        before = after
    np.testing.assert_allclose(palms_of(after)[0, -1], hands.targets[0, :3, 3], atol=1e-4)
    np.testing.assert_allclose(palms_of(after)[1, -1], PALMS["right"][:3, 3], atol=1e-9)


def test_a_long_way_is_gone_no_faster_than_the_limit(hands):
    hands.infer(observation(0.0))
    hands.targets = np.stack([PALMS["left"], PALMS["right"]])
    hands.targets[0, :3, 3] += (1.0, 0.0, 0.0)
    fastest = 0.0
    for k in range(1, 40):
        p = palms_of(hands.infer(observation(0.1 * k)))[0]
        fastest = max(fastest, np.linalg.norm(np.diff(p, axis=0), axis=1).max() * FPS)
    assert 0.5 * SPEED_MAX < fastest < 1.05 * SPEED_MAX


def test_turning_ends_at_the_orientation_that_is_held(hands):
    hands.infer(observation(0.0))
    hands.targets = np.stack([PALMS["left"], PALMS["right"]])
    hands.targets[1, :3, :3] = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    for k in range(1, 40):
        chunk = hands.infer(observation(0.1 * k))
    np.testing.assert_allclose(chunk.T_world_rhand[-1, :3, :3], hands.targets[1, :3, :3], atol=1e-3)
