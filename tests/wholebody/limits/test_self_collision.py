"""Strategy: every pair of the robot measured afresh is the truth for selection; differences are it for the rows.

The closed loop drives hands at the trunk and at each other with the program alone, without a planner in the way.
"""

import numpy as np
import pinocchio as pin
import pytest

from models import g1
from models.pinocchio_model import stance_q
from tests.support.body_cases import point_acceleration, postures, upright
from tests.support.wide import wide
from wholebody.collision.proximity import Proximity
from wholebody.control.controller import WholeBodyController
from wholebody.limits.self_collision import SelfCollisionLimit
from wholebody.robot.state import Robot
from wholebody.sim.plant import MujocoPlant

POSTURES, LEAST, TRIGGER = (150, *wide(1000)), 10, 0.05
# Distances are known to the 1e-6 m of their algorithm.
TOLERANCE = 2e-6


@pytest.fixture(scope="module")
def robot():
    return Robot(g1())


@pytest.fixture
def proximity(robot):
    return Proximity(robot.spec, robot.model, None, stance_q(robot.spec, robot.model), 0.008)


@pytest.fixture(scope="module")
def scratch(robot):
    proximity = Proximity(robot.spec, robot.model, None, stance_q(robot.spec, robot.model), 0.008)
    data = robot.model.createData()

    def distances(q):
        pin.computeDistances(robot.model, data, proximity.geometry, proximity.data, q)
        return np.array([result.min_distance for result in proximity.data.distanceResults])

    return distances


@pytest.mark.parametrize("count", POSTURES)
def test_the_nearest_pairs_are_those_of_the_full_set(robot, proximity, scratch, count):
    for q in postures(robot, count):
        robot.update(q, np.zeros(robot.nv))
        proximity.update(q, robot.data, TRIGGER, LEAST)
        near = proximity.near(TRIGGER, None, LEAST)
        truth = scratch(q)
        room = np.sort(truth - proximity.margin)
        np.testing.assert_allclose(proximity.distance[near], truth[near], atol=TOLERANCE)
        np.testing.assert_allclose((truth - proximity.margin)[near], room[: len(near)], atol=TOLERANCE)
        inside = int((room < TRIGGER - TOLERANCE).sum()), int((room < TRIGGER + TOLERANCE).sum())
        assert max(inside[0], LEAST) <= len(near) <= max(inside[1], LEAST)


def test_small_steps_keep_the_nearest_pairs_exact_and_measure_few(robot, proximity, scratch, monkeypatch):
    rng, measured = np.random.default_rng(1), []
    compute = pin.computeDistance
    monkeypatch.setattr(pin, "computeDistance", lambda *args: measured.append(args[2]) or compute(*args))
    q, step = stance_q(robot.spec, robot.model), rng.normal(0.0, 0.003, robot.nv)
    for i in range(400):
        if i % 40 == 0:
            step = rng.normal(0.0, 0.003, robot.nv)
        q = pin.integrate(robot.model, q, step)
        robot.update(q, np.zeros(robot.nv))
        proximity.update(q, robot.data, TRIGGER, LEAST)
        if i % 20 == 0:
            near, room = proximity.near(TRIGGER, None, LEAST), scratch(q) - proximity.margin
            np.testing.assert_allclose(room[near], np.sort(room)[: len(near)], atol=TOLERANCE)
    # 1.5 rad/s in every joint; the full set is 1159 pairs a step.
    assert len(measured) / 400 < 60


def test_the_jacobian_is_the_difference_of_the_distances(robot, proximity, scratch):
    rng, step, errors = np.random.default_rng(5), 1e-5, []
    for q in postures(robot, 100):
        v = rng.normal(0.0, 1.0, robot.nv)
        robot.update(q, v)
        proximity.update(q, robot.data, TRIGGER, LEAST)
        near = proximity.near(TRIGGER, None, LEAST)
        near = near[proximity.distance[near] > 2e-3]
        J, _ = proximity.rates(robot.data, near)
        ahead, behind = (scratch(pin.integrate(robot.model, q, s * v)) for s in (step, -step))
        errors.extend(np.abs((ahead - behind)[near] / (2.0 * step) - J @ v))
    # Where two faces or edges are parallel the nearest points jump, so a few pairs have no derivative.
    assert len(errors) > 900
    assert np.median(errors) < 1e-3
    assert np.percentile(errors, 90) < 2e-2


