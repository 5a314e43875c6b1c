"""Strategy: violations by hand, in the order in which an episode has them: the worst first."""

import json

import jsonschema
import pytest

from wholebody.resources import verdict_schema
from wholebody.types import PalmCause, Reason
from wholebody.verdict.consequences import FALLING, folded
from wholebody.verdict.report import lines, to_json
from wholebody.verdict.verdict import Verdict
from wholebody.verdict.violations import Severity, Violation


def one(code, severity, time, subject="", cause=None):
    return Violation(code=code, cause=cause, severity=severity, subject=subject, time=time)


FALL = one(Reason.FALL, Severity.INFEASIBLE, 2.0, "pelvis on the floor")
OVERLOAD = [one(Reason.TORQUE_LIMIT, Severity.REPAIR, 1.9, joint) for joint in ("left_knee_joint", "right_knee_joint")]


def came_of(found):
    return [(x.code, x.came_of) for x in folded(found)]


def test_what_motors_are_asked_for_while_the_robot_falls_is_listed_under_the_fall():
    reach = one(Reason.OUT_OF_REACH, Severity.INFEASIBLE, 1.0)
    assert came_of([FALL, reach, *OVERLOAD]) == [
        (Reason.FALL, None),
        (Reason.TORQUE_LIMIT, Reason.FALL),
        (Reason.TORQUE_LIMIT, Reason.FALL),
        (Reason.OUT_OF_REACH, None),
    ]


def test_what_began_before_the_robot_fell_stands_for_itself():
    early = one(Reason.TORQUE_LIMIT, Severity.REPAIR, FALL.time - FALLING - 0.1)
    assert came_of([FALL, early]) == [(Reason.FALL, None), (Reason.TORQUE_LIMIT, None)]


def test_hands_that_are_dropped_after_a_chunk_was_not_joined_are_a_consequence_of_that():
    refused = one(Reason.REFUSED, Severity.INFEASIBLE, 0.5, "not_joined: no balanced motion leads to it")
    dropped = one(Reason.HANDS_DROPPED, Severity.REPAIR, 0.7)
    assert came_of([refused, dropped])[1] == (Reason.HANDS_DROPPED, Reason.REFUSED)
    assert came_of([refused, one(Reason.HANDS_DROPPED, Severity.REPAIR, 0.2)])[1] == (Reason.HANDS_DROPPED, None)


def test_what_is_worse_than_what_it_followed_on_is_no_mere_consequence():
    slow = one(Reason.TOO_FAST_FOR_BALANCE, Severity.NOTE, 0.0)
    late = one(Reason.PALM_MISSED, Severity.REPAIR, 1.0, cause=PalmCause.LATE)
    assert came_of([late, slow]) == [(Reason.PALM_MISSED, None), (Reason.TOO_FAST_FOR_BALANCE, None)]


@pytest.mark.parametrize("count", [1, 2])
def test_in_the_terminal_a_cause_has_one_line_of_what_came_of_it(count):
    verdict = Verdict(name="x", verdict="infeasible", fell=True, violations=folded([FALL, *OVERLOAD[:count]]))
    text = lines(verdict)
    assert text[1] == "  fall: pelvis on the floor at 2.00 s"
    assert text[2] == f"    of which came torque_limit{' 2 times' if count == 2 else ''}"
    assert not any(line.startswith("  torque_limit") for line in text)
    told = json.loads(to_json([verdict]))
    jsonschema.validate(told, json.loads(verdict_schema().read_text()))
    assert [x["came_of"] for x in told[0]["violations"]] == [None] + count * ["fall"]
