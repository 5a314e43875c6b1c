"""Strategy: the real planner, controller and plant; bad input on one side, a short real motion on the other."""

from dataclasses import replace

import numpy as np
import pytest

from models import g1
from policy.scripted.library import reach, scripted_policy
from wholebody.config import ControllerConfig, PlanningConfig
from wholebody.episode.run import EpisodeConfig, observe, run_episode
from wholebody.errors import PlanningError, StateError
from wholebody.execution.state_monitor import CONSISTENT
from wholebody.execution.supervisor import RETRY, Supervisor
from wholebody.sim.plant import MujocoPlant
from wholebody.sim.recorder import Recorder
from wholebody.types import RobotState, Status


@pytest.fixture(scope="module")
def loop():
    """Planned at once: what happens meanwhile is tested in `test_handover.py`."""
    spec = g1()
    return Supervisor(spec, ControllerConfig(planning=PlanningConfig(lead=0.0))), MujocoPlant(spec)


def start(loop):
    supervisor, plant = loop
    state = plant.reset()
    supervisor.reset(state)
    return supervisor, plant, state


def chunk_at(supervisor, state):
    policy = scripted_policy("reach")
    policy.reset()
    return policy.infer(observe(supervisor.spec, supervisor, state))


def moving(chunk, displacement):
    """The chunk with both hands moved from where they begin, orientations as at the beginning."""
    T = [np.tile(x[0], (len(chunk), 1, 1)) for x in (chunk.T_world_lhand, chunk.T_world_rhand)]
    for x in T:
        x[:, :3, 3] += displacement
    return replace(chunk, T_world_lhand=T[0], T_world_rhand=T[1])


T = np.arange(50)[:, None] / 30.0
HARD = {
    "out_of_reach": np.clip(T, 0.0, 1.0) * [0.9, 0.0, 0.0],
    "steps_jump": np.where(T > 0.5, 0.04, 0.0) * [1.0, 0.0, 0.0],
    "too_fast_for_balance": 0.25 * np.sin(3.0 * np.pi * T) * np.clip(2.0 * T, 0.0, 1.0) * [1.0, 0.0, 0.0],
    "into_floor": np.clip(T, 0.0, 1.0) * [0.0, 0.0, -1.0],
    "far_start": np.full_like(T, 0.4) * [1.0, 0.0, 0.0],
}


def test_without_a_chunk_it_holds_the_stance_and_says_so(loop):
    supervisor, _, state = start(loop)
    supervisor.step(state)
    assert (supervisor.status.status, supervisor.status.reason) == (Status.HOLD, "no_chunk")


@pytest.mark.parametrize("reason", HARD)
def test_a_chunk_that_is_contained_is_followed_as_far_as_possible_with_the_reason(loop, reason):
    supervisor, plant, state = start(loop)
    for _ in range(50):  # the hands are known to be empty then
        state = plant.step(supervisor.step(state))
    status = supervisor.accept(moving(chunk_at(supervisor, state), HARD[reason]))
    assert status.status is Status.SLOWED
    assert reason in {status.reason, *supervisor.plan_report.reasons}
    assert supervisor.plan_report.safe


def test_a_chunk_whose_end_has_passed_leaves_the_robot_holding_it(loop):
    supervisor, plant, state = start(loop)
    supervisor.accept(replace(moving(chunk_at(supervisor, state), 0.0 * T), fps=100.0))
    while state.time < 1.1:
        state = plant.step(supervisor.step(state))
    assert (supervisor.status.status, supervisor.status.reason) == (Status.HOLD, "starved")


def test_a_plan_that_is_not_balanced_is_never_taken_and_the_stance_is_held(loop, monkeypatch):
    supervisor, _, state = start(loop)
    planned = supervisor.planner.plan

    def unsafe(*args, **options):
        plan = planned(*args, **options)
        return replace(plan, report=replace(plan.report, safe=False))

    monkeypatch.setattr(supervisor.planner, "plan", unsafe)
    status = supervisor.accept(chunk_at(supervisor, state))
    assert (status.status, status.reason) == (Status.HOLD, "not_joined")
    assert supervisor.plan_report is None


