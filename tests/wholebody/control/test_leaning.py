"""Strategy: the lean against forces by what it is for, and a whole run in MuJoCo whose hand is pulled and let go of."""

import numpy as np
import pytest

from models import g1
from policy.scripted.waypoints import Waypoint, waypoint_policy
from tests.support.felt import Run, still_force
from wholebody.config.touch import TouchConfig
from wholebody.control.asked_forces import AskedForces
from wholebody.control.leaning import BRACED, Leaning
from wholebody.execution.supervisor import Supervisor
from wholebody.robot.touch import FORCE, LEAN_MAX, SHARE, TOUCH
from wholebody.sim.plant import MujocoPlant

SPEC = g1()
AHEAD = np.array([1.0, 0.0, 0.0])


@pytest.fixture(scope="module")
def controller():
    supervisor = Supervisor(SPEC)
    state = MujocoPlant(SPEC).state()
    supervisor.reset(state)
    supervisor.step(state)
    return supervisor.controller


def lean(controller, force, told=(0.0, 0.0, 0.0), counted=(0.0, 0.0, 0.0)):
    """How far the body is told to lean, and how far the force is taken to move the centre of pressure [m]."""
    leaning, rows = Leaning(controller), np.zeros((2, TOUCH))
    asked = AskedForces(TouchConfig(), rows)
    rows[0, FORCE : FORCE + 3], rows[0, SHARE], asked.forces[0] = force, float(np.any(force)), told
    asked.counted[0] = counted
    for _ in range(50):
        leaning.advance(rows, asked, controller.robot.com[:2].copy(), 0.0, 0.02)
    found = controller.lean.copy(), controller.tipped.copy()
    leaning.reset()
    assert leaning.settled
    assert not controller.lean.any()
    return found


def room(controller, direction):
    """Distance of the centre of mass from the edge of the support along an axis [m]."""
    support = controller.support
    edge = int((support.normals @ direction).argmax())
    return float(support.offsets[edge] - support.normals[edge] @ controller.robot.com[:2])


def test_the_body_leans_half_of_the_way_to_the_other_edge_and_is_told_twice_of_it_while_it_does_not(controller):
    told, tipped = lean(controller, 35.0 * AHEAD)
    assert tipped[0] > room(controller, AHEAD[:2])
    half = 0.5 * room(controller, -AHEAD[:2])
    np.testing.assert_allclose(told, [-2.0 * half, 0.0], atol=0.05 * half)
    assert half >= LEAN_MAX


def test_the_body_leans_most_where_a_force_brings_an_edge_near(controller):
    """Feet are further apart than soles are long: a little force aside is nothing to lean against."""
    (x, y), tipped = lean(controller, np.array([10.0, 10.0, 0.0]))
    assert tipped[1] == pytest.approx(tipped[0], rel=0.2)
    assert x < 1.5 * y < 0.0


def test_the_body_leans_aside_too_where_a_force_takes_a_foot_its_load(controller):
    """One sole alone did not hold what turns the robot: at 46 N, 45 degrees back and aside, it fell."""
    (x, y), _ = lean(controller, np.array([-30.0, 30.0, 0.0]))
    assert y < -0.9 * x < 0.0


def test_a_force_that_leads_a_hand_away_and_brings_an_edge_near_braces_the_centre_of_mass(controller):
    """Two hands that pushed on a wall, which led neither away, were pushed on with 121 N instead of 31."""
    braced = []
    for size, drawn in ((10.0, 1.0), (35.0, 1.0), (35.0, 0.0)):
        leaning, rows = Leaning(controller), np.zeros((2, TOUCH))
        rows[0, FORCE : FORCE + 3], rows[0, SHARE] = size * AHEAD, 1.0
        for _ in range(50):
            leaning.advance(rows, AskedForces(TouchConfig(), rows), controller.robot.com[:2].copy(), drawn, 0.02)
        braced.append(float(controller.braced[0]))
        leaning.reset()
    assert braced[1] == BRACED
    assert 0.2 * BRACED < braced[0] < 0.5 * BRACED
    assert braced[2] == 0.0
    assert not controller.braced.any()


