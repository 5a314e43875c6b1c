"""Strategy: hands cross before the chest, are planned for, and distances are measured on the curve that results."""

import numpy as np
import pinocchio as pin
import pytest

from models import g1
from models.pinocchio_model import stance_q
from policy.chunk import ActionChunk
from policy.scripted.policy import minimum_jerk, stance_pose
from wholebody.collision.proximity import Proximity
from wholebody.config import ControllerConfig
from wholebody.execution.standing import hands_at_rest
from wholebody.planning.chunk_planner import ChunkPlanner
from wholebody.planning.trajectory import BodyState
from wholebody.reference import HandMotion
from wholebody.robot.state import Robot

SPEC, CONFIG = g1(), ControllerConfig()
EVERY = 3
"""Rows of the trajectory from one measurement to the next, 6 ms."""


def crossing(height, seconds):
    """A chunk that takes each hand to the other side, the left one as much higher as the right one is lower [m]."""
    stance, t, n = stance_pose(), np.arange(50) / 30.0, 50
    T = np.tile(np.eye(4), (2, n, 1, 1))
    starts = (stance.p_world_lpalm, stance.R_world_lhand), (stance.p_world_rpalm, stance.R_world_rhand)
    for poses, (p, R), side in zip(T, starts, (1.0, -1.0), strict=True):
        way = np.array([0.3, -0.15 * side, 0.95 + side * height]) - p
        poses[:, :3, :3], poses[:, :3, 3] = R, p + minimum_jerk(np.clip(t / seconds, 0.0, 1.0))[:, None] * way
    return ActionChunk("wbc32", 0, 0.0, 30.0, *T, np.tile(stance.q_lhand, (n, 1)), np.tile(stance.q_rhand, (n, 1)))


@pytest.fixture(scope="module")
def planned():
    """Plans a chunk from the stance; the least room beyond what the controller keeps on the way of a plan [m]."""
    robot = Robot(SPEC)
    q, planner = stance_q(SPEC, robot.model), ChunkPlanner(SPEC, robot, CONFIG)
    robot.update(q, np.zeros(robot.nv))
    start, hands = BodyState.still(q, robot.nv), HandMotion(hands_at_rest(robot, q))
    proximity, data = Proximity(SPEC, robot.model, None, q, CONFIG.safety.self_distance), robot.model.createData()

    def plan(chunk):
        found, room = planner.plan(chunk, 0.0, start, hands), np.inf
        for configuration in found.trajectory.q[::EVERY]:
            pin.forwardKinematics(robot.model, data, configuration)
            proximity.update(configuration, data, trigger=0.0, least=1)
            room = min(room, (proximity.bound - proximity.margin).min())
        return found.report, room

    return plan


@pytest.mark.parametrize(("height", "seconds"), [(0.0, 0.6), (0.04, 0.6), (0.04, 0.9), (0.04, 1.3)])
def test_arms_that_cross_keep_the_controllers_distance_between_the_knots_of_a_plan_too(planned, height, seconds):
    report, room = planned(crossing(height, seconds))
    assert report.safe
    assert room > 0.0