def test_a_hand_that_is_held_back_is_told_and_yields_and_the_robot_stands(loop):
    supervisor, plant, state = start(loop)
    supervisor.accept(chunk_at(supervisor, state))
    wrist, seen = plant.model.body(supervisor.spec.tools[0].wrist_frame).id, set()
    plant.data.xfrc_applied[wrist, :3] = [-20.0, 0.0, 0.0]
    while state.time < 2.0:
        state = plant.step(supervisor.step(state))
        seen.add((supervisor.status.status, supervisor.status.reason))
    plant.data.xfrc_applied[:] = 0.0
    assert (Status.SLOWED, "touching") in seen
    assert not {status for status, _ in seen} & {Status.STOP, Status.DAMPING}
    assert supervisor.touch.forces[0, 0] == pytest.approx(-20.0, abs=1.0)


def test_a_waist_that_cannot_hold_the_trunk_leaves_the_plan_before_the_trunk_is_far_from_it(loop):
    supervisor, plant, state = start(loop)
    supervisor.accept(chunk_at(supervisor, state))
    for body, torque in (("torso_link", 19.0), ("pelvis", -19.0)):
        plant.data.xfrc_applied[plant.model.body(body).id, 4] = torque
    trusts = []
    while supervisor.plan is not None and state.time < 3.0:
        trusts.append(supervisor._follower.trust)
        state = plant.step(supervisor.step(state))
    plant.data.xfrc_applied[:] = 0.0
    assert (supervisor.plan, supervisor.status.reason) == (None, "off_plan")
    assert min(trusts) > 0.5


@pytest.mark.parametrize(("speed", "level", "reason"), [(20.0, 1, "hands_dropped"), (60.0, 2, "qp_failed")])
def test_a_program_without_a_solution_gives_up_the_hands_first_and_keeps_the_last_torques_at_worst(
    loop, speed, level, reason
):
    supervisor, _, state = start(loop)
    supervisor.step(state)
    q, knee = state.q.copy(), supervisor.robot.joint_names.index("left_knee_joint")
    for k in range(1, 5):
        v = state.v.copy()
        v[6 + knee] = 0.25 * k * speed
        q[7 + knee] += 0.002 * v[6 + knee]
        command = supervisor.step(RobotState(state.time + 0.002 * k, q.copy(), v))
    assert (supervisor.status.status, supervisor.status.reason) == (Status.STOP, reason)
    assert supervisor.last_tick.level == level
    assert np.all(np.abs(command.tau) <= supervisor.spec.effort_max * (1.0 + 1e-6))


def test_a_chunk_with_nan_is_refused_and_the_robot_holds(loop):
    supervisor, plant, state = start(loop)
    chunk = chunk_at(supervisor, state)
    T = chunk.T_world_lhand.copy()
    T[7, 0, 3] = np.nan
    status = supervisor.accept(replace(chunk, T_world_lhand=T))
    assert status.status is Status.HOLD
    assert status.reason == "chunk_invalid"
    assert "step 7" in status.detail
    for _ in range(100):
        state = plant.step(supervisor.step(state))
    assert abs(state.q[2] - plant.spec.stance.base_position[2]) < 2e-3


def test_a_chunk_that_is_over_is_refused(loop):
    supervisor, _, state = start(loop)
    chunk = chunk_at(supervisor, state)
    length = chunk.times[-1] - chunk.t_obs
    status = supervisor.accept(replace(chunk, t_obs=state.time - length - 0.01))
    assert status.reason == "chunk_stale"
    assert supervisor.accept(replace(chunk, t_obs=state.time - length + 0.1)).reason != "chunk_stale"