def test_the_drift_is_the_change_of_the_rate_along_the_fixed_direction(robot, proximity):
    rng, step = np.random.default_rng(6), 1e-6
    for q in postures(robot, 20):
        v = rng.normal(0.0, 1.0, robot.nv)
        robot.update(q, v)
        proximity.update(q, robot.data, TRIGGER, LEAST)
        near = proximity.near(TRIGGER, None, LEAST)
        _, drift = proximity.rates(robot.data, near, v)
        expected = np.zeros(len(near))
        for row, k in enumerate(near.tolist()):
            result = proximity.data.distanceResults[k]
            points = (result.getNearestPoint1(), result.getNearestPoint2())
            shapes = (proximity.geometry.geometryObjects[int(i)] for i in proximity.pairs[k])
            for sign, shape, point in zip((-1.0, 1.0), shapes, points, strict=True):
                local = robot.data.oMi[shape.parentJoint].actInv(point)
                expected[row] += sign * result.normal @ point_acceleration(robot, shape.parentJoint, local, q, v, step)
        np.testing.assert_allclose(drift, expected, atol=1e-3)


def test_there_is_one_named_row_for_each_near_pair_nearest_first(robot, proximity, scratch):
    limit = SelfCollisionLimit(proximity, trigger=TRIGGER, brake=10.0, least=LEAST, most=14)
    robot.update(stance_q(robot.spec, robot.model), np.zeros(robot.nv))
    rows = limit.rows(robot)
    room = scratch(robot.q) - proximity.margin
    assert len(rows.upper) == min(14, max(LEAST, int((room < TRIGGER).sum()))) == len(rows.labels)
    assert rows.labels[0] == proximity.labels[int(np.argmin(room))]
    assert np.isfinite(rows.J).all()
    assert (rows.upper >= -1e-9).all()


@pytest.fixture(scope="module")
def plant(robot):
    return MujocoPlant(robot.spec)


def driven(plant, targets, seconds=2.5):
    """Closed loop of the program alone: palms drawn to world targets (2, 3) [m]; least distance [m] and contacts."""
    controller = WholeBodyController(plant.spec)
    state = plant.reset()
    controller.reset(state)
    start = [controller.robot.pose(tool.palm_frame).copy() for tool in plant.spec.tools]
    proximity, least, contacts, fallbacks = controller.self_collision.proximity, np.inf, set(), 0
    while state.time < seconds:
        share = min(state.time / 0.6, 1.0)
        poses = [
            pin.SE3(T.rotation, T.translation + share * (goal - T.translation))
            for T, goal in zip(start, targets, strict=True)
        ]
        command, report = controller.step(state, upright(controller, poses))
        state = plant.step(command)
        fallbacks += report.level > 0
        contacts |= {tuple(pair) for pair in plant.contacts()}
        least = min(least, float(proximity.bound.min()))
    reached = [controller.robot.pose(tool.palm_frame).translation.copy() for tool in plant.spec.tools]
    return least, contacts, fallbacks, reached, state


@pytest.mark.parametrize(
    ("where", "targets"),
    [
        ("into the trunk", [[-0.04, 0.0, 0.95], [-0.04, 0.0, 0.85]]),
        ("through each other", [[0.25, -0.10, 0.95], [0.25, 0.10, 0.95]]),
        ("into the thighs", [[0.02, 0.12, 0.60], [0.02, -0.12, 0.60]]),
        ("into the head", [[0.03, 0.0, 1.25], [0.03, 0.0, 1.25]]),
    ],
)
def test_hands_driven_into_the_body_stop_without_contact(plant, where, targets):
    targets = np.array(targets)
    least, contacts, fallbacks, reached, state = driven(plant, targets)
    assert not contacts, f"{where}: {contacts}"
    # 8 mm is asked for; some of it goes to the position loops of the wrists, which pull with all they have.
    assert least > 0.002
    assert fallbacks == 0
    assert state.q[2] > 0.7
    assert any(np.linalg.norm(p - goal) > 0.02 for p, goal in zip(reached, targets, strict=True))
    assert np.abs(state.v[6:]).max() < 1.0
