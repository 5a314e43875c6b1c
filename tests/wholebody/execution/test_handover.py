"""Strategy: the real planner, controller and plant with the default lead; time goes on while plans are computed."""

from dataclasses import replace

import numpy as np
import pytest

from models import g1
from policy.scripted.library import scripted_policy
from wholebody.config import ControllerConfig, PlanningConfig, SafetyConfig
from wholebody.episode.run import observe
from wholebody.errors import PlanningError
from wholebody.execution.background_planner import PlanAnswer, PlanRequest
from wholebody.execution.handover import QUICK, Handover, ends_at_rest
from wholebody.execution.supervisor import Supervisor
from wholebody.sim.plant import MujocoPlant
from wholebody.types import Status

SPEC = g1()
LEAD = PlanningConfig().lead


@pytest.fixture(scope="module")
def plant():
    return MujocoPlant(SPEC)


@pytest.fixture(scope="module")
def supervisor():
    return Supervisor(SPEC)


def begin(supervisor, plant):
    state = plant.reset()
    supervisor.reset(state)
    return state


def wave(supervisor, state, seq=0):
    policy = scripted_policy("wave")
    policy.reset()
    return replace(policy.infer(observe(SPEC, supervisor, state)), seq=seq)


def run(supervisor, plant, state, seconds):
    for _ in range(round(seconds / plant.control_dt)):
        state = plant.step(supervisor.step(state))
    return state


def test_a_plan_takes_over_exactly_when_its_lead_is_over_and_nothing_jumps(supervisor, plant):
    state = begin(supervisor, plant)
    status = supervisor.accept(wave(supervisor, state), state.time)
    assert status.status is Status.TRACKING
    state = run(supervisor, plant, state, LEAD)
    assert supervisor.chunk is None
    assert supervisor.status.reason == "no_chunk"
    before = supervisor.palm_reference()["right"]
    state = run(supervisor, plant, state, 0.004)
    assert supervisor.chunk.seq == 0
    assert supervisor.plan_report.steps[0] == pytest.approx(LEAD)
    assert np.abs(supervisor.palm_reference()["right"] - before).max() < 1e-5
    late = replace(wave(supervisor, state, seq=1), t_obs=state.time)
    supervisor.accept(late, state.time)
    begun, poses = None, []
    for _ in range(80):
        state = run(supervisor, plant, state, 0.002)
        poses.append(supervisor.palm_reference()["right"][:3, 3])
        if begun is None and supervisor.chunk.seq == 1:
            begun = len(poses)
    assert begun == pytest.approx(LEAD / 0.002, abs=2)
    jerks = np.diff(poses, 3, axis=0)
    assert np.abs(jerks[begun - 5 : begun + 3]).max() < 2e-6, "400 m/s^3 are 3e-6 m in three ticks"


def test_chunks_that_come_faster_than_plans_are_followed_all_the_same(supervisor, plant):
    state, seen = begin(supervisor, plant), set()
    for seq in range(8):
        supervisor.accept(replace(wave(supervisor, state, seq), t_obs=state.time), state.time)
        state = run(supervisor, plant, state, 0.06)
        seen.add(None if supervisor.chunk is None else supervisor.chunk.seq)
    assert len(seen - {None}) >= 3
    assert supervisor.handover.late == 0


def test_a_plan_that_is_late_is_dropped_and_asked_for_with_twice_the_lead(plant):
    late = Supervisor(SPEC, ControllerConfig(planning=PlanningConfig(factor=1.5)))
    state = begin(late, plant)
    late.accept(wave(late, state), state.time)
    state = run(late, plant, state, 0.3)
    assert late.chunk is None
    run(late, plant, state, 0.1)
    assert late.handover.late == 1
    assert late.chunk is not None
    assert late.plan_report.steps[0] == pytest.approx(0.35, abs=0.005)


def test_a_planner_that_is_always_late_asks_at_most_the_longest_lead_ahead(plant):
    late = Supervisor(SPEC, ControllerConfig(planning=PlanningConfig(factor=30.0)))
    state = begin(late, plant)
    late.accept(wave(late, state), state.time)
    for _ in range(5):
        late.handover._planner._done = state.time + late.handover.lead + 0.02
        state = run(late, plant, state, late.handover.lead + 0.03)
    assert late.handover.lead == PlanningConfig().lead_max
    assert late.status.status is Status.HOLD


def test_what_speaks_against_a_chunk_once_it_is_planned_is_said_once(supervisor, plant, monkeypatch):
    state = begin(supervisor, plant)

    def fails(*_, **__):
        raise PlanningError("no steps were found")

    monkeypatch.setattr(supervisor.planner, "plan", fails)
    supervisor.accept(wave(supervisor, state), state.time)
    assert supervisor.take_refusal() is None
    run(supervisor, plant, state, LEAD + 0.004)
    refusal = supervisor.take_refusal()
    assert (refusal.reason, refusal.detail) == ("planning_failed", "no steps were found")
    assert supervisor.take_refusal() is None
    assert supervisor.status.reason == "planning_failed"


