"""Strategy: chunks moved from the stance, turned, or with left and right swapped; one through the fast check, whose
answer the note leaves as it is, and one through MuJoCo.
"""

from dataclasses import replace

import numpy as np
import pytest

from policy.geometry.rotations import rotvec_to_matrix
from policy.recorded.replay import ReplayPolicy
from tests.support.sent_chunks import sent
from wholebody.config import ControllerConfig
from wholebody.config.description import describe
from wholebody.episode.run import EpisodeConfig
from wholebody.types import Reason
from wholebody.verdict.check import Checker
from wholebody.verdict.fast import FastChecker
from wholebody.verdict.input_steps import far_from_stance

SPEC, FREE, ASKED = describe(ControllerConfig().robot), (True, True), (False, False)


def swapped(chunk):
    return replace(chunk, T_world_lhand=chunk.T_world_rhand, T_world_rhand=chunk.T_world_lhand)


def notes(verdict):
    return [one.subject for one in verdict.violations if one.code is Reason.CHUNK_NOTE]


@pytest.mark.parametrize(("jump", "told"), [(0.0, False), (0.29, False), (0.31, True)])
def test_a_first_step_far_from_the_stance_is_told_with_hand_and_distance(jump, told):
    found = far_from_stance(sent(jump=(jump, 0.0, 0.0)), SPEC, ASKED)
    assert bool(found) == told
    assert not told or found[0].startswith(
        "judged with the hands at its first row, the left hand 310 mm and 0 deg from the stance"
    )
    assert not told or found[0].endswith("with --start stance, or a state, the way counts")


def test_a_turned_hand_is_told_unless_its_orientation_is_free():
    chunk = sent()
    # About the axis of the fingers, near which the palm point is.
    chunk.T_world_rhand[:, :3, :3] = chunk.T_world_rhand[:, :3, :3] @ rotvec_to_matrix(np.array([3.0, 0.0, 0.0]))
    (note,) = far_from_stance(chunk, SPEC, ASKED)
    assert note.startswith("judged with the hands at its first row, the right hand ")
    assert " and 172 deg from the stance" in note
    assert far_from_stance(chunk, SPEC, FREE) == ()


def test_hands_in_each_others_place_are_asked_about():
    (note,) = far_from_stance(swapped(sent()), SPEC, ASKED)
    assert note.endswith("; are left and right swapped?")


def test_the_fast_check_tells_it_where_it_begins_at_the_first_step_and_answers_as_before():
    checker, policy = FastChecker(), ReplayPolicy(sent(jump=(0.1, 0.0, 0.35)))
    first, stance = (checker.check(policy, "high", policy.duration, start=start) for start in ("first", "stance"))
    assert first.verdict == "feasible"
    assert notes(first) == [far_from_stance(policy.episode, SPEC, ASKED)[0]]
    assert notes(stance) == []


def test_the_simulated_check_tells_it_too():
    policy = ReplayPolicy(sent(jump=(0.1, 0.0, 0.35)))
    begin = FastChecker().first_state(policy)
    checker = Checker(episode=EpisodeConfig(settle=0.1, hold=0.1, begin=begin))
    verdict, _ = checker.check(policy, "high", 0.1)
    assert notes(verdict) == [far_from_stance(policy.episode, SPEC, ASKED)[0]]
