"""Strategy: the real planner from the stance, on a scripted reach as it is and moved to where nobody can be."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from models import g1
from models.pinocchio_model import stance_q
from policy import Observation
from policy.scripted.library import reach, scripted_policy
from policy.scripted.policy import to_chunk
from tests.support.lissajous_variants import variant
from wholebody.config import ControllerConfig
from wholebody.execution.standing import hands_at_rest
from wholebody.execution.statuses import plan_status
from wholebody.planning.changes import PlanChange
from wholebody.planning.chunk_planner import ChunkPlanner
from wholebody.planning.plan import PlanReport
from wholebody.planning.preparation import most_near
from wholebody.planning.trajectory import GRID, BodyState
from wholebody.reference import HandMotion, rest_row
from wholebody.robot.state import Robot
from wholebody.trajopt.problem import RETURN_TIME
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


def test_palms_of_many_configurations_are_pinocchios(setup):
    planner, start, *_ = setup
    rng, model, data = np.random.default_rng(0), planner.model, planner.model.createData()
    q = np.array([pin.integrate(model, start.q, 0.5 * rng.normal(size=model.nv)) for _ in range(5)])
    for row, palms in zip(q, planner.optimizer.palms(q), strict=True):
        pin.framesForwardKinematics(model, data, row)
        expected = [data.oMf[frame].homogeneous for frame in planner.palm_ids]
        np.testing.assert_allclose(palms, expected, atol=1e-12)


def test_a_reach_is_planned_as_it_is(setup):
    planner, start, rows, chunk = setup
    report = planner.plan(chunk, 0.0, start, HandMotion(rows)).report
    assert (report.slowdown, report.reasons, report.changes) == (1.0, (), {})
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


def test_a_waist_at_its_limit_costs_millimetres_and_no_time(setup):
    """A bound that a posture exceeds is exceeded at any speed: the chunk was slowed 2.5 times, 0.29 m late."""
    planner, start, rows, _ = setup
    body, hands, before, step = start, HandMotion(rows), None, planner.config.posture.dt
    policy, reports = variant(15), []
    for t_obs in np.arange(6) * 25 / 30:
        chunk = to_chunk(policy.script(t_obs + np.arange(50) / 30.0), "wbc32", 0, t_obs, 30.0, 50)
        plan = planner.plan(chunk, t_obs + 0.1, body, hands, before)
        reports.append(plan.report)
        q, v, s = plan.trajectory.q, plan.trajectory.v, 0.1 + 25 / 30
        row = plan.trajectory.row(s)
        body, hands = (
            BodyState(q[row], v[row]),
            HandMotion(np.concatenate([path.sample([s]).rows for path in plan.paths])),
        )
        before = q[[plan.trajectory.row(x) for x in np.arange(s + step, plan.end, step)]]
    assert "firm_bounds" in [report.strategy for report in reports]
    assert [report.slowdown for report in reports] == [1.0] * 6
    assert max(report.tracking_error.max() for report in reports) < 0.01


def test_a_start_past_a_bound_has_a_safe_plan_that_leads_back_inside(setup):
    """Pelvis bent 0.1 rad further than plans may: a robot that stood there was refused every plan."""
    planner, start, rows, chunk = setup
    low = to_chunk(reach(0.40, 0.30).script(np.full(50, 100.0)), "wbc32", 0, 0.0, 30.0, 50)
    there = planner.plan(low, 0.0, start, HandMotion(rows)).trajectory.q[-1]
    robot, config = Robot(SPEC), ControllerConfig()
    robot.update(there, np.zeros(robot.nv))
    bound = bent(there) - 0.1
    config = replace(
        config, planner=replace(config.planner, posture=replace(config.planner.posture, pelvis_tilt=bound))
    )
    rest = HandMotion(hands_at_rest(robot, there))
    plan = ChunkPlanner(SPEC, robot, config).plan(chunk, 0.0, BodyState.still(there, robot.nv), rest)
    assert plan.report.safe
    after = plan.trajectory.q[round(RETURN_TIME / GRID) :]
    assert max(bent(q) for q in after) <= bound + 0.01


def bent(q):
    """Tilt of the pelvis [rad]."""
    return float(np.arccos(pin.Quaternion(q[3:7]).toRotationMatrix()[2, 2]))


def report_of(**moved):
    """A report of five knots 0.1 s apart: distances [m] by reason, seen from 8 mm on."""
    changes = {Reason(code): PlanChange(np.array(far), np.array(far) > 0.008, code) for code, far in moved.items()}
    return PlanReport(0.1 * np.arange(5), np.zeros((5, 2)), 1.0, np.ones(5), changes)


def test_6_a_report_at_an_instant_leaves_out_what_is_moved_elsewhere_on_the_path():
    report = report_of(into_floor=[0.0, 0.0, 0.0, 0.0, 0.1], out_of_reach=[0.0, 0.0, 0.2, 0.003, 0.0])
    reach, floor = Reason.OUT_OF_REACH, Reason.INTO_FLOOR
    assert [report.seen_at(s) for s in (-1.0, 0.0, 0.1, 0.21, 0.34, 0.4, 9.0)] == [
        *[None] * 3,
        reach,
        None,
        floor,
        floor,
    ]
    assert [report.moved_at(s) for s in (0.0, 0.21, 0.34)] == [None, reach, reach]


def test_6_where_a_filter_moved_the_hands_visibly_it_is_said_and_nowhere_else():
    """One step that was moved by 3 mm made a whole chunk noisy: a motion at its own speed was called slowed."""
    report = report_of(steps_jump=[0.0, 0.02, 0.003, 0.0, 0.0], noisy_chunk=[0.003, 0.003, 0.003, 0.0005, 0.003])
    jump, noise = Reason.STEPS_JUMP, Reason.NOISY_CHUNK
    steps = report.steps
    assert [plan_status(report, 1.0, s).reason for s in steps] == [None, jump, None, None, None]
    assert [report.moved_at(s) for s in steps] == [noise, jump, jump, None, noise]
    assert plan_status(report, 1.0).reason is jump
    assert plan_status(report, 0.9, 0.4).reason is Reason.PALM_MISSED


def test_the_largest_of_several_steps_counts_at_the_knot_that_is_nearest_to_them():
    times, values = np.arange(9) / 30.0, np.array([0.0, 0.0, 0.0, 5.0, 0.0, 0.0, 0.0, 0.0, 2.0])
    np.testing.assert_allclose(most_near(times, values, np.arange(0.0, 0.5, 2.0 / 30.0)), [0, 0, 5, 0, 2, 2, 2, 2])


@pytest.mark.parametrize("angle", [5.0, 1e4])
def test_4_fingers_asked_past_their_range_leave_the_hands_where_they_are(setup, angle):
    """A finger on its way to 10,000 rad made the plan of both hands 1.5 times slower."""
    planner, start, rows, chunk = setup
    limits = planner.hand_limits[0]
    inside, beyond = (
        replace(chunk, q_lhand=np.where(np.arange(7) == 0, q, chunk.q_lhand)) for q in (limits.finger_upper[0], angle)
    )
    plans = [planner.plan(one, 0.0, start, HandMotion(rows)) for one in (inside, beyond)]
    assert [plan.report.slowdown for plan in plans] == [1.0, 1.0]
    s = np.arange(plans[0].start, plans[0].end, GRID)
    palms = [palms_of(planner, plan, s) for plan in plans]
    assert np.linalg.norm(palms[0] - palms[1], axis=2).max() < 1e-3
    assert plans[1].paths[0].sample(s).q_finger[:, 0].max() < limits.finger_upper[0] + 1e-3