def test_a_chunk_is_judged_by_the_true_time_and_not_by_that_of_the_last_tick(supervisor, plant):
    state = begin(supervisor, plant)
    chunk = replace(wave(supervisor, state), t_obs=0.4)
    assert supervisor.accept(chunk).reason == "chunk_from_future"
    assert supervisor.accept(chunk, 0.4).status is Status.TRACKING


def test_only_a_plan_that_ends_at_rest_and_balanced_is_taken(supervisor, plant):
    state = begin(supervisor, plant)
    supervisor.accept(wave(supervisor, state), state.time)
    run(supervisor, plant, state, LEAD + 0.004)
    plan, support = supervisor.plan, supervisor.controller.balance.support
    assert ends_at_rest(plan, support, 0.02)
    trajectory = plan.trajectory
    for name, value in (("v", 0.3), ("q", np.nan), ("com", 0.2)):
        changed = getattr(trajectory, name).copy()
        changed[..., -1, :] += value
        assert not ends_at_rest(replace(plan, trajectory=replace(trajectory, **{name: changed})), support, 0.02), name
    curve = plan.paths[1].curve
    curve = replace(curve, breaks=np.full_like(curve.breaks, np.nan))
    spoilt = replace(plan.paths[1], curve=curve)
    assert not ends_at_rest(replace(plan, paths=(plan.paths[0], spoilt)), support, 0.02), "what the hands follow"


class Slow:
    """Takes what it is given; answers what it is told to."""

    measured, answer = True, None

    def submit(self, request):
        self.request = request

    def poll(self, now):
        return self.answer


def test_a_robot_that_is_slower_than_foreseen_takes_the_plan_over_where_it_begins(supervisor, plant):
    state = begin(supervisor, plant)
    supervisor.accept(wave(supervisor, state), state.time)
    run(supervisor, plant, state, LEAD + 0.004)
    handover = Handover(Slow(), PlanningConfig(), 0.002)
    start = supervisor._follower.foreseen(50)
    request = PlanRequest(supervisor.chunk, 1.0, 1.1, start)
    handover.ask(request)
    handover.settle(request, supervisor.plan)
    assert handover.take(1.05, start.s, 1.0) is None, "it is not due"
    assert handover.take(1.1, start.s - 0.01, 0.5) is None, "the robot is not there"
    taken = handover.take(1.12, start.s + 0.001, 0.5)
    assert taken.speed_fraction == 0.5
    assert taken.beyond == pytest.approx(0.001)
    handover.ask(request)
    handover.settle(request, supervisor.plan)
    assert handover.take(1.21, start.s - 0.01, 0.0) is None
    assert handover.take_dropped() is supervisor.chunk
    assert not handover.busy


def pushed(supervisor, plant):
    """A robot that waves, pushed; the status reasons of the 0.8 s after it. A second chunk comes on the way."""
    state, reasons = begin(supervisor, plant), []
    supervisor.accept(wave(supervisor, state), state.time)
    state = run(supervisor, plant, state, 0.2)
    plant.push("torso_link", np.array([60.0, 0.0, 0.0]), start=state.time, duration=0.1)
    for tick in range(400):
        if tick == 45:
            supervisor.accept(replace(wave(supervisor, state, seq=1), t_obs=state.time), state.time)
        state = run(supervisor, plant, state, 0.002)
        reasons.append(supervisor.status.reason)
    assert supervisor.status.status is not Status.DAMPING
    assert abs(state.q[2] - SPEC.stance.base_position[2]) < 0.02
    return reasons


def test_a_robot_whose_hands_have_given_way_stands_until_a_plan_from_there_comes(plant):
    supervisor = Supervisor(SPEC, ControllerConfig(safety=SafetyConfig(posture_slow=0.02, posture_stop=0.03)))
    reasons = pushed(supervisor, plant)
    assert "off_plan" in reasons
    assert reasons[-1] != "off_plan", "it has joined the chunk again"


def test_a_robot_a_little_off_its_plan_goes_on_until_a_plan_from_where_it_is_takes_over(plant, monkeypatch):
    supervisor = Supervisor(SPEC, ControllerConfig(safety=SafetyConfig(posture_slow=0.03)))
    planned, asked = supervisor.planner.plan, []

    def plan(chunk, now, start, *rest, **options):
        follower = supervisor._follower
        moved = follower.distance(start.q, follower.foreseen(supervisor.handover.ticks).body.q)
        asked.append((chunk.seq, follower.trust, moved))
        return planned(chunk, now, start, *rest, **options)

    monkeypatch.setattr(supervisor.planner, "plan", plan)
    assert "off_plan" not in pushed(supervisor, plant)
    seqs, trusts, moved = np.array(asked).T
    assert np.all(np.diff(seqs) >= 0.0), "the chunk before is not planned again"
    assert (trusts < 1.0).any()
    np.testing.assert_array_equal(moved > 0.02, trusts < 1.0)
    assert not moved[trusts == 1.0].any(), "on its plan it is foreseen on it"