def test_before_a_force_is_felt_that_is_told_the_body_leans_half_of_the_way(controller):
    felt, told = lean(controller, 10.0 * AHEAD)[1], lean(controller, np.zeros(3), 10.0 * AHEAD)[1]
    assert told[0] == pytest.approx(0.5 * felt[0], rel=0.01)


def test_against_what_the_plan_counts_on_the_body_does_not_lean_once_more(controller):
    (x, _), tipped = lean(controller, 20.0 * AHEAD, 20.0 * AHEAD, counted=20.0 * AHEAD)
    assert abs(x) < 1e-6
    assert tipped[0] == pytest.approx(lean(controller, 20.0 * AHEAD)[1][0])
    (x, _), _ = lean(controller, 20.0 * AHEAD, 20.0 * AHEAD, counted=10.0 * AHEAD)
    assert lean(controller, 20.0 * AHEAD)[0][0] < x < 0.0


def test_a_pull_beyond_what_statics_allow_is_stood_and_let_go_of():
    """The hand was drawn to the end of its arm and took the body along; it fell at 1.1 times what statics allow."""
    left, allowed = np.array([0.26, 0.20, 0.86]), []
    policy = waypoint_policy("still", [Waypoint(1.0, left, left * [1.0, -1.0, 1.0]), Waypoint(8.0)])

    def force(time, q):
        if not allowed and time >= 2.0:
            allowed.append(still_force(q, "right", AHEAD, 0.8))
        return AHEAD * 1.15 * allowed[0] * min((time - 2.0) / 2.0, 1.0) if 2.0 <= time < 6.0 else np.zeros(3)

    run = Run(policy, "floor", pull=("right", force), hold=0.5)
    assert allowed[0] > 30.0
    assert run.result.fall is None
    assert run.told()["off_plan_s"] == 0.0
    assert run.errors[run.times < 6.0, 1].max() < 0.15
    assert run.errors[-1].max() < 0.005


def pulled_ahead(direction):
    """A hand far ahead, pulled along a direction by 1.15 times what statics allow, and that force [N]."""
    left, allowed, pulled = np.array([0.42, 0.18, 1.05]), [], (2.5, 6.0, 7.5)
    policy = waypoint_policy("ahead", [Waypoint(1.5, left, left * [1.0, -1.0, 1.0]), Waypoint(9.0)])

    def force(time, q):
        if not allowed and time >= pulled[0]:
            allowed.append(still_force(q, "left", direction, 0.8))
        size = 1.15 * np.interp(time, pulled, (0.0, *allowed, *allowed), right=0.0) if allowed else 0.0
        return direction * size

    return Run(policy, "floor", pull=("left", force), hold=0.5), allowed[0]


def test_a_pull_along_an_arm_that_it_does_not_feel_is_leant_against():
    """Found from the floor: the centre of pressure went to the edge of the soles, nobody knew, and it fell at 1.05."""
    run, allowed = pulled_ahead(AHEAD)
    assert allowed > 20.0
    assert run.result.fall is None
    assert run.errors[(run.times > 2.5) & (run.times < 7.5)].max() < 0.06
    assert run.errors[-1].max() < 0.005
    assert run.result.reasons["touching"] > 1.0


@pytest.mark.regression
@pytest.mark.parametrize("direction", [(-1.0, 1.0, 0.0), (1.0, 1.0, 0.0)])
def test_a_pull_aside_at_a_hand_far_ahead_is_stood_and_let_go_of(direction):
    """Ahead, a hand that yielded at its arm's end took the body along; back, a foot without load slid round."""
    run, allowed = pulled_ahead(np.array(direction) / np.sqrt(2.0))
    assert allowed > 30.0
    assert run.result.fall is None
    assert run.errors[(run.times > 2.5) & (run.times < 7.5)].max() < 0.2
    assert run.errors[-1].max() < 0.005
