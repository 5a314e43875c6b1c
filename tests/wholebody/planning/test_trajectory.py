"""Strategy: a curve that stays, between times whose sums round either way; how many rows it gets is known."""

import numpy as np
import pinocchio as pin
import pytest

from models import g1
from models.pinocchio_model import stance_q
from wholebody.planning.trajectory import GRID, _states, centroidal_along, curve_through, track_along
from wholebody.robot.state import Robot
from wholebody.trajopt.centroidal import Centroidal


@pytest.fixture(scope="module")
def robot():
    return Robot(g1())


@pytest.mark.parametrize("start", [0.0, 5.068, 5.11])
@pytest.mark.parametrize("duration", [0.006, 0.25, 2.95])
def test_a_trajectory_has_a_row_a_tick_whatever_the_rounding_of_its_times(robot, start, duration):
    spec, end = g1(), start + duration
    q = stance_q(spec, robot.model)
    momenta = Centroidal(spec, robot.model, [robot.frame_id(x) for x in (spec.base_body, spec.torso_body)])
    curve = curve_through(np.array([start, end]), np.array([q, q]), np.zeros(robot.nv))
    track = track_along(curve, centroidal_along(curve, start, end, momenta))
    assert len(track.q) == track.com.shape[1] == len(track.pelvis[1]) == len(np.arange(start, end + GRID, GRID))
    np.testing.assert_allclose(track.q, np.tile(q, (len(track.q), 1)), atol=1e-9)


def test_states_along_a_curve_are_the_splines_and_velocities_lead_from_one_to_the_next(robot):
    rng, q = np.random.default_rng(0), stance_q(g1(), robot.model)
    q = np.array([pin.integrate(robot.model, q, 0.3 * rng.normal(size=robot.nv)) for _ in range(8)])
    curve, step = curve_through(0.1 * np.arange(8.0), q, rng.normal(size=robot.nv)), 1e-6
    s = np.linspace(0.0, 0.75, 40)
    states, v, dq, ddq = _states(curve, s)
    value, *derivatives = curve(s)
    value[:, 3:7] /= np.linalg.norm(value[:, 3:7], axis=1, keepdims=True)
    for got, expected in zip((states, dq, ddq), (value, *derivatives), strict=True):
        np.testing.assert_allclose(got, expected, rtol=1e-13, atol=1e-13)
    after = [pin.difference(robot.model, a, b) / step for a, b in zip(states, _states(curve, s + step)[0], strict=True)]
    np.testing.assert_allclose(v, after, atol=1e-3)
