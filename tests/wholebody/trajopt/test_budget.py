"""Strategy: hostile chunks of every family, planned from the stance with budgets far below the default."""

from time import thread_time

import numpy as np
import pytest

from models import g1
from models.pinocchio_model import stance_q
from policy.chunk import ActionChunk
from tests.support.hostile_chunks import FAMILIES, hostile_chunk
from wholebody.config import ControllerConfig, PlanningConfig
from wholebody.planning.chunk_planner import ChunkPlanner
from wholebody.planning.trajectory import BodyState
from wholebody.reference import HandMotion, rest_row
from wholebody.robot.state import Robot
from wholebody.trajopt.budget import KNOTS, SEARCH_MAX, Budget

SPEC = g1()
HOSTILE = [kind for kind in FAMILIES if kind != "nan"]


@pytest.fixture(scope="module")
def robot():
    return Robot(SPEC)


@pytest.fixture(scope="module")
def rest(robot):
    """The stance, and what the hands do there."""
    q = stance_q(SPEC, robot.model)
    robot.update(q, np.zeros(robot.nv))
    joints = np.array(SPEC.stance.joint_positions)
    rows = [rest_row(robot.pose(x.wrist_frame).homogeneous, joints[SPEC.indices(x.finger_joints)]) for x in SPEC.tools]
    return BodyState.still(q, robot.nv), HandMotion(np.array(rows))


def planner(robot, budget):
    return ChunkPlanner(SPEC, robot, ControllerConfig(planning=PlanningConfig(budget=budget)))


def plan_of(one, rest, kind, seed, cpu_limit=np.inf):
    return one.plan(hostile_chunk(kind, np.random.default_rng(seed), 0, 0.0), 0.0, *rest, cpu_limit=cpu_limit)


def test_work_counts_by_knots_and_what_is_kept_is_not_left():
    budget = Budget(10.0)
    budget.kept = 0.2
    budget.count(2 * KNOTS)
    assert budget.allows(0.6)
    assert not budget.allows(0.61)
    budget.begin_search(KNOTS)
    assert budget.affords(6 * KNOTS)
    assert not budget.affords(7 * KNOTS)
    budget.count(3 * KNOTS)
    assert not budget.half_spent
    budget.count(1)
    assert budget.half_spent
    assert not budget.timed_out


def test_one_search_takes_only_so_much():
    budget = Budget()
    assert budget.affords(int(SEARCH_MAX) * KNOTS)
    assert not budget.affords(int(SEARCH_MAX + 1) * KNOTS)


def test_a_search_of_twice_the_knots_may_take_as_many_steps():
    budget = Budget()
    budget.begin_search(2 * KNOTS)
    assert budget.affords(int(SEARCH_MAX) * 2 * KNOTS)
    assert not budget.affords(int(SEARCH_MAX + 1) * 2 * KNOTS)


def test_what_the_start_breaks_is_not_tried_at_other_speeds_and_with_other_hands(robot, rest, monkeypatch):
    """Sixteen attempts were made, all of which broke the same bound at the first knot by as much."""
    one, tried = planner(robot, 1e4), []
    attempt = one._attempt

    def spied(targets, start, strategy, *rest):
        tried.append(strategy.name)
        return attempt(targets, start, strategy, *rest)

    monkeypatch.setattr(one, "_attempt", spied)
    start, hands = rest
    v = np.zeros(robot.nv)
    v[6 + robot.joint_names.index("waist_pitch_joint")] = 12.0
    report = one.plan(hostile_chunk("walk", np.random.default_rng(3), 0, 0.0), 0.0, BodyState(start.q, v), hands).report
    assert not report.safe
    assert tried[0] == "as_given"
    assert set(tried[1:]) <= {"fallback", "stop"}


def test_palms_are_not_turned_for_what_they_are_off_where_the_plan_begins(robot, rest, monkeypatch):
    """Three searches were made: no plan changes where it begins."""
    one, made = planner(robot, 160.0), []
    attempt = one._attempt
    monkeypatch.setattr(one, "_attempt", lambda *arguments: made.append(attempt(*arguments)) or made[-1])
    q, (still, hands) = rest[0].q.copy(), rest
    q[robot.model.idx_qs[robot.model.getJointId("left_elbow_joint")]] += 0.08
    T = [hands.T_world_hand[i][None].repeat(30, axis=0) for i in (0, 1)]
    chunk = ActionChunk("", 0, 0.0, 30.0, *T, *(x[None].repeat(30, axis=0) for x in hands.q_finger))
    one.plan(chunk, 0.0, BodyState.still(q, len(still.v)), hands)
    assert made[0].start_error > one.config.relax_error
    assert made[0].tracking_error == made[0].start_error
    assert len(made) == 1


def test_time_counts_where_it_is_limited():
    budget, begin = Budget(seconds=0.02), thread_time()
    assert budget.affords(KNOTS)
    while thread_time() - begin < 0.021:
        pass
    assert budget.half_spent
    assert not budget.timed_out
    assert not budget.affords(KNOTS)
    assert not budget.allows(0.0)
    assert budget.timed_out


@pytest.mark.parametrize("kind", HOSTILE)
def test_no_chunk_takes_more_than_the_budget(robot, rest, kind):
    report = plan_of(planner(robot, 25.0), rest, kind, seed=3).report
    assert 0.0 < report.work <= 25.0


@pytest.mark.parametrize("kind", ["box", "floor", "straight"])
def test_a_plan_that_the_budget_ends_is_the_same_again_and_judged_as_any_other(robot, rest, kind):
    one = planner(robot, 40.0)
    first, again = plan_of(one, rest, kind, 3), plan_of(planner(robot, 40.0), rest, kind, 3)
    np.testing.assert_array_equal(first.trajectory.q, again.trajectory.q)
    assert first.report.work == again.report.work
    drift = one.balance.capture_point_drift(first.trajectory, first.report.slowdown)
    if first.report.safe:
        assert drift <= one.config.capture_point_drift_max
        assert first.report.violation <= one.config.violation_max


@pytest.mark.parametrize("kind", ["box", "floor", "straight"])
def test_within_a_limit_on_cpu_time_a_plan_comes_in_time(robot, rest, kind):
    one = planner(robot, 1e4)
    plan_of(one, rest, kind, 3, cpu_limit=1e-3)  # compiles, makes room
    begin = thread_time()
    plan_of(one, rest, kind, 3)
    limit = 0.5 * (thread_time() - begin)
    begin = thread_time()
    plan = plan_of(one, rest, kind, 3, cpu_limit=limit)
    assert thread_time() - begin <= 1.1 * limit
    assert plan.report.timed_out
