"""Strategy: verdicts made by hand for the words, and chunks of several families for what they promise."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from models import g1
from policy.recorded.motion_csv import Motion, motion_chunk
from tests.support.outcome_cases import outcome_case
from tests.support.sent_chunks import sent
from wholebody import judge
from wholebody.planning.judgement.limits import Limit, Margin
from wholebody.types import Reason
from wholebody.verdict.audit.outcome import AuditOutcome
from wholebody.verdict.audit.summary import PAGE, write_summary
from wholebody.verdict.calibration.odds import Chance, Odds
from wholebody.verdict.causes import WouldDo
from wholebody.verdict.page.index import write_index
from wholebody.verdict.plan_run import on_one_scale
from wholebody.verdict.report import lines
from wholebody.verdict.verdict import Verdict
from wholebody.verdict.violations import Severity, Violation
from wholebody.verdict.why.cause import RATES, _of_plan, _worst
from wholebody.verdict.why.findings import NOTHING
from wholebody.verdict.why.headline import headline

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
    return Verdict(name="x", verdict=answer, fell=False, violations=[MOVED], method="fast", **more)


def test_one_line_says_hand_step_bound_by_how_much_what_with_and_without_and_what_would_do():
    change = WouldDo("moved", moved=0.104, hand="left hand", step=49, by=(-0.1, 0.0, -0.03))
    assert headline(verdict(odds=ODDS, would_do=[change])) == (
        "left palm at step 49 (1.63 s) led away by 424 mm (bound 50 mm), out of reach, which is another motion; "
        "with the supervisor the robot stays on its feet and the hands go as near as they can; without the supervisor "
        "a fall is likely (95 %); it would do with the left hand moved by 104 mm (100 mm back at step 49)"
    )


def test_numbers_that_exceed_their_bounds_are_told_with_how_many_times():
    told = "left hand at step 13 (0.43 s): it would have to speed up by 140 m/s^2, and can by 20 m/s^2, 7 times that"
    assert f"because {told}" in headline(verdict(margins=[FAST]))


def test_feasible_beside_a_likely_fall_says_whose_doing_that_is():
    told = headline(Verdict(name="x", verdict="feasible", fell=False, odds=ODDS))
    assert told == "done as given; without the supervisor a fall is likely (95 %)"


def test_the_same_sentence_is_printed_listed_audited_and_in_the_json(tmp_path):
    one = verdict(odds=ODDS)
    told = headline(one)
    assert str(one) == lines(one)[0] == f"INFEASIBLE  x: {told}"
    assert len(str(one)) < 400
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


@pytest.mark.parametrize("number", [9, 15, 28, 53])
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
