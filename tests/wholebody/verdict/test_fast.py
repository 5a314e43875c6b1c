"""Strategy: chunks whose answer is known by construction, judged by their plans; the answer of a preview is held
against that of a search, margins against Pinocchio, JSON against its schema.
"""

import json
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import jsonschema
import numpy as np
import pinocchio as pin
import pytest

from policy.errors import ChunkError
from policy.recorded.replay import ReplayPolicy
from policy.scripted.library import wave
from tests.support.carried import levelled, told
from tests.support.sent_chunks import STANCE, STEPS, sent
from tests.support.stranger_chunks import SPEC, stranger
from wholebody.config import ControllerConfig, LoadConfig
from wholebody.episode.run import EpisodeConfig
from wholebody.errors import InputError
from wholebody.planning.chunk_planner import ChunkPlanner
from wholebody.planning.judgement.limits import Limit
from wholebody.resources import verdict_schema
from wholebody.types import Reason, RobotState
from wholebody.verdict.check import Checker
from wholebody.verdict.fast import FastChecker
from wholebody.verdict.given.own_numbers import judge
from wholebody.verdict.plan_run import PlanRun
from wholebody.verdict.report import lines, to_json


@pytest.fixture(scope="module")
def checker():
    return FastChecker()


def codes(verdict):
    return [violation.code for violation in verdict.violations]


def margin(verdict, code):
    return next(one for one in verdict.margins if one.code is code)


def test_the_fast_check_does_without_mujoco():
    code = "import sys, wholebody.verdict.fast as f; f.FastChecker(); print('mujoco' in sys.modules)"
    assert subprocess.check_output([sys.executable, "-c", code], text=True).strip() == "False"


def test_a_plain_chunk_is_done_as_given_and_a_preview_tells():
    verdict = judge(sent())
    assert (verdict.verdict, verdict.method, verdict.decided_by) == ("feasible", "fast", "preview")
    assert all(one.share > -1.0 for one in verdict.margins)
    assert verdict.moved_max_m < 0.02


def test_a_preview_is_a_plan_that_keeps_what_a_searched_one_keeps(checker):
    chunk = sent(to=(0.15, 0.05, 0.1))
    begin = checker.judge.first_pose(chunk)
    quick = checker.judge.judge(chunk, begin)
    planner = checker.judge.planner
    searched = planner.plan(chunk, 0.0, begin.body, begin.hands)
    assert quick.previewed
    assert quick.plan.report.safe
    assert searched.report.strategy == "as_given"
    assert quick.plan.report.work < 5.0


@pytest.mark.parametrize(
    ("chunk", "answer", "code"),
    [
        (sent(to=(0.8, 0.0, 0.0)), "infeasible", Reason.OUT_OF_REACH),
        (sent(to=(0.0, 0.0, -0.9)), "infeasible", Reason.INTO_FLOOR),
    ],
)
def test_what_cannot_be_done_is_infeasible_with_its_reason(chunk, answer, code):
    verdict = judge(chunk)
    assert verdict.verdict == answer
    assert code in codes(verdict)


def test_a_finger_past_its_range_is_a_repair_with_the_joint():
    chunk = sent()
    chunk.q_lhand[:, 0] = 5.0
    verdict = judge(chunk)
    assert verdict.verdict == "feasible_after_repair"
    assert codes(verdict)[0] is Reason.FINGER_LIMIT
    assert margin(verdict, Limit.FINGER_RANGE).subject == "left_hand_thumb_0_joint"
    assert margin(verdict, Limit.FINGER_RANGE).margin == pytest.approx(1.0472 - 5.0, abs=1e-3)


def test_a_hand_that_is_too_fast_is_told_with_its_speed():
    chunk = sent()
    for k in range(STEPS):
        chunk.T_world_lhand[k, 1, 3] = STANCE.poses["lhand"][1, 3] + 0.1 * (k % 2)
    found = margin(judge(chunk), Limit.HAND_SPEED)
    assert (found.subject, found.value) == ("left hand", pytest.approx(3.0, abs=1e-6))
    assert found.margin == pytest.approx(-0.5, abs=1e-6)


def test_what_is_planned_to_the_end_of_a_recording_is_not_planned_again(checker, monkeypatch):
    planned, judged = [], checker.judge.judge
    monkeypatch.setattr(checker.judge, "judge", lambda chunk, *rest: planned.append(chunk.seq) or judged(chunk, *rest))
    plain, slow = (ReplayPolicy(sent(to=to)) for to in ((0.1, 0.0, 0.1), (0.7, 0.0, 0.0)))
    whole = checker.check(plain, "plain", plain.duration)
    assert planned == [0]
    assert whole.verdict == "feasible"
    planned.clear()
    checker.check(slow, "out of reach", slow.duration)
    assert planned == [0]
    planned.clear()
    checker.check(plain, "goes on", plain.duration + 0.5)
    assert planned == [0, 1, 2]


