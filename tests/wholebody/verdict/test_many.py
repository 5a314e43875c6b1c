"""Strategy: sets of chunks as a policy samples them; what is ranked first is judged by itself, and what a deadline cuts
off is said. Scores of verdicts and of sketches are one scale; the map alone is counted in chunks, not in seconds.
"""

import numpy as np
import pytest

from policy.action_spec.codec import encode
from tests.support.sampled_chunks import sampled_set
from tests.support.sent_chunks import SPEC, STANCE, sent
from wholebody import InputError, RobotState, judge_many
from wholebody.config import VerdictConfig
from wholebody.planning.judgement.sketch import CHUNKS_AT_ONCE, rooms
from wholebody.verdict.fast import FastChecker
from wholebody.verdict.given.many import CUT, score

FREE = (False, False)
SET = 15
"""A set of which seven chunks are feasible by plans, and seven infeasible."""


@pytest.fixture(scope="module")
def checker():
    return FastChecker()


@pytest.fixture(scope="module")
def stance(checker):
    body = checker.judge.stance().body
    return RobotState(0.0, body.q, body.v)


def test_the_first_of_sixteen_is_feasible_where_any_is(checker, stance):
    for number in (SET, 4, 6):
        chunks = sampled_set(number)
        ranking = judge_many(chunks, stance)
        verdict = checker.of_chunk(chunks[ranking.best.index], checker.judge.stance(), "", FREE)
        assert (ranking.best.score, ranking.complete, verdict.verdict) == (0.0, True, "feasible")
        assert sorted(one.index for one in ranking.ranked) == list(range(len(chunks)))


def test_scores_tell_feasible_from_infeasible_chunks(checker, stance):
    """Of all pairs of one of either kind, nine in ten are in their order by sketches alone."""
    chunks = sampled_set(SET)
    answers = [checker.of_chunk(one, checker.judge.stance(), "", FREE, odds=False).verdict for one in chunks]
    scores = checker.sketches.of(chunks, checker.judge.stance(), FREE).max(axis=1)
    good, bad = (
        scores[[i for i, answer in enumerate(answers) if answer == kind]] for kind in ("feasible", "infeasible")
    )
    assert len(good) > 2 < len(bad)
    assert (good[:, None] < bad[None]).mean() > 0.9


def test_what_no_hand_reaches_is_last_and_seen_by_the_map(stance):
    chunks = [sent(to=(2.0, 0.0, 0.0)), sent(), sent(to=(0.0, 1.5, 0.5))]
    ranking = judge_many(chunks, stance)
    assert ranking.best.index == 1
    assert [one.looked_at for one in ranking.ranked[1:]] == ["map", "map"]
    assert min(one.score for one in ranking.ranked[1:]) >= CUT
    assert (ranking.compare(1, 0), ranking.compare(0, 1), ranking.compare(2, 2)) == (-1, 1, 0)


def test_where_none_is_done_as_given_the_first_ones_are_planned_and_say_why(stance):
    chunks = [sent(to=(x, 0.0, 0.0), time=1.5) for x in (0.75, 0.62, 0.68)]
    ranking = judge_many(chunks, stance)
    assert ranking.complete
    assert ranking.best.index == 1
    assert ranking.best.verdict.verdict == "infeasible"
    assert ranking.best.score > 1.0
    assert "50 mm allowed: out of reach" in ranking.top(1)


def test_a_deadline_is_kept_and_what_was_not_looked_at_is_said(stance):
    ranking = judge_many(sampled_set(SET), stance, limit_ms=1e-3)
    assert {one.looked_at for one in ranking.ranked} == {"map"}
    assert not ranking.complete
    assert ranking.top(2).endswith("the time ended before more was looked at")


def test_a_sketch_does_not_depend_on_the_chunks_beside_it(checker):
    chunks, begin = [*sampled_set(SET), sent()], checker.judge.stance()
    together = checker.sketches.of(chunks, begin, FREE)
    assert len(chunks) > CHUNKS_AT_ONCE
    for i in (0, 7, CHUNKS_AT_ONCE):
        assert np.array_equal(checker.sketches.of([chunks[i]], begin, FREE)[0], together[i])


def test_raw_numbers_are_ranked_as_the_chunks_that_they_are(stance):
    chunks = sampled_set(SET)[:4]
    actions = [encode(SPEC, one, STANCE) for one in chunks]
    ours, theirs = judge_many(chunks), judge_many(actions, layout="wbc32", fps=chunks[0].fps)
    assert [one.index for one in ours.ranked] == [one.index for one in theirs.ranked]


def test_the_map_has_room_where_chunks_stay_and_none_where_they_leave(checker):
    planner = checker.judge.planner
    found = rooms(planner.map, [sent(), sent(to=(0.75, 0.0, 0.0))], planner.offsets, (0.0, 0.0))
    assert found[0] > 0.0 > found[1]


def test_a_score_is_0_if_feasible_and_beyond_1_if_infeasible(checker):
    bounds, begin = VerdictConfig(), checker.judge.stance()
    chunks = sent(), sent(to=(0.44, 0.0, 0.25), time=1.2), sent(to=(0.75, 0.0, 0.0), time=1.5)
    verdicts = [checker.of_chunk(one, begin, "", FREE, odds=False) for one in chunks]
    scores = [score(one, bounds) for one in verdicts]
    assert [one.verdict for one in verdicts] == ["feasible", "feasible_after_repair", "infeasible"]
    assert scores[0] == 0.0 < scores[1] <= 1.0 < scores[2]


@pytest.mark.parametrize(("chunks", "limit", "said"), [([], 33.0, "at least one"), ([1], 0.0, "positive time")])
def test_misuse_is_told(chunks, limit, said):
    with pytest.raises(InputError, match=said):
        judge_many(chunks and [sent()], limit_ms=limit)
