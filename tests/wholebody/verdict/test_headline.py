"""Strategy: verdicts made by hand for the words, and chunks of several families for what they promise."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from models import g1
from policy.dataset.inspection import _start
from policy.recorded.motion_csv import Motion, motion_chunk
from policy.recorded.replay import ReplayPolicy, open_recording
from tests.support.outcome_cases import outcome_case
from tests.support.sent_chunks import sent
from tests.support.wide import wide
from wholebody import judge
from wholebody.episode.result import EpisodeResult, Note
from wholebody.episode.run import EpisodeConfig
from wholebody.planning.judgement.limits import Limit, Margin
from wholebody.types import PalmCause, Reason
from wholebody.verdict.audit.outcome import AuditOutcome
from wholebody.verdict.audit.summary import PAGE, write_summary
from wholebody.verdict.calibration.odds import Chance, Odds
from wholebody.verdict.causes import Why, WouldDo
from wholebody.verdict.check import Checker
from wholebody.verdict.fast import FastChecker
from wholebody.verdict.page.index import write_index
from wholebody.verdict.plan_run import on_one_scale
from wholebody.verdict.quantity import at, quantity
from wholebody.verdict.report import lines, violation_line
from wholebody.verdict.verdict import Verdict, verdict_of
from wholebody.verdict.violations import Severity, Violation
from wholebody.verdict.why.cause import RATES, _of_plan, _worst
from wholebody.verdict.why.findings import NOTHING
from wholebody.verdict.why.headline import headline


@pytest.fixture(scope="module")
def checker():
    return FastChecker()


ODDS = Odds(
    fall_as_given=Chance(p=0.95, low=0.9, high=0.98), fall_s=0.0,
    followed=Chance(p=0.1, low=0.0, high=0.2), followed_s=0.0, alarm=True,
    unlike=(), chunks=1, fitted_to=9, world="true",
)  # fmt: skip
MOVED = Violation(
    code=Reason.OUT_OF_REACH, severity=Severity.INFEASIBLE, subject="left palm", time=1.63, step=49, value=0.424,
    bound=0.05, unit="m",
)  # fmt: skip
FAST = Margin(
    code=Limit.HAND_ACCELERATION, subject="left hand", time=0.43, step=13, value=140.0, bound=20.0, unit="m/s^2",
    margin=-120.0, share=-6.0,
)  # fmt: skip


def verdict(answer="infeasible", **more):
    return Verdict(name="x", verdict=answer, fell=False, fps=30.0, violations=[MOVED], method="fast", **more)


def test_one_line_says_hand_row_by_how_much_and_what_would_do_and_the_lines_below_the_rest():
    """It had 450 characters."""
    change = WouldDo("moved", moved=0.104, hand="left hand", step=49, by=(-0.1, 0.0, -0.03))
    found = verdict(odds=ODDS, would_do=[change])
    assert headline(found) == (
        "left hand 424 mm off at row 49 (1.63 s), 50 mm allowed: out of reach; would do: left hand 100 mm back"
    )
    assert lines(found)[1:3] == [
        "  robot    with the supervisor it stays on its feet and its hands go as near as they can; "
        "without the supervisor a fall is likely (95 %)",
        "  would do with the left hand moved by 104 mm (100 mm back at row 49)",
    ]


@pytest.mark.parametrize("name", ["x.npz", "/a/folder/with/a/long/name/" * 6 + "chunk_0017.npz"])
def test_the_first_line_fits_two_lines_of_a_terminal_and_keeps_the_end_of_a_name(name):
    cause = "left_hand_thumb_0_link - right_hand_thumb_1_link"
    member = replace(FAST, code=Limit.SELF_DISTANCE, subject=cause, unit="m")
    why = Why(codes=(Limit.SELF_DISTANCE,), members=(member,), time=1.63, irreducible=True, sentence="")
    refused = replace(MOVED, code=Reason.REFUSED, subject="not_joined: " + "no motion leads to the chunk yet " * 9)
    for more in ({}, {"causes": [why]}, {"margins": [FAST]}, {"odds": ODDS}, {"violations": [refused]}):
        one = replace(verdict(), name=name, **more)
        assert len(str(one)) <= 160
        assert f"{name[-8:]}: " in str(one)


def test_one_clock_and_rows_of_the_file_that_a_person_has(checker, tmp_path):
    """A headline said 0.10 s and its violation 1.10 s; rows were steps of 30 Hz, also of a file with 60."""
    joints = np.tile(g1().stance.joints[:29], (120, 1))
    joints[61:, 15] -= 1.2
    table = np.hstack([np.tile([0.0, 0.0, 0.79, 0.0, 0.0, 0.0, 1.0], (120, 1)), joints])
    np.savetxt(tmp_path / "m.csv", table, fmt="%.6f", delimiter=",")
    policy = open_recording(tmp_path / "m.csv", fps=60.0)
    slow, _ = Checker(episode=EpisodeConfig(hold=0.2)).check(policy, "m", policy.duration)
    fast = checker.check(policy, "m", policy.duration, start="stance", odds=False)
    assert slow.verdict != "feasible"
    for found in (slow, fast):
        assert found.fps == pytest.approx(60.0)
        timed = [one for one in found.violations if one.step not in (None, 119)]
        assert timed
        for one in timed:
            assert one.step == pytest.approx(60.0 * one.time, abs=1.01)
            assert f"row {one.step} ({one.step / 60.0:.2f} s)" in violation_line(one, found.fps)


def test_a_motion_that_only_begins_elsewhere_is_told_what_begins_there(checker):
    """A far start looked like an error of 400 mm and a jerk."""
    joints = np.tile(g1().stance.joints[:29], (121, 1))
    joints[:, 15] -= 1.2
    chunk = motion_chunk(Motion(60.0, np.tile(np.eye(4), (121, 1, 1)), joints))
    found = checker.check(ReplayPolicy(chunk), "m", 2.0, start="stance", odds=False)
    assert found.verdict == "feasible_after_repair"
    assert re.match(r"done, but it begins 42\d mm from the hands, which take 1\.\d s to get there", found.headline)
    assert found.headline.endswith("would do: begun at its row 0 (--start first)")
    assert [one.kind for one in found.would_do] == ["start"]
    assert found.max_m < 0.02 < found.start_m
    shown = [line for line in lines(found) if "reach:" in line or "orientation:" in line]
    assert not shown, "the way to the first row is none of the room that is left"


def test_what_is_told_of_a_whole_file_has_no_time():
    """A file's rate was assumed "at 1.00 s (step 0)"."""
    found = EpisodeResult(start=1.0, fps=30.0, notes=[Note(1.0, "the file does not say its frame rate")])
    (note,) = [one for one in verdict_of("m", found).violations if one.code is Reason.CHUNK_NOTE]
    assert (note.time, note.step) == (None, None)
    assert violation_line(note, 30.0) == "chunk_note: the file does not say its frame rate"


