"""Strategy: motions with known noise: what scatters becomes the curve it scatters about, the rest is untouched."""

import dataclasses

import numpy as np
import pytest

from models import g1
from policy.geometry.rotations import angle_between, rotvec_to_matrix
from policy.scripted.library import scripted_policy
from tests.support.policy_cases import observation
from wholebody.config import ControllerConfig, PlanningConfig
from wholebody.episode.run import observe
from wholebody.execution.supervisor import Supervisor
from wholebody.planning.smoothing import smooth, smoothed_chunk
from wholebody.reference import HandLimits
from wholebody.sim.plant import MujocoPlant
from wholebody.types import Status

LIMITS = (HandLimits(), HandLimits())
NOISE = 0.02
"""[m] and [rad] a step: what an untrained policy scatters by around a stance."""


def script(name="lissajous", fps=50.0):
    policy = scripted_policy(name)
    policy.fps = fps
    policy.infer(observation(0.0))
    return policy.infer(observation(3.0))


def noisy(chunk, *, seed=0, position=0.0, rotation=0.0, finger=0.0):
    """The left hand of a chunk with white noise."""
    rng, T = np.random.default_rng(seed), chunk.T_world_lhand.copy()
    T[:, :3, 3] += position * rng.normal(size=(len(chunk), 3))
    T[:, :3, :3] = rotvec_to_matrix(rotation * rng.normal(size=(len(chunk), 3))) @ T[:, :3, :3]
    q = chunk.q_lhand + finger * rng.normal(size=(len(chunk), 7))
    return dataclasses.replace(chunk, T_world_lhand=T, q_lhand=q)


def acceleration(values, fps):
    return np.linalg.norm(np.diff(values, 2, axis=0), axis=1).max() * fps**2


def jerk(values, fps):
    return np.linalg.norm(np.diff(values, 3, axis=0), axis=1).max() * fps**3


@pytest.mark.parametrize("name", ["lissajous", "wave", "reach"])
def test_a_motion_that_can_be_done_is_returned_as_it_is(name):
    chunk = script(name)
    assert smoothed_chunk(chunk, LIMITS) == (chunk, ())


def test_a_jump_and_a_glitch_are_not_noise():
    chunk = script()
    T = chunk.T_world_lhand.copy()
    T[20:, 0, 3] += 0.5
    T[40, 2, 3] += 1.0
    jump = dataclasses.replace(chunk, T_world_lhand=T)
    assert smoothed_chunk(jump, LIMITS)[0] is jump


@pytest.mark.parametrize("seed", range(5))
def test_noise_of_20_mm_on_a_moving_hand_is_taken_out(seed):
    chunk = script()
    clean, names = smoothed_chunk(noisy(chunk, seed=seed, position=NOISE), LIMITS)
    assert names == ("T_world_lhand",)
    clean.validate()
    error = np.linalg.norm((clean.T_world_lhand - chunk.T_world_lhand)[:, :3, 3], axis=1)
    assert np.sqrt(np.mean(error**2)) < 0.8 * NOISE  # of sqrt(3) times as much
    assert acceleration(clean.T_world_lhand[:, :3, 3], chunk.fps) < LIMITS[0].position.acceleration
    assert clean.T_world_rhand is chunk.T_world_rhand
    np.testing.assert_array_equal(clean.T_world_lhand[:, :3, :3], chunk.T_world_lhand[:, :3, :3])


def test_orientations_and_fingers_are_taken_one_by_one():
    chunk = script()
    turned, names = smoothed_chunk(noisy(chunk, rotation=0.05), LIMITS)
    assert names == ("T_world_lhand",)
    turned.validate()
    np.testing.assert_array_equal(turned.T_world_lhand[:, :3, 3], chunk.T_world_lhand[:, :3, 3])
    assert angle_between(turned.T_world_lhand[:, :3, :3], chunk.T_world_lhand[:, :3, :3]).max() < 0.06
    closed, names = smoothed_chunk(noisy(chunk, finger=0.2), LIMITS)
    assert names == ("q_lhand",)
    assert np.abs(closed.q_lhand - chunk.q_lhand).max() < 0.2


@pytest.mark.parametrize("seed", range(5))
def test_orientations_drawn_from_all_there_are_come_to_rest_somewhere(seed):
    chunk = noisy(script(), seed=seed, rotation=2.0)
    clean, _ = smoothed_chunk(chunk, LIMITS)
    clean.validate()
    steps = angle_between(clean.T_world_lhand[1:, :3, :3], clean.T_world_lhand[:-1, :3, :3])
    assert np.median(steps) < 0.05


def test_a_straight_line_and_a_parabola_come_through_smoothing():
    t = np.linspace(0.0, 1.0, 50)[:, None]
    np.testing.assert_allclose(smooth(2.0 * t + 1.0), 2.0 * t + 1.0, atol=1e-9)
    np.testing.assert_allclose(smooth(t**2), t**2, atol=1e-3)


def test_white_noise_leaves_an_arc():
    rng = np.random.default_rng(0)
    for _ in range(50):
        arc = smooth(NOISE * rng.normal(size=(50, 3)))
        assert acceleration(arc, 50.0) < 4.0  # of 250
        assert np.linalg.norm(arc, axis=1).max() < 2.0 * NOISE


@pytest.mark.parametrize("scatter", [3e-4, 1e-3, 5e-3])
@pytest.mark.parametrize("fps", [30.0, 50.0])
def test_the_scatter_of_a_trained_policy_becomes_smaller_and_its_jerk_that_of_the_motion(scatter, fps):
    chunk = script(fps=fps)
    shaken = noisy(chunk, position=scatter)
    clean, names = smoothed_chunk(shaken, LIMITS)
    if fps == 30.0 and scatter < 5e-4:
        assert names == ()  # not worth it: 200 m/s^3
        return
    before, after = ((c.T_world_lhand - chunk.T_world_lhand)[:, :3, 3] for c in (shaken, clean))
    assert np.sqrt(np.mean(after**2)) < 0.7 * np.sqrt(np.mean(before**2))
    assert jerk(clean.T_world_lhand[:, :3, 3], fps) < 2.0 * jerk(chunk.T_world_lhand[:, :3, 3], fps)


@pytest.mark.parametrize("steps", [1, 2, 3, 4, 5, 6, 7])
def test_short_chunks_pass(steps):
    chunk = script()
    cut = {name: value[:steps] for name, value in noisy(chunk, position=0.5).arrays().items()}
    short = dataclasses.replace(chunk, **cut)
    smoothed_chunk(short, LIMITS)[0].validate()


def test_a_supervisor_follows_the_curve_and_says_so():
    plant = MujocoPlant(g1())
    supervisor = Supervisor(plant.spec, ControllerConfig(planning=PlanningConfig(lead=0.0)))
    state = plant.reset()
    supervisor.reset(state)
    policy = scripted_policy("wave")
    policy.fps = 50.0
    chunk = policy.infer(observe(plant.spec, supervisor, state))
    status = supervisor.accept(noisy(chunk, position=NOISE))
    assert status.status is Status.SLOWED
    assert status.reason == "noisy_chunk"
    assert "T_world_lhand" in status.detail
    assert supervisor.plan_report.slowdown == 1.0
    assert supervisor.plan_report.tracking_error.max() < 5e-3
