"""Strategy: chunks moved from the stance, turned, or with left and right swapped; one through the fast check, whose
answer the note leaves as it is, and one through MuJoCo. Hands that come back from where the robot cannot have them.
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


def coming_back(jump, to):
    """Both hands begin farther ahead by the first number [m], and come back by the other one."""
    chunk = sent(jump=(jump, 0.0, 0.0), to=(-to, 0.0, 0.0), time=0.8)
    for T in (chunk.T_world_lhand, chunk.T_world_rhand):
        T[:, :3, 3] = chunk.T_world_lhand[:, :3, 3] - chunk.T_world_lhand[0, :3, 3] + T[0, :3, 3]
    return ReplayPolicy(chunk)


def test_first_rows_that_the_robot_cannot_be_put_at_are_no_way_to_the_others():
    policy, fast = coming_back(0.4, 0.3), FastChecker()
    begin = fast.first_state(policy)
    checker = Checker(episode=EpisodeConfig(settle=0.1, hold=0.1, begin=begin))
    for verdict in (fast.check(policy, "ahead", policy.duration), checker.check(policy, "ahead", 0.9)[0]):
        assert verdict.start_m > 0.1
        assert (verdict.verdict, verdict.approach_s) == ("infeasible", 0.0)
        assert verdict.violations[0].step < 5
        assert " hand " in verdict.headline
        assert "50 mm allowed" in verdict.headline


def test_to_begin_at_the_first_row_is_offered_where_the_robot_can_be_put_there():
    fast, far = FastChecker(), coming_back(0.4, 0.3)
    near = ReplayPolicy(sent(jump=(0.1, 0.0, 0.35)))
    for policy, offered in ((near, True), (far, False)):
        verdict = fast.check(policy, "x", policy.duration, start="stance")
        assert any(one.kind == "start" for one in verdict.would_do) == offered
        assert "--start first" in verdict.headline or not offered
        assert (fast.check(policy, "x", policy.duration).verdict == "feasible") == offered


def test_hands_that_lost_the_chunk_on_their_way_are_not_told_as_far_from_its_beginning():
    """Of a chunk that is planned from where the one before left the hands, these are far from its first step."""
    policy = ReplayPolicy(sent(jump=(0.4, 0.0, 0.0), to=(-0.2, 0.0, 0.0), time=0.9, steps=60))
    verdict = FastChecker().check(policy, "lost", policy.duration)
    assert any(one.code == "start" and one.margin < 0.0 for one in verdict.margins)
    assert "where row 0 begins" not in verdict.headline
