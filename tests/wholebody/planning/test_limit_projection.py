"""Strategy: what a hand can do is left alone; what it cannot is moved as little as keeps the bounds."""

from ctypes import c_int

import daqp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.support.reference_motions import lissajous_rows
from wholebody.errors import PlanningError
from wholebody.planning import limit_projection
from wholebody.planning.limit_projection import DEMAND, IMPLAUSIBLE_SHARE, JUMP, N_BEFORE, continued, nearest
from wholebody.reference import HandLimits, HandMotion, rest_row

LIMITS = HandLimits()
FPS = 30.0
TIMES = np.arange(50) / FPS


def steps(t):
    rows = lissajous_rows(t)
    return np.stack([HandMotion(row).T_world_hand for row in rows]), rows[:, 19:26]


def differences(values):
    return [np.diff(values, k, axis=0)[N_BEFORE - k :] * FPS**k for k in (1, 2, 3)]


def test_a_motion_within_the_bounds_is_left_as_it_is():
    T, q = steps(TIMES + 1.0)
    done = continued(TIMES, T, q, LIMITS, HandMotion(lissajous_rows(np.array([1.0]))[0]), 0.0)
    assert not done.changed
    assert done.moved.max() == 0.0
    np.testing.assert_array_equal(done.T[N_BEFORE:], T)
    np.testing.assert_array_equal(done.times[N_BEFORE:], TIMES)


def test_the_steps_before_say_where_the_hand_comes_from():
    T, q = steps(TIMES + 1.0)
    done = continued(TIMES, T, q, LIMITS, HandMotion(lissajous_rows(np.array([1.0]))[0]), 0.0)
    truth, _ = steps(1.0 - np.arange(N_BEFORE, 0, -1) / FPS)
    # Position, velocity and acceleration are carried back, so it is the jerk that is missing: 60 m/s^3 for 0.1 s.
    np.testing.assert_allclose(done.T[:N_BEFORE, :3, 3], truth[:, :3, 3], atol=0.01)


def test_steps_that_are_over_are_left_out():
    T, q = steps(TIMES + 1.0)
    done = continued(TIMES, T, q, LIMITS, HandMotion(lissajous_rows(np.array([1.5]))[0]), 0.5)
    assert done.times[N_BEFORE] == pytest.approx(0.5)
    np.testing.assert_array_equal(done.T[N_BEFORE:], T[15:])


def test_a_jump_is_begun_before_it_comes_and_costs_little():
    values = np.zeros((53, 3))
    values[25:] = [0.1, 0.0, -0.05]
    near = nearest(values, FPS, LIMITS.position)
    for rate, share, cap in zip(differences(near), DEMAND, (2.5, 20.0, 400.0), strict=True):
        assert np.abs(rate).max() <= share * cap * 1.001
    assert np.abs(near - values).max() < 0.06
    assert np.abs(near[24] - values[24]).max() > 0.01
    np.testing.assert_allclose(near[[0, 10, 40, 52]], values[[0, 10, 40, 52]], atol=1e-3)


def test_the_nearest_is_nearer_than_any_other_that_keeps_the_bounds():
    rng = np.random.default_rng(3)
    values = rng.normal(size=(30, 1)) * 0.05
    values[:N_BEFORE] = 0.0
    near = nearest(values, FPS, LIMITS.position)
    smooth = np.concatenate([np.zeros((N_BEFORE, 1)), 1e-3 * np.linspace(0.0, 1.0, 27)[:, None] ** 4])
    # Convexity: on the way to any other motion within the bounds the distance grows.
    for other in (np.zeros_like(values), 0.9 * near, smooth):
        towards = near + 1e-3 * (other - near)
        assert np.sum((towards - values) ** 2) >= np.sum((near - values) ** 2) - 1e-12


def by_active_set(values, fps, limits):
    """What daqp, which keeps bounds softly where it has to, comes to for one column."""
    most = np.multiply(DEMAND, (limits.speed, limits.acceleration, limits.jerk)) / fps ** np.arange(1, 4)
    rows = [np.diff(np.eye(len(values)), k, axis=0)[N_BEFORE - k :] for k in (1, 2, 3)]
    D, bounds = np.vstack(rows), np.repeat(most, len(values) - N_BEFORE)
    known, n = D[:, :N_BEFORE] @ values[:N_BEFORE], len(values) - N_BEFORE
    x, *_ = daqp.solve(
        np.eye(n), -values[N_BEFORE:], D[:, N_BEFORE:], bounds - known, -bounds - known, np.full(len(D), 8, c_int)
    )
    return np.append(values[:N_BEFORE], x)


