"""Strategy: random postures around the stance and anywhere; every pair measured afresh is the truth.

The set watched here is that of the trajectory optimiser; tests/wholebody/limits/test_self_collision.py takes all pairs.
"""

import numpy as np
import pinocchio as pin
import pytest

from models import g1
from models.pinocchio_model import stance_q
from tests.support.wide import wide
from wholebody.collision.proximity import Proximity, watched_pairs
from wholebody.errors import InputError
from wholebody.robot.state import Robot

TRIGGER = 0.05
POSTURES = (150, *wide(1000))


@pytest.fixture(scope="module")
def robot():
    return Robot(g1())


@pytest.fixture
def proximity(robot):
    return Proximity(robot.spec, robot.model, watched_pairs(), stance_q(robot.spec, robot.model), 0.012)


def postures(robot, count):
    rng = np.random.default_rng(3)
    low, high = (np.concatenate([np.full(7, side), limit[7:]]) for side, limit in limits(robot.model))
    pin.seed(3)
    stance = stance_q(robot.spec, robot.model)
    for i in range(count):
        near = pin.integrate(robot.model, stance, rng.normal(0.0, 0.15, robot.nv))
        yield near if i % 2 else pin.randomConfiguration(robot.model, low, high)


def limits(model):
    return ((-1.0, model.lowerPositionLimit), (1.0, model.upperPositionLimit))


def measured(proximity, robot, q):
    fresh, scratch = proximity.geometry.createData(), robot.model.createData()
    pin.computeDistances(robot.model, scratch, proximity.geometry, fresh, q)
    return np.array([result.min_distance for result in fresh.distanceResults])


@pytest.mark.parametrize("count", POSTURES)
def test_the_near_pairs_are_those_of_the_full_set(robot, proximity, count):
    for q in postures(robot, count):
        robot.update(q, np.zeros(robot.nv))
        proximity.update(q, robot.data, TRIGGER)
        near = proximity.near(TRIGGER)
        truth = measured(proximity, robot, q)
        edge = truth - proximity.margin - TRIGGER
        # A distance is known to the 1e-6 m of its algorithm.
        assert set(np.flatnonzero(edge < -2e-6)) <= set(near) <= set(np.flatnonzero(edge < 2e-6))
        np.testing.assert_allclose(proximity.distance[near], truth[near], atol=2e-6)


def test_small_steps_measure_few_pairs_and_stay_exact(robot, proximity):
    rng = np.random.default_rng(1)
    q = stance_q(robot.spec, robot.model)
    for _ in range(300):
        q = pin.integrate(robot.model, q, rng.normal(0.0, 0.01, robot.nv))
        robot.update(q, np.zeros(robot.nv))
        proximity.update(q, robot.data, TRIGGER)
    near, truth = proximity.near(TRIGGER), measured(proximity, robot, q)
    assert set(near) == set(np.flatnonzero(truth < proximity.margin + TRIGGER))


def test_rates_are_the_differences_of_the_distances(robot, proximity):
    rng, step, errors = np.random.default_rng(5), 1e-4, []
    for q in postures(robot, 60):
        v = rng.normal(0.0, 1.0, robot.nv)
        robot.update(q, v)
        proximity.update(q, robot.data, TRIGGER)
        near = proximity.near(TRIGGER)
        near = near[proximity.distance[near] > 2e-3]
        J, _ = proximity.rates(robot.data, near)
        ahead, behind = (measured(proximity, robot, pin.integrate(robot.model, q, s * v)) for s in (step, -step))
        errors.extend(np.abs((ahead - behind)[near] / (2.0 * step) - J @ v))
    # Where two faces are parallel the nearest points jump, so not every pair has a derivative.
    assert np.percentile(errors, 90) < 0.05


def test_the_bounds_of_pairs_that_were_not_measured_are_never_above_their_distance(robot, proximity):
    rng = np.random.default_rng(2)
    q = stance_q(robot.spec, robot.model)
    for _ in range(100):
        q = pin.integrate(robot.model, q, rng.normal(0.0, 0.02, robot.nv))
        robot.update(q, np.zeros(robot.nv))
        proximity.update(q, robot.data, TRIGGER)
        assert (proximity.bound <= measured(proximity, robot, q) + 2e-6).all()


def test_moving_the_base_makes_no_pair_unknown(robot, proximity):
    q = stance_q(robot.spec, robot.model)
    before = proximity.bound.copy()
    q[:3] += 1.0
    robot.update(q, np.zeros(robot.nv))
    proximity.update(q, robot.data, TRIGGER)
    np.testing.assert_allclose(proximity.bound, before, atol=2e-6)


def test_a_pair_without_a_distance_is_refused_by_name(robot):
    with pytest.raises(InputError, match="tail_link"):
        Proximity(robot.spec, robot.model, [("torso_link", "tail_link")], stance_q(robot.spec, robot.model), 0.01)