@pytest.mark.parametrize("safe", [True, False])
def test_a_plan_that_lacked_time_is_given_twice_the_lead_the_next_time_and_dropped_if_unsafe(supervisor, plant, safe):
    state = begin(supervisor, plant)
    supervisor.accept(wave(supervisor, state), state.time)
    run(supervisor, plant, state, LEAD + 0.004)
    planner = Slow()
    handover = Handover(planner, PlanningConfig(latency="measured"), 0.002)
    assert handover.cpu_limit == LEAD
    handover.ask(PlanRequest(supervisor.chunk, 1.0, 1.1, supervisor._follower.foreseen(50)))
    assert planner.request.cpu_limit == LEAD
    report = replace(supervisor.plan.report, safe=safe, timed_out=True)
    planner.answer = PlanAnswer(planner.request, replace(supervisor.plan, report=report))
    assert (handover.collect(1.04, 1.04) is planner.answer) == safe
    assert handover.lead == 2.0 * LEAD
    assert handover.cpu_limit == 2.0 * LEAD
    assert (handover.take_dropped() is supervisor.chunk) == (not safe)


def asked(supervisor, config, *, before=None, asked=1.0, lead=LEAD):
    """A handover whose planner answers with the plan that the supervisor follows, and its request."""
    handover = Handover(Slow(), config, 0.002)
    handover.lead = lead
    start = supervisor._follower.foreseen(round(lead / 0.002))
    handover.ask(PlanRequest(supervisor.chunk, asked, asked + lead, start, before))
    return handover


def answered(handover, plan, now):
    """What becomes of it when its plan comes."""
    handover._planner.answer = PlanAnswer(handover._planner.request, plan)
    return handover.collect(now, now)


@pytest.fixture
def following(supervisor, plant):
    """A supervisor that follows a plan."""
    state = begin(supervisor, plant)
    supervisor.accept(wave(supervisor, state), state.time)
    run(supervisor, plant, state, LEAD + 0.004)
    return supervisor


@pytest.mark.parametrize("before", [None, np.zeros((3, 50))])
def test_a_plan_that_lacked_time_and_leads_elsewhere_takes_over_from_none_but_a_robot_at_rest(following, before):
    report = following.plan.report
    off = replace(report, timed_out=True, tracking_error=np.full_like(report.tracking_error, 0.05))
    handover = asked(following, PlanningConfig(latency="measured"), before=before)
    answer = answered(handover, replace(following.plan, report=off), 1.04)
    assert (answer is None) == (before is not None)
    assert handover.lead == 2.0 * LEAD


def test_the_lead_comes_down_only_after_several_quick_plans_in_a_row(following):
    handover, now, leads = asked(following, PlanningConfig(), lead=4.0 * LEAD), 1.0, []
    for took in (0.1, 0.1, 0.6, *[0.1] * 12):
        handover.ask(PlanRequest(following.chunk, now, now + handover.lead, following._follower.foreseen(50)))
        assert answered(handover, following.plan, now + took * handover.lead) is not None
        leads.append(handover.lead / LEAD)
        now += 1.0
    assert leads[: 2 + QUICK] == [4.0] * (2 + QUICK)
    assert leads[2 + QUICK] == 2.0
    assert leads[-1] == 1.0


def test_a_plan_that_would_be_over_before_the_next_one_is_left_for_that_of_a_newer_chunk_once(following):
    chunk = following.chunk
    newer = replace(chunk, seq=chunk.seq + 1, t_obs=chunk.t_obs + 0.8)
    handover = asked(following, PlanningConfig(), lead=0.8, asked=float(chunk.times[-1]) - 1.0)
    request, early = handover._planner.request, float(chunk.times[-1]) - 0.6
    cases = (
        (None, early, True, "there is no newer chunk"),
        (newer, float(newer.times[-1]), True, "the newer one would be over, too"),
        (newer, early, False, ""),
        (newer, early, True, "twice in a row, and none would ever be followed"),
    )
    for one, now, kept, why in cases:
        if handover.busy:
            handover.cancel()
        handover.ask(request)
        handover.settle(request, following.plan, one, now)
        assert handover.busy == kept, why


def test_a_chunk_that_would_be_over_before_the_next_plan_is_followed_more_slowly_until_then(supervisor, plant):
    state = begin(supervisor, plant)
    chunk = wave(supervisor, state)
    supervisor.accept(chunk, state.time)
    state = run(supervisor, plant, state, float(chunk.times[-1]) - state.time - 0.4)
    rate, follower = supervisor.rate, supervisor._follower
    assert rate > 0.98
    supervisor.handover.lead = 0.8
    supervisor.accept(replace(wave(supervisor, state, seq=1), t_obs=state.time), state.time)
    supervisor.handover._planner._done = state.time + 0.8
    foreseen = supervisor.handover._asked.start
    state = run(supervisor, plant, state, 0.798)
    assert 0.3 < supervisor.rate < 0.7
    assert follower.s == pytest.approx(foreseen.s, abs=0.005), "as it was foreseen"
    assert supervisor.status.status is Status.SLOWED
    assert "next plan comes late" in supervisor.status.detail
    run(supervisor, plant, state, 0.5)
    assert supervisor.rate > 0.98
