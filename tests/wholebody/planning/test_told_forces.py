"""Strategy: plans of still hands that are told of a force, beside the same without; what enters is held elsewhere.

That the dynamics have the force right is `test_optimizer`'s, what a verdict says of it `test_hand_force`'s.
"""

from dataclasses import replace

import numpy as np
import pytest

from models import g1
from models.pinocchio_model import stance_q
from policy.action_spec.builtin import builtin
from policy.scripted.policy import stance_pose, to_chunk
from wholebody.config import ControllerConfig
from wholebody.execution.standing import hands_at_rest
from wholebody.planning.chunk_planner import ChunkPlanner
from wholebody.planning.trajectory import LEAN_TIME, BodyState
from wholebody.reference import HandMotion
from wholebody.robot.state import Robot

SPEC, STEPS = g1(), 50


@pytest.fixture(scope="module")
def planner():
    return ChunkPlanner(SPEC, Robot(SPEC), ControllerConfig())


def plan(planner, force, pushes=None, ahead=0.0):
    """Both palms held for 1.7 s, the left one told of a force [N]; begun by a body that counts on some, (6,) [N]."""
    robot = Robot(SPEC)
    q = stance_q(SPEC, robot.model)
    robot.update(q, np.zeros(robot.nv))
    left = robot.pose(SPEC.tools[0].palm_frame).translation + np.array([ahead, 0.0, 0.0])
    palms = {"p_world_lpalm": np.tile(left, (STEPS, 1)), "p_world_rpalm": np.tile(left * [1.0, -1.0, 1.0], (STEPS, 1))}
    motion = replace(stance_pose(), **palms, f_world_lpalm=np.tile(np.array(force), (STEPS, 1)))
    chunk = to_chunk(motion, builtin("wbc32").id, 0, 0.0, 25.0, STEPS)
    start = BodyState.still(q, robot.nv) if pushes is None else replace(BodyState.still(q, robot.nv), pushes=pushes)
    return planner.plan(chunk, 0.0, start, HandMotion(hands_at_rest(robot, q)))


def test_a_plan_leans_against_a_force_that_is_told_until_it_is_balanced_with_a_third_more(planner):
    free, told = plan(planner, [0.0, 0.0, 0.0]), plan(planner, [25.0, 0.0, 0.0])
    assert free.knots.pushes is None
    assert told.report.safe
    assert told.report.tracking_error.max() < 1e-3
    leant = free.trajectory.com[0, -1, 0] - told.trajectory.com[0, -1, 0]
    # What 25 N move the centre of pressure by.
    moved = 25.0 * told.knots.T_palms[-1, 0, 2, 3] / (9.81 * planner.optimizer.body.mass)
    assert 0.01 < leant < 0.042
    assert told.knots.zmp[-1, 0] == pytest.approx(told.trajectory.com[0, -1, 0] + moved, abs=2e-3)
    assert planner.optimizer.body.footing.support.margin(told.knots.zmp[-1] + [moved / 3.0, 0.0]) > 0.015


def test_nobody_leans_at_once(planner):
    """The force is counted on little by little; at once where the plan before did."""
    anew, on = plan(planner, [20.0, 0.0, 0.0]), plan(planner, [20.0, 0.0, 0.0], np.array([20.0, 0, 0, 0, 0, 0]))
    assert not anew.pushes_at(0.0).any()
    assert on.pushes_at(0.0)[0] == 20.0
    assert anew.pushes_at(LEAN_TIME + 0.1)[0] == on.pushes_at(LEAN_TIME + 0.1)[0] == 20.0
    assert anew.pushes_at(0.5 * LEAN_TIME)[0] == pytest.approx(10.0, abs=1.0)


def test_what_no_body_leans_against_is_counted_on_in_part_and_where_hands_are_not_in_place_not_at_all(planner):
    pulled, away = plan(planner, [60.0, 0.0, 0.0]), plan(planner, [25.0, 0.0, 0.0], ahead=0.6)
    assert 25.0 < pulled.pushes_at(1.5)[0] < 45.0
    assert pulled.report.safe
    assert pulled.report.tracking_error.max() < 1e-3
    assert away.report.tracking_error.max() > 0.1
    assert away.knots.pushes is None