def test_doubts_about_the_numbers_stand_in_the_first_line_of_what_is_feasible():
    text = (
        "it looks as if the joints are in breadth-first order, Isaac's: the 27 columns fit then; --read-as isaac_order"
    )
    note = Violation(code=Reason.CHUNK_NOTE, severity=Severity.NOTE, subject=text)
    one = Verdict(name="x", verdict="feasible", fell=False, violations=[note])
    assert one.headline == ("done as given, but note: it looks as if the joints are in breadth-first order, Isaac's")


@pytest.mark.parametrize(
    ("value", "unit", "said"),
    [
        (4150.0, "m/s^3", "4150 m/s^3"),
        (13512.0, "m/s^3", "13500 m/s^3"),
        (1e-6, "m", "0.001 mm"),
        (0.0123, "m", "12.3 mm"),
    ],
)
def test_numbers_have_no_exponent(value, unit, said):
    """A person read 4.15e+03."""
    assert quantity(value, unit) == said


def test_what_came_after_the_last_row_is_told_from_there():
    assert at(3.75, 49, 30.0) == " 2.1 s after the last row (49)"
    assert at(1.64, 49, 30.0) == " at row 49 (1.63 s)"
    assert at(None, None, 30.0) == ""


def test_numbers_that_exceed_their_bounds_are_told_with_how_many_times():
    told = "left hand at row 13 (0.43 s): it speeds up by 140 m/s^2, can by 20 m/s^2 (7 times)"
    assert headline(verdict(margins=[FAST])) == told
    jerk = replace(FAST, code=Limit.HAND_JERK, value=6000.0, bound=600.0, unit="m/s^3", margin=-1.0, share=-9.0)
    assert headline(verdict(margins=[jerk, FAST])) == told, "the one that needs the largest slow-down"


