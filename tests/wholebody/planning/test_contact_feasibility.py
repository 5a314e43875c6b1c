"""Oracle: the nearest point of the cone by non-negative least squares; plans whose dynamics are known by hand."""

import numpy as np
import pytest
from scipy.optimize import nnls

from models import g1
from models.pinocchio_model import stance_q
from wholebody.config import ControllerConfig, TrajectoryConfig
from wholebody.planning.contact_feasibility import EDGE_MARGIN, RECOVERY_TIME, ContactFeasibility
from wholebody.planning.trajectory import SampledTrajectory
from wholebody.robot.state import Robot
from wholebody.trajopt.robot_tables import RobotTables

ROWS = 500
"""Of a track: a second."""


@pytest.fixture(scope="module")
def body():
    return RobotTables(g1(), TrajectoryConfig())


@pytest.fixture(scope="module")
def balance(body):
    return ContactFeasibility(body, ControllerConfig().friction)


@pytest.fixture(scope="module")
def still():
    spec = g1()
    robot = Robot(spec)
    q = stance_q(spec, robot.model)
    robot.update(q, np.zeros(robot.nv))
    return SampledTrajectory.still(robot, q)


def swinging(still, *, yaw=0.0, ahead=0.0, seconds=1.0):
    """The stance as a track that asks for a moment about the vertical [N m], and accelerates to the left [m/s^2]."""
    com, momentum = (np.repeat(x, ROWS, axis=1) for x in (still.com, still.momentum))
    rows = slice(0, round(seconds * ROWS))
    momentum[1, rows, 2], com[2, rows, 1] = yaw, ahead
    return SampledTrajectory(0.0, still.q, still.v, still.ddq, com, momentum, still.height, still.pelvis, still.torso)


def test_distances_to_the_cone_are_those_of_the_nearest_point(balance):
    rng, generators = np.random.default_rng(0), balance._generators.T
    wrenches = balance._middle + rng.normal(size=(100, 5)) * [0.3, 0.3, 1.0, 1.0, 0.5]
    outside = 0
    for wrench in wrenches:
        share = nnls(np.vstack([generators, np.full(generators.shape[1], 1e4)]), np.append(wrench, 1e4))[0]
        expected = np.linalg.norm(generators @ share - wrench)
        outside += expected > 1e-6
        assert balance._distance(wrench) == pytest.approx(expected, abs=1e-5)
    assert 20 < outside < 100


def test_all_of_the_box_that_is_not_looked_at_can_be_had(balance):
    wrenches = balance._middle + np.random.default_rng(1).uniform(-1.0, 1.0, (200, 5)) * balance._box
    assert max(balance._distance(wrench) for wrench in wrenches) == 0.0


def test_what_is_said_to_be_had_at_once_can_be_had_and_of_that_most_is_found(balance):
    wrenches = balance._middle + np.random.default_rng(2).normal(size=(300, 5)) * [0.15, 0.15, 0.4, 0.4, 0.2]
    had = np.array([balance._distance(wrench) == 0.0 for wrench in wrenches])
    found = balance._can_be_had(wrenches)
    assert not (found & ~had).any()
    assert found.sum() > 0.9 * had.sum() > 0.0


def test_standing_still_lacks_nothing(balance, still):
    assert balance.friction_impulse_deficit(still, 1.0) == 0.0
    assert balance.capture_point_drift(still, 1.0) == 0.0


@pytest.mark.parametrize("flag", [-2, -3, -4, -5], ids=["cycling", "unbounded", "iteration limit", "nonconvex"])
def test_a_wrench_that_the_solver_has_no_answer_on_is_not_in_the_cone(balance, still, monkeypatch, flag):
    monkeypatch.setattr("wholebody.planning.contact_feasibility.daqp.solve", lambda *_: (np.zeros(5), 0.0, flag, {}))
    assert balance._distance(balance._middle) == np.inf
    assert balance.friction_impulse_deficit(swinging(still, yaw=0.25 * 9.81 * 34.0), 1.0) == np.inf


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_plan_that_is_not_finite_is_not_balanced(balance, still, value):
    for track in (swinging(still, yaw=value), swinging(still, ahead=value, seconds=0.01)):
        assert balance.friction_impulse_deficit(track, 1.0) == np.inf
    assert balance.capture_point_drift(swinging(still, ahead=value), 1.0) == np.inf


def test_a_moment_about_the_vertical_slips_past_what_friction_gives_and_not_before(balance, body, still):
    # Feet 0.238 m apart turn against each other, and each about itself: more than with the outer lever alone.
    face, weight = ControllerConfig().friction / np.sqrt(2.0), 9.81 * body.mass
    assert balance.friction_impulse_deficit(swinging(still, yaw=0.08 * face * weight), 1.0) == 0.0
    assert balance.friction_impulse_deficit(swinging(still, yaw=0.25 * face * weight), 1.0) > 0.05


def test_with_the_pressure_under_one_foot_there_is_less_friction_to_turn(balance, body, still):
    height = still.com[0, 0, 2]
    moment, aside = 0.08 * ControllerConfig().friction * 9.81 * body.mass, -0.11 / height * 9.81
    assert balance.friction_impulse_deficit(swinging(still, yaw=moment), 1.0) == 0.0
    assert balance.friction_impulse_deficit(swinging(still, yaw=moment, ahead=aside), 1.0) > 0.05


def test_slower_needs_less_and_what_is_missing_long_ago_is_forgotten(balance, body, still):
    moment = 0.25 * 9.81 * body.mass
    assert balance.friction_impulse_deficit(swinging(still, yaw=moment), 4.0) == 0.0
    short, long, longer = (
        balance.friction_impulse_deficit(swinging(still, yaw=moment, seconds=x), 1.0) for x in (0.02, 0.04, 1.0)
    )
    assert long == pytest.approx(2.0 * short, rel=0.15)
    assert longer == pytest.approx(short / 0.02 * RECOVERY_TIME, rel=0.1)


def test_while_the_pressure_is_at_the_edge_the_capture_point_runs_away_like_a_pendulum(balance, body, still):
    height, aside, seconds = still.com[0, 0, 2], 0.16, 0.1
    track = swinging(still, ahead=-aside / height * 9.81, seconds=seconds)
    outside = (
        aside
        + still.com[0, 0, 1]
        - (body.footing.pressure_offsets[np.argmax(body.footing.support.normals[:, 1])] - EDGE_MARGIN)
    )
    grown = np.exp(np.sqrt(9.81 / height) * seconds) - 1.0
    assert balance.capture_point_drift(track, 1.0) == pytest.approx(outside * grown, rel=0.02)


def test_a_centre_of_mass_below_the_floor_is_no_reason_to_find_a_plan_balanced(balance, still):
    """Its pendulum has no frequency: the drift was not a number, and counted as none."""
    track = swinging(still, ahead=-3.0, seconds=0.1)
    track.com[0, :, 2] = -0.1
    track.com[0, :, 0] += 0.3
    assert balance.capture_point_drift(track, 1.0) > 0.1