@pytest.mark.parametrize("scaled", [1.0, IMPLAUSIBLE_SHARE])
@pytest.mark.parametrize(("steps", "fps"), [(5, 30.0), (30, 30.0), (90, 50.0), (150, 100.0)])
@pytest.mark.parametrize("kind", ["jump", "noise", "fast", "past_the_bounds"])
def test_the_nearest_is_that_of_an_active_set(kind, steps, fps, scaled):
    time, rng = np.arange(steps) / fps, np.random.default_rng(steps)
    values = 0.05 * np.sin(2.0 * np.pi * np.arange(steps) / steps)
    values += {
        "jump": 0.05 * (np.arange(steps) > steps // 2),
        "noise": 0.03 * rng.normal(size=steps),
        "fast": 0.1 * np.sin(16.0 * np.pi * np.arange(steps) / steps),
        "past_the_bounds": 3.0 * time,
    }[kind]
    limits = LIMITS.position.scaled(scaled)
    near = nearest(values[:, None], fps, limits)[:, 0]
    np.testing.assert_allclose(near, by_active_set(values, fps, limits), atol=2e-6)


@pytest.mark.parametrize("size", [0.01, 1.0, 1e3, 1e9])
def test_the_rounds_of_a_search_are_no_more_for_more_steps_and_of_any_size(monkeypatch, size):
    """A round is a pass over the steps: 1,000 steps took 38 times what 200 did."""
    rounds, search = [], limit_projection._nearest_steps
    monkeypatch.setattr(limit_projection, "_nearest_steps", lambda *a: rounds.append(search(*a)) or rounds[-1])
    for steps in (50, 200, 1000, 4000):
        values = size * np.random.default_rng(steps).normal(size=(steps, 1))
        near = nearest(values, steps / 1.6, LIMITS.position)
        assert np.isfinite(near).all()
    assert len(rounds) == 4
    assert max(rounds) < 70


def test_numbers_that_are_none_are_refused():
    with pytest.raises(PlanningError, match="in metres"):
        nearest(np.full((20, 1), np.nan), FPS, LIMITS.position)


def test_a_turn_that_jumps_is_tempered_too():
    T = np.tile(np.eye(4), (50, 1, 1))
    T[20:, :3, :3] = Rotation.from_rotvec([0.0, 0.0, 1.0]).as_matrix()
    done = continued(TIMES, T, np.zeros((50, 7)), LIMITS, HandMotion(rest_row(T[0], np.zeros(7))), 0.0)
    assert done.changed
    assert done.moved.max() < 1e-9
    turns = Rotation.from_matrix(done.T[1:, :3, :3] @ np.swapaxes(done.T[:-1, :3, :3], 1, 2)).magnitude()
    assert turns.max() * FPS < 12.1
    np.testing.assert_allclose(done.T[-1, :3, :3], T[-1, :3, :3], atol=1e-2)


def test_a_hand_that_comes_too_fast_is_brought_back_to_the_bounds():
    values = np.zeros((60, 1))
    values[:N_BEFORE, 0] = [-0.5, -0.35, -0.2]  # 4.5 m/s
    near = nearest(values, FPS, LIMITS.position)
    np.testing.assert_array_equal(near[:N_BEFORE], values[:N_BEFORE])
    speed, acceleration, _ = differences(near)
    assert np.abs(speed[6:]).max() <= 2.5
    assert np.abs(acceleration[:2]).max() > 19.0
    np.testing.assert_allclose(near[-10:], 0.0, atol=5e-3)


def test_steps_that_jump_far_are_not_hurried_after():
    T = np.tile(np.eye(4), (50, 1, 1))
    T[20:, 0, 3] = 0.6
    done = continued(TIMES, T, np.zeros((50, 7)), LIMITS, HandMotion(rest_row(T[0], np.zeros(7))), 0.0)
    assert done.moved.max() > JUMP
    speed, acceleration, _ = differences(done.T[:, :3, 3])
    assert speed.max() <= IMPLAUSIBLE_SHARE * 2.5 * 1.01
    assert np.abs(acceleration).max() <= IMPLAUSIBLE_SHARE * 20.0 * 1.01
    assert done.T[-1, 0, 3] == pytest.approx(0.6, abs=1e-3)
