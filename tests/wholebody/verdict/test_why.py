"""Strategy: chunks that break one thing by construction. What a cause claims is checked: with the set there is no plan,
without any one member the plan that was kept keeps all the others and has the palms where they are asked to be.
"""

import json
from dataclasses import asdict, replace

import jsonschema
import numpy as np
import pytest

from tests.support.proof import proves
from tests.support.sent_chunks import sent
from tests.support.verdict_agreement import case
from wholebody.planning.judgement.limits import Limit, Margin
from wholebody.resources import verdict_schema
from wholebody.verdict.causes import WouldDo
from wholebody.verdict.fast import FastChecker
from wholebody.verdict.given.own_numbers import judge
from wholebody.verdict.report import lines, to_json
from wholebody.verdict.verdict import Verdict
from wholebody.verdict.why import explainer
from wholebody.verdict.why.cause import causes
from wholebody.verdict.why.chunk_program import STARTS, ChunkProgram
from wholebody.verdict.why.motion_search import EVERY, NAMES
from wholebody.verdict.why.tick import TickProver


@pytest.fixture(scope="module")
def holder():
    return FastChecker().judge


def found(holder, chunk):
    program = ChunkProgram(holder, chunk)
    return program, causes(program)[0]


def test_what_can_be_done_has_no_cause(holder):
    assert found(holder, sent())[1] == []


def test_two_metres_away_nothing_but_reach_says_no(holder):
    (one,) = found(holder, sent(to=(2.0, 0.0, 0.0), time=1.5))[1]
    assert (one.kinds, one.irreducible) == ((Limit.REACH,), True)
    assert one.members[0].value > 1.0


def test_without_any_one_member_the_plan_that_was_kept_keeps_all_the_others(holder):
    program, (one, *_) = found(holder, sent(to=(0.5, 0.0, 0.0), time=1.5))
    assert one.irreducible
    assert {Limit.BALANCE} < set(one.kinds)
    fresh = ChunkProgram(holder, program.chunk)
    motion, known = fresh.find(frozenset(one.kinds), thorough=True)
    assert motion is None
    assert known.searches >= STARTS
    for left_out, witness in one.witnesses.items():
        kept = set(one.kinds) - {left_out}
        exceeded = {NAMES[margin.code] for margin in program.margins(witness) if margin.share < -1.0}
        off = witness.knots.T_palms[program.first :, :, :3, 3] - witness.targets.T_palms[program.first :, :, :3, 3]
        assert left_out in exceeded
        assert not kept & exceeded
        assert np.linalg.norm(off, axis=2).max() <= 0.02


def test_what_is_found_is_returned_and_a_search_without_it_begins_anew(holder):
    """What was found was kept in the program: what it answered hung on what it had been asked before."""
    program = ChunkProgram(holder, sent(to=(2.0, 0.0, 0.0), time=1.5))
    motion, known = program.find(EVERY)
    _, anew = program.find(EVERY)
    assert motion is None
    assert anew.searches == known.searches > 0
    assert anew.nearest is not known.nearest
    assert program.find(EVERY, known)[1] is known


def test_a_finger_and_the_floor_are_causes_by_themselves(holder):
    chunk = sent(to=(0.1, 0.0, -0.9), time=1.3)
    chunk.q_rhand[:, 0] = 4.0
    kinds = [one.kinds for one in found(holder, chunk)[1]]
    assert kinds[:2] == [(Limit.FINGER_RANGE,), (Limit.INTO_FLOOR,)]


def test_a_chunk_that_moves_at_once_is_too_sudden_for_hands_at_rest():
    """Its own steps keep every bound: what it takes to come along from the first one on is the cause."""
    chunk = sent(to=(0.0, 0.0, 0.0))
    chunk.T_world_lhand[:, 0, 3] += 0.1 * np.sin(4.0 * np.pi * chunk.times)
    verdict = judge(chunk, ask_why=True)
    (one,) = verdict.causes
    assert verdict.verdict == "feasible_after_repair"
    assert (one.codes, one.members[0].step) == ((Limit.HAND_ACCELERATION,), 0)
    assert one.members[0].value == pytest.approx(0.1 * np.sin(4.0 * np.pi / chunk.fps) * chunk.fps**2)
    assert "since its first rows move already" in one.sentence


def test_where_no_bound_forbids_what_the_plan_does_not_do_that_is_said(holder):
    _, chunk = case(29, "")
    verdict = judge(chunk, ask_why=True)
    assert verdict.verdict == "feasible" or verdict.search_finds == (not verdict.causes)
    said = lines(replace(verdict, causes=[], search_finds=True))
    assert any("finds a motion" in line for line in said)


def test_what_is_proven_of_a_tick_holds_for_the_checker_of_the_document(in_the_other):
    tick = json.loads(to_json([in_the_other]))[0]["tick"]
    assert tick["proven"]
    assert proves(tick)
    assert not proves(tick | {"weights": [1.0001 * tick["weights"][0], *tick["weights"][1:]]})
    assert any(row.startswith("distance.") for row in tick["rows"])
    assert any(line.strip().startswith("proven   at") for line in lines(in_the_other))


