"""Strategy: chunks of strangers to whom a change was offered that did not do, or none; each change that is offered is
judged again by a checker that knows nothing of it, after it went through the numbers of its layout.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from policy.action_spec.builtin import builtin
from policy.action_spec.codec import decode, encode
from policy.recorded.replay import ReplayPolicy
from tests.support.sent_chunks import STANCE, sent
from tests.support.stranger_chunks import SPEC, stranger, told_of
from tests.support.wide import wide
from wholebody.planning.judgement.limits import Limit
from wholebody.verdict.fast import FastChecker
from wholebody.verdict.given.own_numbers import judge
from wholebody.verdict.report import lines
from wholebody.verdict.why.chunk_program import ChunkProgram

RATES = {Limit.HAND_SPEED, Limit.HAND_ACCELERATION, Limit.HAND_JERK}


@cache
def asked(number):
    """The fast verdict on a stranger of a number that begins in the stance, with its reasons; not to be changed."""
    case = stranger(number)
    policy = ReplayPolicy(case.chunk, spec=SPEC)
    return FastChecker(told_of(case.loads)).check(policy, case.family, policy.duration, start="stance", ask_why=True)


@pytest.mark.parametrize("number", [38, *wide(60)])
def test_what_would_do_is_a_change_of_all_of_a_recording_and_does_when_it_is_checked(number):
    """Half of a recording was changed, begun as its other half leads there: alone, it was 0.4 m from the hands."""
    case = stranger(number)
    changes = [one for one in asked(number).would_do if one.chunk is not None]
    assert changes
    for one in changes:
        assert len(one.chunk) >= len(case.chunk)
        chunk = decode(SPEC, encode(SPEC, one.chunk, STANCE), STANCE, fps=one.chunk.fps)
        again = ReplayPolicy(chunk, spec=SPEC)
        verdict = FastChecker(told_of(case.loads)).check(again, "", again.duration, start="stance")
        assert verdict.verdict == "feasible", (one, lines(verdict)[0])


def test_a_recording_that_ends_in_motion_is_not_said_to_stop_too_suddenly():
    """The jerk of holding its last step was named as its cause: to stop there is the plan's part."""
    case = stranger(38)
    verdict = asked(38)
    assert verdict.causes
    room = {one.code: one for one in verdict.margins}
    assert all(room[code].margin > 0.0 for code in RATES)
    assert not any(set(one.codes) & RATES for one in verdict.causes)
    assert all(one.time <= case.chunk.times[-1] for one in verdict.causes)


def test_a_load_that_plans_leave_room_for_and_a_motor_holds_is_done_as_given():
    """A wrist of the start spends more than plans may, and less than it has: no plan changes that, and in simulation
    the palm stays within 2.2 mm. It was said to be out of reach."""
    assert asked(83).verdict == "feasible"


@pytest.mark.parametrize(("column", "value", "layout"), [(18, 1.2, "wbc32"), (18, 1.2, "wbc27")])
def test_a_chunk_with_clipped_numbers_would_do_with_these_in_their_range(column, value, layout):
    """Nothing was offered: the changed chunk was still said to have been clipped."""
    spec = builtin(layout)
    actions = encode(spec, sent(to=(0.05, 0.0, 0.05)), STANCE)
    actions[10:, column] = value
    verdict = judge(actions, layout=layout, ask_why=True)
    assert verdict.verdict == "feasible_after_repair"
    (one,) = [change for change in verdict.would_do if change.chunk is not None]
    assert one.moved < 1e-3
    assert "would do: its numbers in their range" in lines(verdict)[0]
    assert judge(one.chunk).verdict == "feasible"
    assert judge(encode(spec, one.chunk, STANCE), layout=layout).verdict == "feasible"


def test_a_chunk_that_is_judged_at_once_would_do_so_and_played_back():
    verdict = judge(sent(to=(0.44, 0.0, 0.25), time=1.2), ask_why=True)
    changes = [one for one in verdict.would_do if one.chunk is not None]
    assert verdict.verdict != "feasible"
    assert changes
    for one in changes:
        policy = ReplayPolicy(replace(one.chunk, t_obs=0.0))
        assert judge(one.chunk).verdict == "feasible"
        assert FastChecker().check(policy, "", policy.duration).verdict == "feasible"


def test_the_nearest_motion_is_told_by_what_it_lacks_most():
    """A palm 455 mm off, and turned as asked, was "-9.79 deg away"."""
    checker = FastChecker()
    program = ChunkProgram(checker.judge, stranger(33).chunk)
    nearest, _ = program.nearest()
    one = program.reach(nearest)
    assert (one.code, one.margin < 0.0) == (Limit.REACH, True)
    assert np.isclose(one.value, one.bound * nearest.worst[0])
