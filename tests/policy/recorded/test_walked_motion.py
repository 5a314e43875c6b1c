"""Motions that are walked. Strategy: walks of another gait are made, and their way must come back within the limits of
a robot that walks, from rest to rest, with hands that are nowhere but where it can have them."""

import re
from dataclasses import replace

import numpy as np
import pytest

from policy import write_motion_csv
from policy.action_spec.anchor import Anchor
from policy.geometry.rotations import rpy_to_matrix
from policy.geometry.se3 import make_transform
from policy.observation import Observation
from policy.recorded.motion_csv import HANDS_ONLY, Motion, motion_chunk, travels
from policy.recorded.replay import ReplayPolicy, WalkedReplay, open_recording
from policy.recorded.walked_motion import BEFORE, FAR_HANDS, WalkedWay, WalkLimits, base_way, walked_along, walked_chunk
from tests.support.made_walks import WALKS, MadeWalk, along, made_walk


def share(velocities):
    """0.4 m/s ahead, 0.25 back, 0.15 aside and 0.5 rad/s, together."""
    x, y, turn = velocities.T
    return np.sqrt((x / np.where(x > 0.0, 0.4, 0.25)) ** 2 + (y / 0.15) ** 2 + (turn / 0.5) ** 2)


LIMITS = WalkLimits(
    share=share,
    acceleration=(0.3, 0.8),
    hands=(0.9, 4.0),
    shift=0.6,
    near=0.02,
    far=0.05,
    nearest=lambda points: points,
)
SLOW = MadeWalk((along(1.0, 0.0, 0.0, 0.0), along(6.0, 0.15, 0.0, 0.0), along(1.0, 0.0, 0.0, 0.0)), swing=0.05)


def placed(motion):
    """Way of a base (n, 3) from where it begins: complex places and headings."""
    way = base_way(motion)
    turned = way[:, 2] - way[0, 2]
    return (way[:, 0] - way[0, 0] + 1j * (way[:, 1] - way[0, 1])) * np.exp(-1j * way[0, 2]), turned


@pytest.mark.parametrize("name", list(WALKS))
def test_the_way_is_walked_within_the_limits_from_rest_to_rest(name):
    motion = made_walk(WALKS[name])
    chunk, walked = walked_chunk(motion, LIMITS), WalkedWay.of(motion, LIMITS)
    velocity = chunk.base_velocity
    assert LIMITS.share(velocity).max() < 0.95
    change = (np.diff(velocity, axis=0) * chunk.fps)[int(BEFORE * chunk.fps) + 1 : -2]
    assert np.hypot(change[:, 0], change[:, 1]).max() < LIMITS.acceleration[0]
    assert np.abs(change[:, 2]).max() < LIMITS.acceleration[1]
    assert np.abs(velocity[: int(BEFORE * chunk.fps)]).max() == 0.0
    assert LIMITS.share(velocity[[int(BEFORE * chunk.fps), -2]]).max() < 0.15
    assert not velocity[-1].any()
    places, headings = walked_along(velocity, chunk.fps)
    ends, turned = placed(motion)
    assert abs(places[-1] - ends[-1]) < 5e-3
    assert headings[-1] == pytest.approx(turned[-1], abs=1e-6)
    assert walked.times[-1] >= motion.duration - 1e-9
    (note,) = (text for text in chunk.notes if text.startswith("this motion is walked"))
    assert f"{walked.times[-1] / motion.duration:.2f} x slower" in note
    (stays,) = (text for text in motion_chunk(motion).notes if text.startswith(HANDS_ONLY))
    assert "travel" in stays or "turn" in stays


def test_a_slow_walk_is_as_fast_as_it_was_recorded():
    bobs, note = walked_chunk(made_walk(SLOW), LIMITS).notes
    assert note.endswith("as fast as it was recorded")
    assert "hands are up to 0.02 m off, over the floor" in bobs
    assert not bobs.startswith(FAR_HANDS)


@pytest.mark.parametrize(("low", "pitch"), [(0.1, 0.0), (0.0, 0.3), (0.2, 0.4)])
def test_a_bow_and_a_squat_on_the_way_are_another_motion_of_the_hands(low, pitch):
    """A robot that walks is upright: as recorded, and `feasible`, was said of a walk whose hands went down by 0.3 m."""
    motion = made_walk(SLOW)
    share = np.exp(-(((np.arange(len(motion)) / motion.fps - 4.0) / 1.2) ** 2))
    T = motion.T_world_base @ make_transform(rpy_to_matrix(pitch * share[:, None] * [0.0, 1.0, 0.0]), np.zeros(3))
    T[:, 2, 3] -= low * share
    note = walked_chunk(Motion(motion.fps, T, motion.q_body), LIMITS).notes[0]
    assert note.startswith(FAR_HANDS)
    assert float(re.search(r"up to ([\d.]+) m off the robot's height", note)[1]) == pytest.approx(low, abs=0.025)
    assert "which is not followed" in note


def test_steps_of_a_person_are_no_part_of_the_way():
    motion = made_walk(WALKS["walk_0.55"])
    places, _ = placed(motion)
    assert np.abs(places.imag).max() < 0.01  # the pelvis sways by 25 mm
    assert np.ptp(motion.T_world_base[:, 1, 3]) > 0.045