def test_a_chunk_from_the_future_is_refused(loop):
    supervisor, _, state = start(loop)
    status = supervisor.accept(replace(chunk_at(supervisor, state), t_obs=state.time + 5.0))
    assert status.reason == "chunk_from_future"


def test_a_repeated_chunk_is_refused(loop):
    supervisor, _, state = start(loop)
    chunk = chunk_at(supervisor, state)
    assert supervisor.accept(chunk).reason != "chunk_invalid"
    assert supervisor.accept(chunk).reason == "chunk_invalid"


def test_a_chunk_that_no_balanced_motion_leads_to_is_refused_and_the_one_before_goes_on(loop, monkeypatch):
    supervisor, plant, state = start(loop)
    policy, planned = scripted_policy("reach"), supervisor.planner.plan
    policy.reset()
    supervisor.accept(policy.infer(observe(supervisor.spec, supervisor, state)))
    for _ in range(100):
        state = plant.step(supervisor.step(state))
    plan_before, chunk = supervisor.plan_report, policy.infer(observe(supervisor.spec, supervisor, state))

    def unsafe(*args, **options):
        plan = planned(*args, **options)
        return replace(plan, report=replace(plan.report, safe=False))

    monkeypatch.setattr(supervisor.planner, "plan", unsafe)
    status = supervisor.accept(chunk)
    assert (status.status, status.reason) == (Status.HOLD, "not_joined")
    assert supervisor.plan_report is plan_before
    z = supervisor.palm_reference()["left"][2, 3]
    for _ in range(100):
        state = plant.step(supervisor.step(state))
    assert abs(supervisor.palm_reference()["left"][2, 3] - z) > 1e-3


def test_a_state_with_nan_gets_the_last_command_at_rest(loop):
    supervisor, plant, state = start(loop)
    state = plant.step(supervisor.step(state))
    bad = RobotState(state.time, np.full_like(state.q, np.nan), state.v)
    command = supervisor.step(bad)
    assert supervisor.status.reason == "state_invalid"
    assert np.isfinite([command.tau, command.q]).all()


def test_a_robot_that_lies_down_is_only_damped(loop):
    supervisor, _, state = start(loop)
    q = state.q.copy()
    q[2] = 0.1
    supervisor.reset(RobotState(state.time, q, state.v))
    for k in range(CONSISTENT):
        assert supervisor.status.status is not Status.DAMPING
        command = supervisor.step(RobotState(state.time + 0.002 * k, q, state.v))
    assert (supervisor.status.status, supervisor.status.reason) == (Status.DAMPING, "standing_lost")
    assert not command.kp.any()
    assert (command.kd > 0.0).all()
    # Somebody lifts it into its stance within a second: it is damped until it is told to begin again.
    speed = state.q[2] - q[2]
    for k in range(CONSISTENT, 600):
        lifted, v = q.copy(), np.zeros_like(state.v)
        lifted[2] += speed * min(0.002 * k, 1.0)
        v[2] = speed * (k < 500)
        command = supervisor.step(RobotState(state.time + 0.002 * k, lifted, v))
    assert not supervisor.monitor.standing_lost
    assert (supervisor.status.status, command.kp.any()) == (Status.DAMPING, False)
    up = replace(state, time=state.time + 2.0)
    supervisor.reset(up)
    assert supervisor.step(up).kp.all()


def test_a_reach_arrives_and_stands(loop):
    supervisor, plant = loop
    result = run_episode(reach(0.45, 1.0), supervisor, plant, duration=3.2, config=EpisodeConfig(settle=0.2, hold=0.3))
    assert result.fall is None
    assert result.refusals == []
    assert result.errors[-1].max() < 2e-3
    assert result.time_factor == pytest.approx(1.0, abs=0.01)


