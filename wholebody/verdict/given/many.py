"""Choosing among chunks: which of many from one state would be followed best, with no more work than that takes.

A map cuts off what is surely out of reach, sketches say how far each of the others is from what can be done, and plans
are made of those that may be the best, in that order, until one is done as given.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf
from time import perf_counter
from typing import Literal

import numpy as np

from policy.action_spec.spec import ActionSpec
from policy.chunk import ActionChunk
from wholebody.config import ControllerConfig, VerdictConfig
from wholebody.errors import InputError
from wholebody.planning.judgement.chunk_judge import Begin
from wholebody.planning.judgement.sketch import CHUNKS_AT_ONCE, KINDS, rooms
from wholebody.planning.reachability.reach_map import ODDS_SURE
from wholebody.types import PalmCause, RobotState
from wholebody.verdict.fast import FastChecker, checkers
from wholebody.verdict.given.own_numbers import Free, Numbers, as_given_chunk, stands_in
from wholebody.verdict.verdict import Verdict
from wholebody.verdict.why.explainer import TRY_WORK, holds_as_given
from wholebody.verdict.why.headline import headline

LACKS, SCORES = zip(
    (0.0, 0.001), (0.5, 0.03), (1.0, 0.26), (1.5, 0.6), (2.0, 0.85), (2.5, 1.1), (3.5, 1.6), (5.0, 2.3), (7.0, 3.2),
    (13.4, 4.0), strict=True,
)  # fmt: skip
"""What a sketch lacks most, in terms of the most that is done as given, and the score of it [no unit]; measured:
isotonic regression of the scores of verdicts, of 960 chunks of 60 sets of `tests.support.sampled_chunks`."""
STEEP = 0.125
"""Score for each more that a sketch lacks [no unit]; derived: the last two of those."""
CUT = 4.0
"""Score from which chunks on are that the map cuts off [no unit]; chosen: past what sketches of arm's length have."""
PLANNED = 3
"""Chunks of which all that a plan may take is spent, where nothing less shows that any is done as given [no unit];
chosen: half a second."""
REPAIR_MIN = 0.2
"""Least score of a chunk that is done after repair [no unit]; definition."""
FIRST_GUESS = 0.01
"""Time that the first preview is thought to take [s]; measured."""

LookedAt = Literal["map", "sketch", "plan"]


@dataclass(frozen=True)
class Ranked:
    """One of many chunks.

    Attributes:
        index: Its place in what was given.
        score: 0 if it is shown to be done as given, larger is worse. To 1: done after repair, by the share of what a
            repair may move or turn a hand; beyond 1: another motion, by how many times that. Where no plan was made it
            is what such chunks have on average.
        looked_at: How far it was looked at: by the ``map`` or a ``sketch`` alone, or by a ``plan``.
        reason: What the score comes from, in words.
        verdict: On it, where all that a plan may take was spent.
    """

    index: int
    score: float
    looked_at: LookedAt
    reason: str
    verdict: Verdict | None = None


@dataclass(frozen=True)
class Ranking:
    """Chunks in order.

    Attributes:
        ranked: The best one first.
        complete: Whether the first one is shown to be done as given, or all that may be was looked at; else the time
            ended before.
        seconds: How long it took [s].
    """

    ranked: tuple[Ranked, ...]
    complete: bool
    seconds: float

    @property
    def best(self) -> Ranked:
        """The first one."""
        return self.ranked[0]

    def compare(self, one: int, other: int) -> int:
        """-1 if the chunk at one place is better than that at another one, 1 if it is worse, 0 if neither."""
        scores = {ranked.index: ranked.score for ranked in self.ranked}
        return (scores[one] > scores[other]) - (scores[one] < scores[other])

    def top(self, k: int) -> str:
        """The first k for people, a line each."""
        lines = [f"{x.index}: score {x.score:.3g} by {x.looked_at}, {x.reason}" for x in self.ranked[:k]]
        return "\n".join(lines if self.complete else [*lines, "the time ended before more was looked at"])


def judge_many(
    chunks: Sequence[Numbers],
    state: RobotState | None = None,
    config: ControllerConfig | None = None,
    *,
    limit_ms: float = inf,
    layout: ActionSpec | str | None = None,
    fps: float | None = None,
    scene: str = "floor",
    orientation_free: Free | None = None,
) -> Ranking:
    """Rank chunks by what would become of each from one state, as samples of a policy are, without simulating them.

    Args:
        chunks: Any number of them but none; as in `judge`.
        state: Where the robot is; at rest with its hands at the first step of the first chunk if not given.
        config: Of the robot and its controller.
        limit_ms: Time in which the answer is wanted [ms]; with one, what is looked at depends on the machine.
        layout: What raw actions are, as in `judge`.
        fps: Steps a second of raw actions [Hz]; the layout's if not given.
        scene: What stands around it, as in `judge`.
        orientation_free: As in `judge`.

    Raises:
        ChunkError: If a chunk is malformed.
        FileFormatError: If raw actions cannot be what the layout calls them.
        InputError: If there is no chunk, the state is malformed, or the limit is no positive time.
    """
    since = perf_counter()
    if not limit_ms > 0.0:
        raise InputError(f"limit_ms is {limit_ms}; a positive time [ms] is expected")
    if len(chunks) == 0:
        raise InputError("there is no chunk to judge; give at least one")
    with checkers.lend(config or ControllerConfig(), scene) as checker:
        begun = stands_in(checker, state)
        given = [as_given_chunk(checker, one, begun, layout, fps, orientation_free) for one in chunks]
        begin = given[0].begin or checker.judge.first_pose(given[0].chunk)
        many = _Many(checker, [one.chunk for one in given], begin, given[0].free, since + 1e-3 * limit_ms)
        ranked, complete = many.ranked()
    return Ranking(ranked, complete, perf_counter() - since)