def apart(code, value):
    return Margin(
        code=code, subject="left_elbow_link - torso_link", time=0.5, step=15, value=value, bound=0.014, unit="m",
        margin=value - 0.014, share=-2.0,
    )  # fmt: skip


@pytest.mark.parametrize("code", [Limit.SELF_DISTANCE, Limit.FLOOR_DISTANCE, Limit.SCENE_DISTANCE])
def test_bodies_in_each_other_are_no_bound_with_which_it_would_do(code):
    assert not explainer.makes_sense(WouldDo("bound", bound=apart(code, -0.07)))
    assert explainer.makes_sense(WouldDo("bound", bound=apart(code, 0.01)))
    assert explainer.makes_sense(WouldDo("bound", bound=apart(Limit.BALANCE, -0.02)))


def test_a_hand_moved_across_the_room_is_not_offered():
    assert explainer.makes_sense(WouldDo("combined", slower=2.9, moved=0.149))
    assert not explainer.makes_sense(WouldDo("moved", moved=0.434))
    assert not explainer.makes_sense(WouldDo("slower", slower=3.6))


def test_a_hand_in_the_other_one_is_not_offered_as_a_bound(in_the_other):
    assert not any(change.kind == "bound" for change in in_the_other.would_do)


def test_where_the_tick_has_a_solution_nothing_is_proven_and_what_limits_is_told(holder):
    program = ChunkProgram(holder, sent(to=(0.5, 0.0, 0.0), time=1.4))
    tick = TickProver(holder.spec, holder.config).of(program, program.nearest()[0])
    assert not tick.proven
    assert tick.A == []
    assert tick.rows[0].startswith("balance.")
    assert not proves(asdict(tick))


@pytest.fixture(scope="module")
def in_the_other():
    return judge(sent(to=(0.0, -0.45, 0.0), time=1.3), ask_why=True)


def test_a_hand_in_the_other_one_is_told_in_a_sentence_and_in_json(in_the_other):
    verdict = in_the_other
    one = verdict.causes[0]
    assert (one.codes, one.irreducible) == ((Limit.SELF_DISTANCE,), True)
    assert {"left", "right"} == {body.split("_")[0] for body in one.members[0].subject.split(" - ")}
    jsonschema.validate(json.loads(to_json([verdict])), json.loads(verdict_schema().read_text()))
    line = next(line for line in lines(verdict) if "because" in line)
    assert line.startswith("  because  left hand 0.2")
    assert "to the right" in line
    assert "are as close as they may be (14 mm)" in line


def test_without_being_asked_nobody_looks_for_causes():
    assert judge(sent(to=(2.0, 0.0, 0.0), time=1.5)).causes == []


@pytest.mark.regression
def test_where_the_time_ended_before_all_was_looked_for_that_is_said(monkeypatch):
    monkeypatch.setattr(explainer, "CAUSES_WORK", 0.0)
    monkeypatch.setattr(explainer, "WHY_WORK", 0.0)
    verdict = judge(sent(to=(0.0, -0.45, 0.0), time=1.3), ask_why=True)
    assert [one.codes for one in verdict.causes] == [(Limit.SELF_DISTANCE,)]
    assert not verdict.why_complete
    assert any("there may be more causes" in line for line in lines(verdict))


@pytest.mark.regression
def test_what_is_found_side_by_side_is_what_is_found_one_after_the_other():
    """Searches from several starts go on in threads, each with a judge of its own, as many as there are cores."""
    checker, chunk = FastChecker(), sent(to=(0.5, 0.0, 0.0), time=1.5)
    begin, answers = checker.judge.first_pose(chunk), []
    for twins in (0, 2):
        checker.explainer = explainer.Explainer(checker.judge, [FastChecker().judge for _ in range(twins)])
        answers.append(checker.of_chunk(chunk, begin, "chunk", (False, False), ask_why=True))
    assert answers[0].causes
    assert answers[0] == answers[1]


@pytest.mark.regression
def test_a_search_that_is_given_up_has_no_cause_and_says_so(monkeypatch):
    for work in ("SET_WORK", "CAUSES_WORK", "WHY_WORK"):
        monkeypatch.setattr(explainer, work, 0.0)
    verdict = judge(sent(to=(0.0, -0.45, 0.0), time=1.3), ask_why=True)
    assert verdict.verdict == "infeasible"
    assert (verdict.causes, verdict.why_complete, verdict.search_finds) == ([], False, False)
    assert any("no cause was found yet" in line for line in lines(verdict))


def test_every_change_that_would_do_is_in_one_line_and_the_first_in_the_headline():
    bound = Margin(
        code=Limit.ZMP, subject="front edge of the soles", time=1.4, step=42, value=0.02, bound=0.028, unit="m",
        margin=-0.008, share=-2.0,
    )  # fmt: skip
    changes = [WouldDo("slower", slower=1.3), WouldDo("moved", moved=0.06), WouldDo("bound", bound=bound)]
    verdict = Verdict(name="x", verdict="infeasible", fell=False, would_do=changes)
    assert verdict.headline.endswith("would do: 1.30 times slower")
    told = [line for line in lines(verdict)[1:] if "would do" in line]
    assert told == [
        "  would do 1.30 times slower, or with a hand moved by 60 mm, or with zmp of front edge of the soles at 20 mm "
        "where the bound is 28 mm"
    ]