def test_a_chunk_that_no_plan_joins_waits_while_the_one_before_is_followed(loop, monkeypatch):
    supervisor, plant, state = start(loop)
    chunk = chunk_at(supervisor, state)
    supervisor.accept(chunk)
    plan, calls = supervisor.planner.plan, []

    def unsafe(*arguments, **options):
        calls.append(arguments[1])
        found = plan(*arguments, **options)
        return replace(found, report=replace(found.report, safe=len(calls) > 2))

    monkeypatch.setattr(supervisor.planner, "plan", unsafe)
    followed = supervisor.plan_report
    for _ in range(10):
        state = plant.step(supervisor.step(state))
    later = replace(chunk, t_obs=state.time, seq=chunk.seq + 1)
    assert supervisor.accept(later).reason == "not_joined"
    assert supervisor.plan_report is followed
    while len(calls) < 3 and state.time < 1.0:
        state = plant.step(supervisor.step(state))
    assert supervisor.plan_report is not followed
    np.testing.assert_allclose(np.diff(calls), RETRY, atol=3e-3)


def test_a_planner_that_raises_changes_nothing_and_is_not_asked_at_every_tick(loop, monkeypatch, caplog):
    supervisor, plant, state = start(loop)
    chunk = chunk_at(supervisor, state)
    supervisor.accept(chunk)
    for _ in range(50):
        state = plant.step(supervisor.step(state))
    calls = []

    def fails(*arguments, **_):
        calls.append(arguments[1])
        raise PlanningError("no steps were found")

    monkeypatch.setattr(supervisor.planner, "plan", fails)
    before = supervisor._smoother.state.copy()
    status = supervisor.accept(replace(chunk, t_obs=state.time, seq=chunk.seq + 1))
    assert (status.status, status.reason) == (Status.HOLD, "planning_failed")
    assert caplog.records[0].name == "wholebody.execution.gate"
    assert caplog.records[0].exc_info[0] is PlanningError, "the log has the traceback"
    np.testing.assert_array_equal(supervisor._smoother.state, before)
    # A robot that is far from its plan stands, and is planned anew from where it is.
    monkeypatch.setattr(type(supervisor._follower), "trust", 0.0)
    for _ in range(220):
        state = plant.step(supervisor.step(state))
    assert supervisor.status.reason == "off_plan"
    assert 3 <= len(calls) <= 4


@pytest.mark.parametrize("error", [np.linalg.LinAlgError("singular"), MemoryError(), ValueError("shapes")], ids=repr)
def test_a_fault_of_the_planner_is_told_as_one_and_the_robot_stands(loop, monkeypatch, caplog, error):
    """It left the loop, and the robot without commands."""
    supervisor, plant, state = start(loop)

    def breaks(*_, **__):
        raise error

    monkeypatch.setattr(supervisor.planner, "plan", breaks)
    status = supervisor.accept(chunk_at(supervisor, state))
    assert (status.status, status.reason) == (Status.HOLD, "planning_failed")
    assert status.detail == f"a fault of the planner, not of the chunk: {type(error).__name__}: {error}".rstrip(": ")
    assert caplog.records[0].exc_info[0] is type(error), "the log has the traceback"
    for _ in range(50):
        state = plant.step(supervisor.step(state))
    assert abs(state.q[2] - plant.spec.stance.base_position[2]) < 2e-3


@pytest.mark.parametrize("part", ["paths", "trajectory", "end"])
def test_a_plan_that_is_not_finite_is_not_followed(loop, monkeypatch, part):
    supervisor, plant, state = start(loop)
    plan = supervisor.planner.plan

    def spoilt(*arguments, **options):
        found = plan(*arguments, **options)
        coefficients = found.paths[0].curve.coefficients.copy()
        coefficients[-1, -1, 0] = np.nan
        curve = replace(found.paths[0].curve, coefficients=coefficients)
        spoils = {
            "paths": (replace(found.paths[0], curve=curve), found.paths[1]),
            "trajectory": replace(found.trajectory, ddq=np.full_like(found.trajectory.ddq, np.inf)),
            "end": np.nan,
        }
        return replace(found, **{part: spoils[part]})

    monkeypatch.setattr(supervisor.planner, "plan", spoilt)
    status = supervisor.accept(chunk_at(supervisor, state))
    assert (status.reason, status.detail) == ("planning_failed", "the plan has numbers that are not finite")
    for _ in range(50):
        state = plant.step(supervisor.step(state))
    assert supervisor.plan is None


