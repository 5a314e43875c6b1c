"""Why one chunk is not done as given, within a stated amount of work."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cached_property
from math import inf
from queue import SimpleQueue

import numpy as np

from policy.chunk import ActionChunk
from policy.geometry.rotations import angle_between
from wholebody.planning.judgement.chunk_judge import Begin, ChunkJudge, ChunkJudgement
from wholebody.planning.judgement.chunk_margins import HANDS
from wholebody.planning.judgement.limits import OF_NUMBERS, Limit
from wholebody.planning.plan import ChunkPlan
from wholebody.verdict.causes import Why, WouldDo
from wholebody.verdict.plan_run import PlanRun, Suspect
from wholebody.verdict.repair import Change, ChangeKind, slowed
from wholebody.verdict.verdict import Verdict
from wholebody.verdict.why.cause import Cause, causes
from wholebody.verdict.why.chunk_program import AT_REST, ChunkProgram
from wholebody.verdict.why.findings import NOTHING, Findings
from wholebody.verdict.why.motion_search import EVERY
from wholebody.verdict.why.sentence import why
from wholebody.verdict.why.single_changes import MOVED_MOST, SLOWER_MOST, SingleChanges
from wholebody.verdict.why.tick import TickProver

CAUSES_WORK, WHY_WORK, SET_WORK = 700.0, 1000.0, 1600.0
"""Linearisations and steps after which no further set of bounds is looked for, no further change is tried, and a set
that was begun is given up [no unit]; chosen: what ends within three seconds."""
TRY_WORK, STEPS = 60.0, 50
"""The same of one try, for a chunk of so many steps, and in proportion for longer ones [no unit]; measured: in nine
planted cases as much as is needed to find the changes that are found with all the work of a plan."""

APART = (Limit.SELF_DISTANCE, Limit.FLOOR_DISTANCE, Limit.SCENE_DISTANCE)
"""Bounds on distances: a negative one is of bodies in each other, which no setting makes possible."""

CHANGES: tuple[ChangeKind, ...] = ("slower", "moved", "turned", "lighter")
"""Kinds of changes that are tried, each with half of the work that causes leave."""


class Explainer:
    """Looks for causes and for what would do.

    Args:
        judge: Holds the robot.
        twins: More like it, with which searches go on side by side; what is found does not depend on how many.

    Attributes:
        asked: Program and causes of the chunk that was asked of last, with the motions that were found.
    """

    def __init__(self, judge: ChunkJudge, twins: Sequence[ChunkJudge] = ()) -> None:
        self._judge, self._twins = judge, twins
        self.asked: tuple[ChunkProgram, list[Cause]] | None = None

    @cached_property
    def prover(self) -> TickProver:
        """What asks the tick's program."""
        return TickProver(self._judge.spec, self._judge.config)

    def explained(
        self,
        verdict: Verdict,
        suspect: Suspect,
        free: tuple[bool, bool],
        start: float,
        sound: Callable[[Change], Change | None] | None = lambda change: change,
        end: float = inf,
        rows: float = 0.0,
    ) -> Verdict:
        """A verdict with what is found of a chunk that is not followed as given.

        Args:
            verdict: On the input.
            suspect: The chunk.
            free: Whether the orientation of the left and of the right palm is free.
            start: Time of its first step [s].
            sound: A change, or a little more, that is feasible when checked; without it, no change is looked for.
            end: Time of the last row of the input [s].
            rows: Rows of the input a second, where those are not the steps [Hz].
        """
        chunk, begin, since = suspect.chunk, suspect.begin, suspect.chunk.t_obs - start
        for twin in self._twins:
            twin.carry(*self._judge.loads)
            twin.stand_on(self._judge.planner.optimizer.body.footing.contacts)
        program = ChunkProgram(self._judge, chunk, begin, free, suspect.now, self._twins)
        known = program.with_motion(suspect.plan.knots) if suspect.plan.report.slowdown == 1.0 else NOTHING
        found, every, known = causes(program, known, CAUSES_WORK, SET_WORK)
        self.asked = program, found
        if not found:
            return replace(verdict, why_complete=every)
        whys, at_most = [why(one, since, chunk.fps, end, rows) for one in found], 0.5 * (WHY_WORK - known.work)
        of_numbers = all(set(one.kinds) <= OF_NUMBERS | {Limit.SCENE_DISTANCE} for one in found)
        # A chunk is not made slower where no posture at rest does what it asks: that stays so at any speed.
        at_rest = any(set(one.codes) <= AT_REST - {Limit.WAIST_TORQUE} for one in whys)
        slows, known = (False, known) if at_rest else program.rests(known)
        idle, kinds = SimpleQueue(), () if sound is None else CHANGES

        def changed(kind: ChangeKind) -> tuple[Change | None, bool]:
            judge = idle.get()
            try:
                singles = self.single_changes(chunk, begin, free, suspect.plan, at_most, judge)
                return getattr(singles, kind)(), singles.complete
            finally:
                idle.put(judge)

        with ThreadPoolExecutor(len(CHANGES)) as pool:
            asked = [pool.submit(changed, kind) for kind in kinds if kind != "slower" or slows]
            for twin in self._twins:
                idle.put(twin)
            try:
                raised, known = _raised(program, whys, since, known)
                tick = None if of_numbers else self.prover.of(program, program.nearest(known)[0], since)
            finally:
                idle.put(self._judge)
            changes = [one.result() for one in asked]
        kept = (x if x.kind == "lighter" else sound(x) for x, _ in changes if x is not None)
        would_do = [would_change(self._judge, chunk, x, since) for x in kept if x is not None]
        every, would_do = every and all(done for _, done in changes), filter(makes_sense, would_do + raised)
        return replace(verdict, causes=whys, would_do=list(would_do), tick=tick, why_complete=every)

    def single_changes(
        self,
        chunk: ActionChunk,
        begin: Begin,
        free: tuple[bool, bool] = (False, False),
        plan: ChunkPlan | None = None,
        work: float = inf,
        judge: ChunkJudge | None = None,
    ) -> SingleChanges:
        """What changes a chunk that is not feasible by one thing, within some work; it is planned if no plan is given.

        Another judge than that of the causes may be given, for changes that are looked for beside them.
        """
        judge = judge or self._judge
        plan = plan or judge.planner.plan(chunk, chunk.t_obs, begin.body, begin.hands, quick=True)

        def holds(changed: ActionChunk, work: float = inf) -> bool:
            return holds_as_given(judge, changed, begin, free, work)

        def at_first(changed: ActionChunk) -> bool:
            return holds(changed, TRY_WORK * max(len(changed) / STEPS, 1.0))

        return SingleChanges(judge, chunk, plan, at_first, holds, work)