class _Many:
    """Chunks of one call, and what is known of each.

    Args:
        checker: Judges by plans; it holds the robot where its feet stand.
        chunks: Valid ones.
        begin: Where each is begun.
        free: Whether the orientation of the left and of the right palm is free.
        end: When the answer is wanted, by `perf_counter` [s].
    """

    def __init__(
        self, checker: FastChecker, chunks: Sequence[ActionChunk], begin: Begin, free: Free, end: float
    ) -> None:
        self._checker, self._chunks, self._begin, self._free, self._end = checker, chunks, begin, free, end
        self._bounds, self._step = checker.config.verdict, FIRST_GUESS
        self._known: dict[int, Ranked] = {}

    def ranked(self) -> tuple[tuple[Ranked, ...], bool]:
        """All in order, and whether nothing is left to look at that may be the best."""
        self._look_at_map()
        complete = self._sketch() and self._plan()
        order = sorted(self._known.values(), key=lambda one: (one.score, one.index))
        return tuple(order), complete or order[0].score == 0.0

    def _look_at_map(self) -> None:
        """Cut off what is surely out of reach; guess of the others."""
        planner = self._checker.judge.planner
        known, loads = planner.map, self._checker.judge.loads
        found = np.full(len(self._chunks), ODDS_SURE)
        if known is not None:
            found = rooms(known, self._chunks, planner.offsets, loads)
        for i, room in enumerate(found.tolist()):
            score = CUT + STEEP * (-ODDS_SURE - room) if room < -ODDS_SURE else 1.0 - 0.5 * room / ODDS_SURE
            self._known[i] = Ranked(i, score, "map", f"the map has odds of e^{room:.1f} for its palms")

    def _sketch(self) -> bool:
        """Sketch what the map leaves, the likeliest first; whether there was time for all."""
        todo = sorted((one.score, one.index) for one in self._known.values() if one.score < CUT)
        for first in range(0, len(todo), CHUNKS_AT_ONCE):
            if perf_counter() >= self._end:
                return False
            numbers = [index for _, index in todo[first : first + CHUNKS_AT_ONCE]]
            some = [self._chunks[i] for i in numbers]
            for i, lacks in zip(numbers, self._checker.sketches.of(some, self._begin, self._free), strict=True):
                self._known[i] = _sketched(i, lacks)
        return True

    def _plan(self) -> bool:
        """Plan what may be the best until one is done as given, each time with more work; whether there was time."""
        order = [one.index for one in sorted(self._known.values(), key=lambda x: (x.score, x.index))]
        todo = [i for i in order if self._known[i].score < CUT]
        for shows in (self._is_previewed, self._is_planned):
            for i in todo:
                if not self._has_time():
                    return False
                begun = perf_counter()
                shown = shows(self._chunks[i])
                self._step = perf_counter() - begun
                if shown:
                    self._known[i] = Ranked(i, 0.0, "plan", "done as given")
                    return True
        for i in (todo or order)[:PLANNED]:
            if not self._has_time():
                return False
            begun = perf_counter()
            begin = self._begin if i == 0 else replace(self._begin, placed=False)  # for the first of them
            verdict = self._checker.of_chunk(self._chunks[i], begin, f"chunk {i}", self._free, odds=False)
            self._step = perf_counter() - begun
            self._known[i] = Ranked(i, score(verdict, self._bounds), "plan", headline(verdict), verdict)
        return True

    def _is_previewed(self, chunk: ActionChunk) -> bool:
        """Whether a preview shows that a chunk is done as given; it sees no scene, forces nor what was clipped."""
        judge = self._checker.judge
        plain = (
            judge.scene is None and not any(chunk.pushes) and not chunk.notes and not judge.exceeds(chunk, self._begin)
        )
        return plain and judge.previews(chunk, self._begin)

    def _is_planned(self, chunk: ActionChunk) -> bool:
        """Whether a plan with little work shows the same."""
        return not chunk.notes and holds_as_given(self._checker.judge, chunk, self._begin, self._free, TRY_WORK)

    def _has_time(self) -> bool:
        """Whether one more that takes as long as the last one ends in time."""
        return perf_counter() + self._step <= self._end


def score(verdict: Verdict, bounds: VerdictConfig) -> float:
    """Score of a verdict, as of `Ranked`: 0 if it is feasible, up to 1 after repair, more than 1 if it is infeasible.

    Args:
        verdict: Fast or simulated.
        bounds: That it was judged by.
    """
    if verdict.verdict == "feasible":
        return 0.0
    lost = [one.value for one in verdict.violations if one.unit == "m" and one.cause is PalmCause.LOST]
    moved = max(verdict.moved_max_m, *lost, 0.0) / bounds.palm_repair
    size = max(moved, verdict.moved_turn_max_rad / bounds.turn_repair, verdict.time_factor - 1.0)
    if verdict.verdict == "feasible_after_repair":
        return float(np.clip(size, REPAIR_MIN, 1.0))
    return float(max(size, np.nextafter(1.0, 2.0))) + (2.0 if verdict.fell else 0.0)


def _sketched(index: int, lacks: np.ndarray) -> Ranked:
    worst, kind = float(lacks.max()), KINDS[int(lacks.argmax())]
    more = STEEP * max(worst - LACKS[-1], 0.0)
    text = f"{kind.sentence} is about {worst:.2g} times what is done as given"
    return Ranked(index, min(float(np.interp(worst, LACKS, SCORES)) + more, CUT), "sketch", text)