def test_nothing_is_done_before_the_first_reset(loop):
    chunk, state = chunk_at(*start(loop)[::2]), loop[1].reset()
    supervisor = Supervisor(loop[0].spec)
    with pytest.raises(StateError, match="call `reset`"):
        supervisor.step(state)
    with pytest.raises(StateError, match="call `reset`"):
        supervisor.accept(chunk)
    with pytest.raises(StateError, match="call `reset`"):
        supervisor.palm_reference()


def test_a_state_that_is_not_finite_at_the_first_tick_leaves_the_stance_held(loop):
    supervisor, _, state = start(loop)
    command = supervisor.step(RobotState(state.time, np.full_like(state.q, np.nan), state.v))
    assert (supervisor.status.status, supervisor.status.reason) == (Status.HOLD, "state_invalid")
    np.testing.assert_allclose(command.q, state.q[7:][supervisor.robot.pin_to_motor], atol=1e-4)
    assert np.abs(command.dq).max() < 0.05


def test_the_way_to_a_chunk_that_begins_elsewhere_is_tried_quicker_once_the_robot_can(loop, monkeypatch):
    supervisor, plant, state = start(loop)
    chunk = chunk_at(supervisor, state)
    far = np.tile(np.eye(4), (len(chunk), 1, 1))
    far[:, :3, 3], far[:, :3, :3] = [0.3, 0.2, 0.5], chunk.T_world_lhand[0, :3, :3]
    chunk = replace(chunk, T_world_lhand=far)
    plan, slowdowns = supervisor.planner.plan, iter([2.5, 2.5, 1.5, 1.0])

    def slow(*arguments, **options):
        found = plan(*arguments, **options)
        return replace(found, report=replace(found.report, slowdown=next(slowdowns)))

    monkeypatch.setattr(supervisor.planner, "plan", slow)
    status = supervisor.accept(chunk)
    assert (status.status, status.reason) == (Status.SLOWED, "far_start")
    seen = []
    for _ in range(round(4.5 * RETRY / plant.control_dt)):
        state = plant.step(supervisor.step(state))
        if not seen or supervisor.plan_report is not seen[-1]:
            seen.append(supervisor.plan_report)
    assert [report.slowdown for report in seen] == [2.5, 1.5, 1.0]


@pytest.mark.parametrize(("scatter", "doubted"), [(0.0, False), (0.01, False), (0.3, True)])
def test_only_a_chunk_that_scatters_far_is_doubted(loop, scatter, doubted):
    supervisor, _, state = start(loop)
    noise = scatter * np.random.default_rng(3).normal(size=(50, 3))
    supervisor.accept(moving(chunk_at(supervisor, state), noise))
    assert supervisor.plan_report.implausible == doubted


def test_it_says_tracking_only_while_palms_are_where_the_chunk_has_them():
    """A chunk was said to be tracked for 30 ms after each takeover, with a palm 235 mm off."""
    spec, policy = g1(), reach(0.75, 0.35)
    recorder = Recorder(spec, "floor")
    run_episode(
        policy, Supervisor(spec), MujocoPlant(spec), duration=2.5, config=EpisodeConfig(hold=0.0), recorder=recorder
    )
    recorded = recorder.arrays()
    asked, measured = (recorded[f"T_world_palms_{name}"][:, :, :3, 3] for name in ("asked", "measured"))
    away = np.linalg.norm(measured - asked, axis=2).max(axis=1)
    tracking = recorded["status"] == "tracking"
    assert tracking.sum() > 300
    assert away[tracking].max() < 0.02
