"""Strategy: 2 kg in each hand at places where statics say how near to them a still robot holds it."""

import numpy as np
import pytest

from policy.chunk import ActionChunk
from policy.scripted.policy import stance_pose
from tests.support.carried import SPEC
from wholebody.config import ControllerConfig
from wholebody.planning.chunk_planner import ChunkPlanner
from wholebody.planning.reachability.holdable import HoldablePlaces, arms_spent
from wholebody.planning.trajectory import BodyState
from wholebody.reference import HandMotion, rest_row
from wholebody.robot.hand_loads import Loads
from wholebody.robot.state import Robot
from wholebody.trajopt.budget import Budget

STANCE = stance_pose()
HEAVY = Loads((2.0, 2.0))
STATICS = {(0.40, 0.30): 0.086, (0.45, 0.60): 0.097, (0.50, 1.00): 0.091, (0.40, 1.40): 0.039}
"""How far off a still robot holds 2 kg in each hand by `benchmarks/statics.py --loads 2` [m]."""


@pytest.fixture(scope="module")
def planner():
    return ChunkPlanner(SPEC, Robot(SPEC), ControllerConfig())


def plan(planner, loads, palms=None):
    """Of a chunk that leads the palms, level, from the stance to places (2, 3) within 1.2 s; or holds them there."""
    hands = [(STANCE.p_world_lpalm, STANCE.R_world_lhand), (STANCE.p_world_rpalm, STANCE.R_world_rhand)]
    fps, n, T = 30.0, 50, []
    share = np.clip(np.arange(n) / 36.0, 0.0, 1.0)[:, None]
    share = share**3 * (10.0 - share * (15.0 - 6.0 * share))
    for i, (tool, (p, R)) in enumerate(zip(SPEC.tools, hands, strict=True)):
        poses = np.tile(np.eye(4), (n, 1, 1))
        poses[:, :3, :3] = R
        poses[:, :3, 3] = p + share * ((p if palms is None else palms[i]) - p) - R @ np.array(tool.palm_offset)
        T.append(poses)
    fingers = [np.tile(q, (n, 1)) for q in (STANCE.q_lhand, STANCE.q_rhand)]
    rows = np.array([rest_row(poses[0], q[0]) for poses, q in zip(T, fingers, strict=True)])
    planner.carry(loads)
    start = BodyState.still(planner.optimizer.q_stance, planner.model.nv)
    return planner.plan(ActionChunk("wbc32", 0, 0.0, fps, *T, *fingers), 0.0, start, HandMotion(rows), hold=True)


@pytest.mark.parametrize("place", STATICS)
def test_2_kg_are_held_as_near_to_a_place_as_statics_say(planner, place):
    body, config = planner.optimizer.body, planner.config.posture
    body.carry(HEAVY.masses)
    T = np.tile(np.eye(4), (2, 2, 1, 1))
    T[:, :, :3, 3] = [[place[0], side, place[1]] for side in (0.16, -0.16)]
    held = HoldablePlaces(body, config).near(T, np.zeros((2, len(body.fingers))), body.tables.q_stance, Budget())
    assert held.off < STATICS[place] + 5e-3
    np.testing.assert_array_equal(held.T_palms[:, :, :3, :3], T[:, :, :3, :3])


def test_a_chunk_to_where_2_kg_cannot_be_held_ends_where_they_can(planner):
    found = plan(planner, HEAVY, np.array([[0.50, 0.16, 1.00], [0.50, -0.16, 1.00]]))
    assert found.report.strategy == "holdable"
    assert found.report.safe
    assert found.report.tracking_error[-1].max() < STATICS[0.50, 1.00] + 5e-3


def test_hands_that_wait_with_2_kg_are_turned_until_still_arms_hold_them_and_not_shaken(planner):
    """A level hand asks for 99 % of the wrist's torque; plans kept 80 % at their knots by shaking the arms."""
    found, body = plan(planner, HEAVY), planner.optimizer.body
    assert arms_spent(body, body.body_of(found.knots.q[-5:])) < 1.08
    assert found.report.tracking_error[-1].max() < 5e-3


def test_empty_hands_are_planned_for_as_given(planner):
    assert plan(planner, Loads()).report.strategy == "as_given"