def test_hands_that_a_walk_cannot_have_are_drawn_in_and_said():
    motion = made_walk(WALKS["walk_0.55"])
    low = replace(LIMITS, nearest=lambda points: points - np.array([0.0, 0.0, 0.05]))
    chunk = walked_chunk(motion, low)
    assert "are drawn in by up to 0.050 m: their own way is not followed" in chunk.notes[0]
    assert not chunk.notes[0].startswith(FAR_HANDS)
    assert walked_chunk(motion, replace(low, far=0.04)).notes[0].startswith(FAR_HANDS)
    np.testing.assert_allclose(chunk.T_world_lhand[0] - walked_chunk(motion, LIMITS).T_world_lhand[0],
                               [[0] * 4, [0] * 4, [0, 0, 0, -0.05], [0] * 4], atol=1e-12)  # fmt: skip


def observation(time, place=0j, heading=0.0):
    anchor = Anchor.nominal()
    c, s = np.cos(heading), np.sin(heading)
    T = make_transform(np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]), [place.real, place.imag, 0.0])
    return Observation(time, anchor.q_body, anchor.q_lhand, anchor.q_rhand, T @ anchor.T_world_base)


def test_a_base_that_is_off_its_way_is_brought_back_and_hands_are_about_it():
    motion = made_walk(WALKS["walk_0.55"])
    policy = WalkedReplay(walked_chunk(motion, LIMITS), LIMITS)
    first = policy.infer(observation(5.0, 1.0 + 2.0j, 0.5))
    time = BEFORE + 3.0
    way = walked_along(policy.episode.base_velocity, policy.episode.fps)[0][round(time * policy.episode.fps)]
    there = 1.0 + 2.0j + way * np.exp(0.5j)
    on = policy.infer(observation(5.0 + time, there, 0.5))
    policy.reset()
    policy.infer(observation(5.0, 1.0 + 2.0j, 0.5))
    right = policy.infer(observation(5.0 + time, there - 0.1j * np.exp(0.5j), 0.5))
    np.testing.assert_allclose(on.base_velocity[0], policy.episode.base_velocity[round(time * 30)], atol=0.01)
    np.testing.assert_allclose((right.base_velocity - on.base_velocity)[0], [0.0, 0.05, 0.0], atol=1e-3)
    moved = right.T_world_lhand[0, :2, 3] - on.T_world_lhand[0, :2, 3]
    np.testing.assert_allclose(moved, [0.1 * np.sin(0.5), -0.1 * np.cos(0.5)], atol=1e-9)
    assert first.hands_in == on.hands_in == "stance"
    assert any("the feet stay" in note for note in on.notes)


def test_a_walk_is_begun_before_it_is_due():
    """The weight is shifted first, and the base does not move meanwhile."""
    policy = WalkedReplay(walked_chunk(made_walk(WALKS["walk_0.55"]), LIMITS), LIMITS)
    moves = np.abs(policy.infer(observation(0.0)).base_velocity).max(axis=1) > 0.05
    due = np.abs(policy.episode.base_velocity).max(axis=1) > 0.05
    assert np.argmax(due) - np.argmax(moves) == round(LIMITS.shift * policy.episode.fps)


def test_a_file_is_walked_where_limits_are_given_and_its_hands_alone_are_played_where_not(tmp_path):
    motion = made_walk(WALKS["walk_0.55"])
    write_motion_csv(tmp_path / "walk.csv", motion)
    stays, walks = open_recording(tmp_path / "walk.csv"), open_recording(tmp_path / "walk.csv", walks=LIMITS)
    assert type(stays) is ReplayPolicy
    assert stays.episode.base_velocity is None
    assert any(note.startswith(HANDS_ONLY) for note in stays.episode.notes)
    assert isinstance(walks, WalkedReplay)
    assert isinstance(walks.held(1.0), WalkedReplay)
    assert not [note for note in walks.episode.notes if note.startswith(HANDS_ONLY)]
    still = Motion(motion.fps, np.repeat(motion.T_world_base[:1], len(motion), axis=0), motion.q_body)
    assert travels(still) is None
    write_motion_csv(tmp_path / "stays.csv", still)
    assert type(open_recording(tmp_path / "stays.csv", walks=LIMITS)) is ReplayPolicy


def test_a_recording_waits_for_a_base_that_stays():
    policy = WalkedReplay(walked_chunk(made_walk(WALKS["walk_0.55"]), LIMITS), LIMITS)
    asked = [policy.infer(observation(0.8 * k)) for k in range(8)]
    due = [policy.episode.T_world_lhand[round(0.8 * k * 30) :][:1] for k in range(8)]
    np.testing.assert_allclose(asked[3].T_world_lhand[:1], due[3], atol=1e-6)
    held = [one.T_world_lhand[0] for one in asked[5:]]
    np.testing.assert_allclose(held, held[:1] * 3, atol=1e-12)
    assert not [note for one in asked[:4] for note in one.notes if "waits" in note]
    assert "so much of its end is not followed" in asked[-1].notes[-1]
    on_time = np.array([one.t_obs - 0.8 * k for k, one in enumerate(asked)])
    assert (on_time <= 1e-9).all()
    assert (on_time > -1.0 / 30.0).all()
