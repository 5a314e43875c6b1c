"""Strategy: what chunks come to in a simulation, with plans and without."""

import numpy as np

from models import g1
from policy.chunk import ActionChunk
from tests.support.hostile_chunks import hostile_chunk
from tests.support.sent_chunks import sent
from wholebody.episode.run import EpisodeConfig
from wholebody.sim.plant import MujocoPlant
from wholebody.types import RobotState
from wholebody.verdict.check import Checker
from wholebody.verdict.fast import FastChecker
from wholebody.verdict.trial import as_given, run_chunk


def jumps() -> ActionChunk:
    return hostile_chunk("jump", np.random.default_rng(6), 0, 0.0)


def test_what_falls_as_given_does_not_fall_as_it_is_planned():
    chunk = jumps()
    fallen = as_given(chunk)
    assert fallen.fell
    assert 0.0 < fallen.time < 5.0
    assert fallen.cause
    checker = Checker(episode=EpisodeConfig(settle=0.0))
    begin = FastChecker(checker.supervisor.config).judge.first_pose(chunk).body
    planned = run_chunk(checker, chunk, RobotState(0.0, begin.q, begin.v))
    assert not planned.fell
    assert planned.time is None


def test_a_small_motion_holds_as_given_from_its_own_first_pose_and_is_the_same_again():
    chunk = sent(to=(0.1, 0.0, 0.1), jump=(0.05, 0.0, 0.1))
    first, second = as_given(chunk), as_given(chunk)
    assert not first.fell
    assert first.errors.shape == first.turns.shape == (len(chunk) - 1, 2)
    assert first.errors.max() < 0.02
    assert np.array_equal(first.errors, second.errors)


def test_a_state_is_where_it_begins():
    away = as_given(sent(jump=(0.05, 0.0, 0.1)), MujocoPlant(g1()).reset())
    assert away.errors[0].max() > 0.08
    assert away.errors[-1].max() < 0.02
