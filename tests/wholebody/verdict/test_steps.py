"""Strategy: a chunk that ends out of reach is told from where it is in reach; steps of a run are told and written."""

import json

import jsonschema
import numpy as np
import pytest

from policy.recorded.replay import ReplayPolicy
from policy.scripted.library import scripted_policy
from policy.scripted.policy import to_chunk
from wholebody.planning.reachability.standing_place import stand_for
from wholebody.resources import verdict_schema
from wholebody.sim.limit_monitor import StepMade
from wholebody.verdict.fast import FastChecker
from wholebody.verdict.quantity import stepped
from wholebody.verdict.report import lines, to_json
from wholebody.verdict.verdict import Verdict
from wholebody.verdict.why.sentence import change_text
from wholebody.verdict.why.steps import with_steps

TIMES = np.arange(50) / 25.0


def far(x, z):
    return to_chunk(scripted_policy("walk_reach", x=x, z=z).script(TIMES + 1.0), "wbc32", 0, 0.0, 25.0, 50)


@pytest.fixture(scope="module")
def checker():
    return FastChecker()


def checked(checker, chunk):
    policy = ReplayPolicy(chunk)
    return checker.check(policy, "far", policy.duration, start="stance", odds=False)


def test_a_chunk_out_of_reach_would_do_from_where_a_posture_reaches(checker):
    chunk = far(0.8, 0.8)
    verdict = with_steps(checked(checker, chunk), chunk, checker.judge, checker.config)
    (one,) = verdict.would_do
    assert one.kind == "steps"
    assert one.steps >= 2
    assert one.chunk is None
    place = stand_for(chunk.T_world_lhand[-1], chunk.T_world_rhand[-1], one.base)
    assert (place.reached, place.steps) == (True, 0)
    assert change_text(one).startswith(f"with {one.steps} steps to x {one.base[0]:.2f} m, y {one.base[1]:.2f} m")
    jsonschema.validate(json.loads(to_json([verdict])), json.loads(verdict_schema().read_text()))


@pytest.mark.parametrize(("x", "z"), [(0.35, 0.9), (0.6, 2.2)])
def test_nothing_is_said_of_steps_where_none_are_needed_or_none_help(checker, x, z):
    chunk = far(x, z)
    verdict = with_steps(checked(checker, chunk), chunk, checker.judge, checker.config)
    assert not [one for one in verdict.would_do if one.kind == "steps"]


def test_steps_that_were_made_are_told_and_written():
    made = [StepMade("left" if k % 2 else "right", 0.7 * k, 0.1 * k, 0.1, 0.0, 1e-3 * k, 400.0 + k) for k in range(6)]
    verdict = Verdict(name="walked", verdict="feasible", fell=False, steps=made)
    (line,) = (text for text in lines(verdict) if text.startswith("  steps"))
    assert line.endswith(stepped(made))
    assert "6: the last right (0.20, 0.10), left (0.30, 0.10)" in line
    assert "slid 5.0 mm at most, a landing pressed with 405 N" in line
    jsonschema.validate(json.loads(to_json([verdict])), json.loads(verdict_schema().read_text()))
    assert not [text for text in lines(Verdict(name="stood", verdict="feasible", fell=False)) if "steps" in text]
