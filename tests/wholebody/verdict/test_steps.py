"""Strategy: a chunk that is out of reach is told from where it is feasible, which is checked by moving the robot's
world under it; steps of a run are told and written.
"""

import json
from dataclasses import replace

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
from wholebody.verdict.why.steps import seen_from

TIMES = np.arange(50) / 25.0


def reaching(x, z):
    """Palms that go from here to a place ahead."""
    return to_chunk(scripted_policy("walk_reach", x=x, z=z).script(TIMES + 1.0), "wbc32", 0, 0.0, 25.0, 50)


def lifting(x, z):
    """Palms that go up by 0.1 m at a place ahead."""
    motion = scripted_policy("walk_reach", x=x, z=z).script(np.full(50, 100.0))
    up = 0.1 * np.linspace(0.0, 1.0, 50)[:, None] * [0.0, 0.0, 1.0]
    motion = replace(motion, p_world_lpalm=motion.p_world_lpalm + up, p_world_rpalm=motion.p_world_rpalm + up)
    return to_chunk(motion, "wbc32", 0, 0.0, 25.0, 50)


@pytest.fixture(scope="module")
def checker():
    return FastChecker()


def checked(checker, chunk):
    policy = ReplayPolicy(chunk)
    return checker.check(policy, "far", policy.duration, start="stance", odds=False)


def stepped_to(checker, chunk):
    """The verdict on a chunk with the steps that would do."""
    return checker._with_steps(checked(checker, chunk), chunk, (False, False))


def test_a_chunk_out_of_reach_would_do_from_where_it_is_feasible(checker):
    chunk = lifting(0.8, 0.8)
    verdict = stepped_to(checker, chunk)
    (one,) = verdict.would_do
    assert one.kind == "steps"
    assert one.steps >= 2
    assert one.chunk is None
    place = stand_for(chunk.T_world_lhand[-1], chunk.T_world_rhand[-1], one.base)
    assert (place.reached, place.steps) == (True, 0)
    assert change_text(one).startswith(f"begun from x {one.base[0]:.2f} m, y {one.base[1]:.2f} m")
    assert change_text(one).endswith(f": {one.steps} steps from here")
    moved = ReplayPolicy(seen_from(one.base, (0.0, 0.0, 0.0), chunk))
    assert checker.check(moved, "from there", moved.duration, start="first", odds=False).verdict == "feasible"
    jsonschema.validate(json.loads(to_json([verdict])), json.loads(verdict_schema().read_text()))


@pytest.mark.parametrize("chunk", [reaching(0.35, 0.9), reaching(0.6, 2.2), lifting(0.6, 2.2), reaching(1.2, 0.8)])
def test_nothing_is_said_of_steps_where_none_are_needed_or_none_help_all_of_it(checker, chunk):
    verdict = stepped_to(checker, chunk)
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
