"""Strategy: a chunk that goes through a plane, with palms ahead of turned wrists."""

import numpy as np
import pytest

from models import g1
from policy.chunk import ActionChunk
from policy.geometry.rotations import rotvec_to_matrix
from policy.geometry.se3 import make_transform
from wholebody.reference.surface import Surface, kept_out, turned

OFFSETS = np.array([tool.palm_offset for tool in g1().tools])


@pytest.fixture
def chunk():
    R = rotvec_to_matrix(np.array([0.3, -0.4, 0.2]))
    path = np.linspace([0.2, 0.2, 1.0], [0.5, 0.3, 0.6], 20)
    T = make_transform(np.repeat(R[None], 20, axis=0), path)
    return ActionChunk("", 0, 0.0, 30.0, T, T.copy(), np.zeros((20, 7)), np.zeros((20, 7)))


def palms(T, offset):
    return T[:, :3, 3] + T[:, :3, :3] @ offset


def test_a_palm_stops_at_the_surface_and_goes_on_along_it(chunk):
    into = np.array([0.6, 0.0, -0.8])
    surface = Surface(palms(chunk.T_world_lhand, OFFSETS[0])[7], into)
    kept = kept_out(chunk, (surface, None), OFFSETS)
    before, after = palms(chunk.T_world_lhand, OFFSETS[0]), palms(kept.T_world_lhand, OFFSETS[0])
    np.testing.assert_array_equal(after[:8], before[:8])
    assert np.abs((after[8:] - surface.point) @ into).max() < 1e-12
    moved = before - after
    np.testing.assert_allclose(moved - (moved @ into)[:, None] * into, 0.0, atol=1e-12)
    np.testing.assert_array_equal(kept.T_world_lhand[:, :3, :3], chunk.T_world_lhand[:, :3, :3])


def test_a_hand_that_met_nothing_is_left_alone_and_the_chunk_is_not_changed(chunk):
    first = chunk.T_world_lhand.copy()
    kept = kept_out(chunk, (Surface(np.zeros(3), np.array([1.0, 0.0, 0.0])), None), OFFSETS)
    np.testing.assert_array_equal(kept.T_world_rhand, chunk.T_world_rhand)
    np.testing.assert_array_equal(chunk.T_world_lhand, first)


def test_a_direction_turns_towards_a_push_and_stays_where_that_leaves_none():
    x, y = np.eye(3)[:2]
    np.testing.assert_allclose(turned(np.zeros(3), 4.0 * y, 0.9), y)
    np.testing.assert_allclose(turned(x, 2.0 * y, 0.5), (x + y) / np.sqrt(2.0))
    np.testing.assert_array_equal(turned(x, -3.0 * x, 0.5), x)
    np.testing.assert_array_equal(turned(x, np.zeros(3), 0.5), x)
