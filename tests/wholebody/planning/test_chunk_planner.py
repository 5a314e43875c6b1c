"""Strategy: the real planner from the stance, on a scripted reach as it is and moved to where nobody can be."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from models.g1 import g1
from models.pinocchio_model import stance_q
from policy import Observation
from policy.scripted.library import scripted_policy
from wholebody.config import ControllerConfig
from wholebody.planning.chunk_planner import ChunkPlanner
from wholebody.planning.plan import PlanReport
from wholebody.planning.trajectory import GRID, BodyState
from wholebody.reference import HandMotion, rest_row
from wholebody.robot.state import Robot
from wholebody.types import Reason

SPEC = g1()


@pytest.fixture(scope="module")
def setup():
    """A planner, the stance, what the hands do there, and the first chunk of a reach."""
    robot, joints, config = Robot(SPEC), np.array(SPEC.stance.joint_positions), ControllerConfig()
    q = stance_q(SPEC, robot.model)
    robot.update(q, np.zeros(robot.nv))
    fingers = [joints[SPEC.indices(tool.finger_joints)] for tool in SPEC.tools]
    poses = [robot.pose(tool.wrist_frame).homogeneous for tool in SPEC.tools]
    rows = np.array([rest_row(T, finger) for T, finger in zip(poses, fingers, strict=True)])
    chunk = scripted_policy("reach").infer(
        Observation(0.0, joints[:29], *fingers, robot.pose(SPEC.base_body).homogeneous)
    )
    return ChunkPlanner(SPEC, robot, config), BodyState.still(q, robot.nv), rows, chunk


def stretched(chunk, scale, swing=0.0):
    """The chunk with the displacements of both hands from its first step multiplied; they swing at 6 Hz besides [m]."""
    T = [x.copy() for x in (chunk.T_world_lhand, chunk.T_world_rhand)]
    for x in T:
        x[:, :3, 3] = x[0, :3, 3] + scale * (x[:, :3, 3] - x[0, :3, 3])
        x[:, 2, 3] += swing * np.sin(12.0 * np.pi * (chunk.times - chunk.times[0]))
    return replace(chunk, T_world_lhand=T[0], T_world_rhand=T[1])


def palms_on(planner, track, rows):
    """Palm positions (n, 2, 3) on rows of a track."""
    model, data, out = planner.model, planner.model.createData(), []
    for q in track.q[rows]:
        pin.framesForwardKinematics(model, data, q)
        out.append([data.oMf[frame].translation.copy() for frame in planner.palm_ids])
    return np.array(out)


def palms_of(planner, plan, s):
    """Palm positions (n, 2, 3) that the hands' paths lead to."""
    motions = [path.sample(s).T_world_hand for path in plan.paths]
    return np.stack([T[:, :3, 3] + T[:, :3, :3] @ x for T, x in zip(motions, planner.offsets, strict=True)], axis=1)


def test_a_reach_is_planned_as_it_is(setup):
    planner, start, rows, chunk = setup
    report = planner.plan(chunk, 0.0, start, HandMotion(rows)).report
    assert (report.slowdown, report.reasons, report.clamped.max()) == (1.0, (), 0.0)
    assert report.tracking_error.max() < planner.config.clamp_tolerance / 2.0


def test_where_a_target_is_out_of_reach_the_hand_is_led_along_the_plan_between_its_knots_too(setup):
    planner, start, rows, chunk = setup
    plan = planner.plan(stretched(chunk, 3.0, swing=0.01), 0.0, start, HandMotion(rows))
    assert "out_of_reach" in plan.report.reasons
    beyond, steps = plan.report.tracking_error.min(axis=1) > planner.config.clamp_tolerance, plan.report.steps
    s = plan.start + GRID * np.arange(len(plan.trajectory.q))
    knot = np.minimum(np.searchsorted(steps, s, side="right") - 1, len(steps) - 2)
    at = np.flatnonzero((s < steps[-1]) & beyond[knot] & beyond[knot + 1])
    assert GRID * len(at) > 0.3
    planned, led = palms_on(planner, plan.trajectory, at), palms_of(planner, plan, plan.start + GRID * at)
    assert np.linalg.norm(planned - led, axis=2).max() < 1e-3


def test_where_the_hands_are_not_quite_where_the_plan_begins_they_go_on_from_where_they_are(setup):
    planner, start, rows, chunk = setup
    aside = rows.copy()
    aside[:, 1] += 0.006
    plan = planner.plan(stretched(chunk, 3.0), 0.0, start, HandMotion(aside))
    for path, row in zip(plan.paths, aside, strict=True):
        assert np.allclose(path.sample(plan.start).p, row[:3], atol=1e-9)
        s = plan.start + np.arange(0.0, 0.2, GRID)
        assert np.linalg.norm(path.sample(s).a, axis=1).max() < 20.0


def test_6_a_report_at_an_instant_leaves_out_what_is_moved_elsewhere_on_the_path():
    clamped = np.zeros((5, 2))
    clamped[2, 0], clamped[3, 0] = 0.2, 0.003
    report = PlanReport(
        steps=0.1 * np.arange(5),
        tracking_error=clamped,
        clamped=clamped,
        slowdown=1.0,
        zmp_margin=np.ones(5),
        reasons=(Reason.OUT_OF_REACH, Reason.FAR_START),
        lift=np.array([0.0, 0.0, 0.0, 0.0, 0.1]),
        out_of_reach=clamped.max(axis=1) > 0.008,
    )
    assert report.at(0.21).reasons == (Reason.OUT_OF_REACH, Reason.FAR_START)
    assert report.at(0.21).clamped.max() == 0.2
    for s in (-1.0, 0.0, 0.1, 0.3, 0.4, 9.0):
        assert report.at(s).reasons == (Reason.FAR_START,)
    assert [float(report.at(s).lift.max()) for s in (0.0, 0.34, 0.4, 9.0)] == [0.0, 0.0, 0.1, 0.1]