def test_a_step_of_a_run_is_told_by_what_it_is_given_and_a_verdict_changes_nothing(checker):
    """Both were kept in one object, which another chunk or a second verdict changed."""
    run, first = PlanRun(checker.judge, (False, False), odds=True), sent(to=(0.7, 0.0, 0.0), time=2.0)
    then, other = (replace(sent(to=to, time=2.0), t_obs=0.5) for to in ((0.3, 0.0, 0.1), (0.8, 0.0, 0.0)))
    one, state = run.follow(first, checker.judge.first_pose(first), 0.0, 0.5)
    two, _ = run.follow(then, state.begin, 0.5, np.inf, state)
    verdict = run.verdict((one, two))
    run.follow(other, state.begin, 0.5, np.inf, state)
    again, _ = run.follow(then, state.begin, 0.5, np.inf, state)
    assert one.planned.suspect is not None
    assert again.planned.quantities == two.planned.quantities is not None
    assert run.verdict((one, again)) == verdict == run.verdict((one, two))


def test_a_chunk_is_planned_from_what_the_plan_before_would_do_then(checker):
    found = checker.judge.judge(sent(), checker.judge.stance())
    plan, knot = found.plan, checker.config.planner.posture.dt
    later = checker.judge.later(plan, 0.5)
    rows = [plan.trajectory.row(plan.start + 0.5 + k * knot) for k in (1, 2, 3)]
    assert np.array_equal(later.before[:3], plan.trajectory.q[rows])


def test_a_state_is_judged_where_its_feet_stand_and_the_next_one_where_its_own_do():
    chunk, (x, y, turn) = sent(to=(0.1, 0.05, 0.1)), (1.5, -0.7, 0.6)
    T = np.eye(4)
    T[:2, :2], T[:2, 3] = [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]], (x, y)
    checker = FastChecker()
    stance = checker.judge.stance().body
    there = pin.SE3(T) * pin.XYZQUATToSE3(stance.q[:7])
    states = [RobotState(0.0, q, stance.v) for q in (stance.q, np.r_[pin.SE3ToXYZQUAT(there), stance.q[7:]])]
    moved = replace(chunk, T_world_lhand=T @ chunk.T_world_lhand, T_world_rhand=T @ chunk.T_world_rhand)
    here, away, again = judge(chunk, states[0]), judge(moved, states[1]), judge(chunk, states[0])
    assert here.verdict == away.verdict == "feasible"
    assert margin(away, Limit.BALANCE).value == pytest.approx(margin(here, Limit.BALANCE).value, abs=0.01)
    assert [one.value for one in again.margins] == pytest.approx([one.value for one in here.margins], abs=1e-9)


def test_an_isolated_chunk_begins_at_its_own_first_step_and_from_a_state_it_does_not():
    chunk = sent(jump=(0.1, 0.0, 0.05))
    checker = FastChecker()
    stance = checker.judge.stance()
    state = RobotState(0.0, stance.body.q, stance.body.v)
    assert judge(chunk).start_m < 1e-3
    assert judge(chunk, state).start_m == pytest.approx(np.hypot(0.1, 0.05), abs=1e-6)


def test_the_answer_is_a_function_of_its_arguments_alone():
    chunk = sent(to=(0.2, 0.1, 0.2))
    first = judge(chunk)
    judge(sent(to=(0.6, 0.0, 0.0)))
    assert judge(chunk) == first


def test_what_is_malformed_is_refused(checker):
    chunk = sent()
    chunk.T_world_lhand[3, 0, 3] = np.nan
    with pytest.raises(ChunkError):
        judge(chunk)
    with pytest.raises(InputError, match=r"state\.q"):
        judge(sent(), RobotState(0.0, np.zeros(3), np.zeros(49)))


def test_the_room_of_the_centre_of_mass_is_that_of_pinocchio(checker):
    """The margin comes from compiled kernels, the centre of mass here from Pinocchio on the same knots."""
    chunk = sent(to=(0.3, 0.1, 0.1))
    found = checker.judge.judge(chunk, checker.judge.first_pose(chunk))
    body, model = checker.judge.planner.optimizer.body, checker.judge.planner.model
    support, data = body.footing.support, model.createData()
    room = [support.margin(pin.centerOfMass(model, data, q)[:2]) for q in found.plan.knots.q[1:]]
    balance = next(one for one in found.margins if one.code is Limit.BALANCE)
    assert balance.value == pytest.approx(min(room), abs=1e-6)
    assert balance.time == pytest.approx((1 + int(np.argmin(room))) / 15.0)