def test_feasible_beside_a_likely_fall_says_whose_doing_that_is():
    told = headline(Verdict(name="x", verdict="feasible", fell=False, odds=ODDS))
    assert told == "done as given; without the supervisor a fall is likely (95 %)"


def test_the_same_sentence_is_printed_listed_audited_and_in_the_json(tmp_path):
    one = verdict(odds=ODDS)
    told = headline(one)
    assert str(one) == lines(one)[0] == f"INFEASIBLE  x: {told}"
    assert len(str(one)) <= 160
    assert one.as_dict()["headline"] == told
    write_index(tmp_path / "index.html", [one], {})
    (tmp_path / "audit").mkdir()
    write_summary(tmp_path / "audit", [AuditOutcome(name="x", ending="judged", verdict=one.as_dict())])
    for page in (tmp_path / "index.html", tmp_path / "audit" / PAGE):
        assert told in page.read_text()


def test_the_worst_number_is_the_one_that_needs_the_largest_slow_down():
    """An acceleration seven times too large was told as a speed 1.01 times too large."""
    speed = replace(FAST, code=Limit.HAND_SPEED, value=2.53, bound=2.5, unit="m/s", margin=-0.03, share=-1.0)
    jerk = replace(FAST, code=Limit.HAND_JERK, value=600.0 * 1.5**3, bound=600.0, unit="m/s^3", margin=-1.0)
    margins = {one.code: one for one in (speed, FAST, jerk)}
    assert _worst(margins, RATES[0]) == [FAST]
    assert _worst({Limit.HAND_SPEED: replace(speed, margin=0.1)}, RATES[0]) == []


def test_shares_are_on_one_scale_on_which_the_sign_decides():
    """Feasible chunks had -1.65, where the documents said that less than -1 is a no."""
    balance = replace(FAST, code=Limit.BALANCE, unit="m")
    assert on_one_scale(replace(balance, share=-0.4), feasible=False).share == pytest.approx(0.6)
    assert on_one_scale(replace(balance, share=-1.5), feasible=False).share == pytest.approx(-0.5)
    assert on_one_scale(FAST, feasible=False).share == pytest.approx(-6.0)
    assert on_one_scale(FAST, feasible=True).share == 0.0
    for number in (1, 4, 7, 9, 15, 20, 25, 39):
        found = judge(outcome_case(number).chunk)
        assert (min(one.share for one in found.margins) >= 0.0) == (found.verdict == "feasible"), number


@pytest.mark.parametrize("number", [15, *wide(9, 28, 53)])
def test_what_would_do_does_when_it_is_done_and_places_are_where_the_chunk_goes(number):
    """Of six slow-downs three were not feasible when applied, and 25 of 44 chunks got no suggestion."""
    chunk = outcome_case(number).chunk
    found = judge(chunk, ask_why=True)
    assert found.verdict == "infeasible"
    changes = [one for one in found.would_do if one.chunk is not None]
    assert changes
    for one in changes:
        assert judge(one.chunk).verdict == "feasible", one
    for cause in found.causes:
        assert 0.0 <= cause.time <= chunk.times[-1] - chunk.t_obs + 1e-9