def would_change(judge: ChunkJudge, chunk: ActionChunk, change: Change, since: float = 0.0) -> WouldDo:
    """A change for a verdict: which hand it moves most, at which step and by what; the chunk begins at a time [s]."""
    one = WouldDo(change.kind, change.slower, change.moved, change.turned, change.lighter)
    if change.kind == "lighter":
        return one
    one = replace(one, chunk=change.chunk)
    by = judge.asked(change.chunk)[0] - judge.asked(slowed(chunk, change.slower))[0]
    if change.kind == "slower" or len(by) == 0:
        return one
    turned = angle_between(judge.asked(change.chunk)[1], judge.asked(slowed(chunk, change.slower))[1])
    size = turned if change.kind == "turned" else np.linalg.norm(by, axis=2)
    step, side = np.unravel_index(size.argmax(), size.shape)
    at = round(step / change.slower) + round(since * chunk.fps)
    return replace(one, hand=HANDS[side], step=at, by=tuple(by[step, side].tolist()))


def makes_sense(one: WouldDo) -> bool:
    """Whether a change can be offered: no other motion, and no bodies in each other."""
    if one.bound is not None and one.bound.code in APART and one.bound.value < 0.0:
        return False
    return one.moved <= MOVED_MOST and one.slower <= SLOWER_MOST


def holds_as_given(judge: ChunkJudge, chunk: ActionChunk, begin: Begin, free: tuple[bool, bool], work: float) -> bool:
    """Whether a chunk is feasible by an attempt at its own speed; what needs no plan comes first."""
    now = chunk.t_obs
    if judge.exceeds(chunk, begin):
        return False
    plan = judge.planner.as_given(chunk, now, begin.body, begin.hands, work)
    if plan is None:
        return False
    run, none = PlanRun(judge, free), np.zeros((0, 2))
    found = ChunkJudgement(plan, chunk.times, none, none, judge.around(chunk, plan))
    one, _ = run.follow(chunk, begin, now, found=found)
    return run.verdict((one,)).verdict == "feasible"


def _raised(
    program: ChunkProgram, causes: Sequence[Why], since: float, known: Findings
) -> tuple[list[WouldDo], Findings]:
    """Value of each bound of an only cause in a plan that keeps all others, and what is known then."""
    out = []
    for kind in causes[0].codes if len(causes) == 1 else ():
        one, known = program.raised(kind, known) if kind in EVERY else (None, known)
        if one is not None:
            moved = replace(one, time=one.time + since, step=one.step + round(since * program.chunk.fps))
            out.append(WouldDo("bound", bound=moved))
    return out, known
