"""Why one chunk is not done as given, within a stated amount of work."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property
from math import inf

import numpy as np

from policy.chunk import ActionChunk
from wholebody.episode.tracking_error import FINGER_TOLERANCE
from wholebody.planning.judgement.cause import Cause, causes
from wholebody.planning.judgement.chunk_judge import Begin, ChunkJudge, ChunkJudgement
from wholebody.planning.judgement.chunk_program import AT_REST, EVERY, ChunkProgram
from wholebody.planning.judgement.limits import OF_NUMBERS, Limit
from wholebody.planning.plan import ChunkPlan
from wholebody.verdict.plan_run import PlanRun, Suspect
from wholebody.verdict.verdict import Verdict
from wholebody.verdict.why.sentence import Why, WouldDo, why, with_changes
from wholebody.verdict.why.single_changes import SingleChanges
from wholebody.verdict.why.tick import TickProver

CAUSES_WORK, WHY_WORK, SET_WORK = 700.0, 1000.0, 1600.0
"""Linearisations and steps after which no further set of bounds is looked for, no further change is tried, and a set
that was begun is given up [no unit]; chosen: about one second, one and a half, and two and a half."""
TRY_WORK, STEPS = 60.0, 50
"""The same of one try, for a chunk of so many steps, and in proportion for longer ones [no unit]; measured: in nine
planted cases as much as is needed to find the changes that are found with all the work of a plan."""


class Explainer:
    """Looks for causes and for what would do.

    Args:
        judge: Holds the robot.

    Attributes:
        asked: Program and causes of the chunk that was asked of last, with the motions that were found.
    """

    def __init__(self, judge: ChunkJudge) -> None:
        self._judge = judge
        self.asked: tuple[ChunkProgram, list[Cause]] | None = None

    @cached_property
    def prover(self) -> TickProver:
        """What asks the tick's program."""
        return TickProver(self._judge.spec, self._judge.config)

    def explained(self, verdict: Verdict, suspect: Suspect, free: tuple[bool, bool], start: float) -> Verdict:
        """A verdict with what is found of a chunk that is not followed as given.

        Args:
            verdict: On the input.
            suspect: The chunk.
            free: Whether nothing is asked of the left and the right palm's orientation.
            start: Time of the first step of the input [s].
        """
        chunk, since, before = suspect.chunk, suspect.chunk.t_obs - start, self._work
        program = ChunkProgram(self._judge, chunk, suspect.begin, free, suspect.now)
        if suspect.plan.report.slowdown == 1.0:
            program.know(suspect.plan.knots)

        def under(most: float) -> Callable[[], bool]:
            return lambda: self._work - before < most

        found, every = causes(program, under(CAUSES_WORK), under(SET_WORK))
        self.asked = program, found
        if not found:
            return replace(verdict, why_complete=every)
        told = [why(one, since, chunk.fps) for one in found]
        singles = self.single_changes(chunk, suspect.begin, free, suspect.plan, under(WHY_WORK))
        would_do = _what_would_do(program, singles, told, since)
        told = [with_changes(told[0], would_do)] if len(told) == 1 else told
        of_numbers = all(set(one.kinds) <= OF_NUMBERS | {Limit.SCENE_DISTANCE} for one in found)
        tick = None if of_numbers else self.prover.of(program, since)
        return replace(verdict, causes=told, would_do=would_do, tick=tick, why_complete=every and singles.complete)

    def single_changes(
        self,
        chunk: ActionChunk,
        begin: Begin,
        free: tuple[bool, bool] = (False, False),
        plan: ChunkPlan | None = None,
        goes_on: Callable[[], bool] = lambda: True,
    ) -> SingleChanges:
        """What changes a chunk that is not feasible by one thing; it is planned where its plan is not given."""
        plan = plan or self._judge.planner.plan(chunk, chunk.t_obs, begin.body, begin.hands, quick=True)

        def holds(changed: ActionChunk, work: float = inf) -> bool:
            return self._holds_as_given(changed, begin, free, work)

        def at_first(changed: ActionChunk) -> bool:
            return holds(changed, TRY_WORK * max(len(changed) / STEPS, 1.0))

        return SingleChanges(self._judge, chunk, plan, at_first, holds, goes_on)

    def _holds_as_given(self, chunk: ActionChunk, begin: Begin, free: tuple[bool, bool], work: float) -> bool:
        """Whether a chunk is feasible by an attempt at its own speed; what needs no plan comes first."""
        judge, now, far = self._judge, chunk.t_obs, self._judge.config.verdict.palm_feasible
        forgiven = {Limit.START: 0.0, Limit.FINGER_RANGE: FINGER_TOLERANCE}
        forgiven |= {Limit.INTO_FLOOR: far, Limit.SCENE_DISTANCE: far}
        numbers = judge.numbers(chunk, begin, now)
        if any(code in numbers and numbers[code].margin < -room for code, room in forgiven.items()):
            return False
        plan = judge.planner.as_given(chunk, now, begin.body, begin.hands, work)
        if plan is None:
            return False
        run, none = PlanRun(judge, free), np.zeros((0, 2))
        run.follow(chunk, begin, now, np.inf, ChunkJudgement(plan, chunk.times, none, none, judge.around(chunk, plan)))
        return run.verdict("", {}).verdict == "feasible"

    @property
    def _work(self) -> float:
        return self._judge.planner.optimizer.work


def _what_would_do(program: ChunkProgram, singles: SingleChanges, causes: Sequence[Why], since: float) -> list[WouldDo]:
    """Single changes that make a chunk hold; for each bound of an only cause, what a plan has that keeps all others.

    A chunk is not made slower where no posture at rest does what it asks: that stays so at any speed.
    """
    at_rest = any(set(one.codes) <= AT_REST - {Limit.WAIST_TORQUE} for one in causes)
    slower = None if at_rest or not program.rests() else singles.slower()
    changes = slower, singles.moved(), singles.turned(), singles.lighter()
    out = [WouldDo(x.kind, x.slower, x.moved, x.turned, x.lighter) for x in changes if x is not None]
    for kind in causes[0].codes if len(causes) == 1 else ():
        if kind in EVERY and (one := program.raised(kind)) is not None:
            moved = replace(one, time=one.time + since, step=one.step + round(since * program.chunk.fps))
            out.append(WouldDo("bound", bound=moved))
    return out