def test_a_chunk_that_ends_in_motion_is_not_told_of_where_it_would_have_gone_on_to():
    """The left hand was told to be 1.12 m ahead, where the chunk has 0.38."""
    chunk = sent(to=(0.4, 0.0, 0.0))
    steps = np.arange(90) / 45.0
    targets = SimpleNamespace(steps=steps, T_palms=np.full((90, 2, 4, 4), 9.0))
    nearest = SimpleNamespace(worst=(1.0, 80, 0), targets=targets)
    palms = np.zeros((len(chunk), 2, 3))
    palms[:, 0, 0] = np.linspace(0.2, 0.38, len(chunk))
    program = SimpleNamespace(
        chunk=chunk, nearest=lambda known: (nearest, known), find=lambda _, known, **__: (None, known),
        margins=lambda _: [], reach=lambda _: FAST, judge=SimpleNamespace(asked=lambda _: (palms, None)),
    )  # fmt: skip
    cause, _ = _of_plan(program, frozenset(), NOTHING)
    time, side, place = cause.where
    assert (side, place) == (0, (0.38, 0.0, 0.0))
    assert time == pytest.approx((len(chunk) - 1) / chunk.fps)


@pytest.mark.parametrize(("far", "turned", "said"), [(3.3, 0.0, "travel 3.3 m"), (0.0, 90.0, "turn by 90 deg")])
def test_a_motion_whose_feet_go_elsewhere_is_the_hands_alone_and_at_best_after_repair(far, turned, said):
    """A walk of 3.3 m was feasible, and nothing said that root and legs are left out."""
    base = np.tile(np.eye(4), (121, 1, 1))
    base[:, 0, 3] = np.linspace(0.0, far, 121)
    yaw = np.deg2rad(np.linspace(0.0, turned, 121))
    base[:, 0, 0], base[:, 0, 1], base[:, 1, 0], base[:, 1, 1] = np.cos(yaw), -np.sin(yaw), np.sin(yaw), np.cos(yaw)
    joints = np.tile(g1().stance.joints[:29], (121, 1))
    chunk = motion_chunk(Motion(60.0, base, joints))
    assert chunk.notes == (f"hands only: the feet of this motion {said}",)
    found = judge(chunk)
    assert found.verdict == "feasible_after_repair"
    assert found.headline.startswith(f"{chunk.notes[0]}; the hands do it as given")
    still = np.tile(np.eye(4), (121, 1, 1))
    still[:, 0, 3] = np.linspace(0.0, 0.1, 121)
    assert motion_chunk(Motion(60.0, still, joints)).notes == ()


def test_a_jump_is_told_at_the_last_row_before_it():
    """An acceleration was told at the first of the rows that make it, up to three before a jump."""
    chunk = sent(to=(0.0, 0.0, 0.0))
    chunk.T_world_lhand[30:, 2, 3] += 0.1
    margins = {one.code: one for one in judge(chunk).margins}
    rates = [margins[code] for code in (Limit.HAND_SPEED, Limit.HAND_ACCELERATION, Limit.HAND_JERK)]
    assert all(one.margin < 0.0 for one in rates)
    assert [one.step for one in rates] == [29, 29, 29]


def test_of_a_hand_that_comes_nearly_there_the_first_line_says_once_how_far_off_it_is():
    """It said so for each reason anew, and had no room for what would do."""
    off = {"severity": Severity.REPAIR, "subject": "right palm", "time": 0.0, "step": 0, "bound": 0.02, "unit": "m"}
    found = [
        Violation(code=Reason.OUT_OF_REACH, value=0.03, **off),
        Violation(code=Reason.PALM_MOVED, cause=PalmCause.POSITION, value=0.025, **off),
        Violation(code=Reason.PALM_MISSED, cause=PalmCause.LATE, value=0.03, **off),
    ]
    text = replace(verdict("feasible_after_repair"), violations=found).headline
    assert text.startswith("done, but right hand 30 mm off at row 0 (0.00 s), 20 mm is as given: out of reach")
    assert text.count("right hand") == 1


def test_a_first_row_far_from_the_measured_pose_is_told_with_what_it_may_be():
    """The first line ended before it said so."""
    (found,) = _start(["waist_yaw_joint"], np.full((9, 1), 0.5), {"waist_yaw_joint": 0.0})
    note = Violation(code=Reason.CHUNK_NOTE, severity=Severity.NOTE, subject=found.sentence)
    text = replace(verdict("feasible"), violations=[note]).headline
    assert text.endswith("from the measured pose in q0_joints, a jump or numbers relative to it")