def test_a_policy_is_judged_chunk_after_chunk_from_where_its_plans_lead(checker):
    policy = wave()
    verdict = checker.check(policy, "wave", 3.0, start="stance")
    assert verdict.verdict == "feasible"
    assert verdict.start_m < 1e-3
    assert verdict.time_factor == 1.0
    assert max(one.time for one in verdict.margins) > 2.0


def test_the_text_says_how_it_was_judged_and_the_json_keeps_its_schema():
    verdict = judge(sent())
    jsonschema.validate(json.loads(to_json([verdict])), json.loads(verdict_schema().read_text()))
    text = "\n".join(lines(verdict))
    assert "judged   by a preview, nothing simulated" in text
    assert all(ord(letter) < 128 for letter in text)


def test_schema_and_document_know_every_bound():
    codes = json.loads(verdict_schema().read_text())["$defs"]["bound"]["enum"]
    text = (Path(__file__).parents[3] / "docs" / "verdict.md").read_text().partition("| Bound | Unit |")[2]
    assert codes == list(Limit)
    assert re.findall(r"^\| `(\w+)` \| (\S.*?) \| (.+) \|$", text, re.MULTILINE)[: len(Limit)] == [
        (limit, limit.unit or "1", limit.sentence) for limit in Limit
    ]


def test_a_hand_asked_into_the_table_is_infeasible_there_and_feasible_without_one():
    chunk = sent(to=(0.15, 0.0, -0.2))
    assert judge(chunk).verdict == "feasible"
    there = judge(chunk, scene="table")
    assert (there.verdict, there.violations[0].code) == ("infeasible", Reason.SCENE_CONTACT)
    found = margin(there, Limit.SCENE_DISTANCE)
    assert found.subject.startswith("left_")
    assert found.subject.endswith("table")
    assert found.margin < -0.03


def test_a_load_that_is_told_is_planned_for():
    config = ControllerConfig(loads=LoadConfig(source="told", left=2.0))
    bare, loaded = FastChecker().judge, FastChecker(config).judge
    chunk = sent()
    torques = [
        margin(holder.judge(chunk, holder.first_pose(chunk)), Limit.WAIST_TORQUE).value for holder in (bare, loaded)
    ]
    assert loaded.planner.optimizer.body.mass - bare.planner.optimizer.body.mass == pytest.approx(2.0, abs=1e-6)
    # Palms are led to where a still robot holds it, as in the loop.
    assert torques[1] > torques[0] + 0.3


def test_no_step_is_named_that_the_input_does_not_have(checker):
    """While the end is held hands are off as well, at a time after the last step, which is told."""
    policy = ReplayPolicy(sent(to=(0.5, 0.0, 0.0), time=1.6))
    verdict = checker.check(policy, "out of reach", policy.duration + 1.0)
    steps = [one.step for one in (*verdict.violations, *verdict.margins) if one.step is not None]
    assert max(steps) == STEPS - 1
    assert max(one.time for one in verdict.violations) > policy.duration


def test_times_of_margins_are_those_since_the_first_step():
    chunk = sent(to=(0.1, 0.05, 0.1))
    here, later = judge(chunk), judge(replace(chunk, t_obs=7.0))
    assert [one.step for one in later.margins] == [one.step for one in here.margins]
    assert [one.time for one in later.margins] == pytest.approx([one.time for one in here.margins])


def test_a_chunk_with_a_load_is_searched_for_once_from_where_that_is_held(monkeypatch):
    """It was searched for from the first posture, too, and that plan thrown away."""
    judge, chunk, asked = FastChecker(told(2.15)).judge, levelled(), []
    plan = judge.planner.plan
    monkeypatch.setattr(judge.planner, "plan", lambda one, *a, **k: asked.append(one is chunk) or plan(one, *a, **k))
    assert not judge.judge(chunk, judge.first_pose(chunk)).previewed
    assert asked == [False, True]


def test_a_first_plan_takes_over_in_the_tick_in_which_that_of_the_loop_does(monkeypatch):
    """One tick later it is another plan of hands that are on their way: 6 of 200 answers differed."""
    asked, plan = [], ChunkPlanner.plan

    def watched(self, chunk, now, *args, **settings):
        asked.append(now - chunk.t_obs)
        return plan(self, chunk, now, *args, **settings)

    monkeypatch.setattr(ChunkPlanner, "plan", watched)
    policy = ReplayPolicy(stranger(5000).chunk, spec=SPEC)
    assert FastChecker().check(policy, "x", 0.3, start="stance", odds=False).verdict == "feasible"
    Checker(episode=EpisodeConfig(settle=0.1, hold=0.0)).check(policy, "x", 0.15)
    assert asked == pytest.approx([asked[0]] * len(asked), abs=1e-9)
    assert len(asked) >= 2
