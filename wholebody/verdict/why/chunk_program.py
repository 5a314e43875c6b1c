"""A chunk as the planner's program, of which any kind of bound can be left out: is there a plan without it?"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import islice
from math import inf
from queue import SimpleQueue

import numpy as np

from policy.chunk import ActionChunk
from policy.geometry.rotations import angle_between
from wholebody.planning.judgement.chunk_judge import Begin, ChunkJudge
from wholebody.planning.judgement.chunk_margins import PALMS
from wholebody.planning.judgement.limits import Limit, Margin
from wholebody.planning.posture import FIRM_SCALE, GENTLE_SCALES, PALM_SCALES
from wholebody.planning.preparation import prepare
from wholebody.planning.still_postures import Round, scattered
from wholebody.planning.trajectory import GRID, SampledTrajectory, centroidal_along, curve_through, track_along
from wholebody.reference import HandMotion
from wholebody.trajopt.optimizer import KnotTrajectory
from wholebody.verdict.why.findings import NOTHING, Findings, Try
from wholebody.verdict.why.motion_search import (
    EVERY,
    NAMES,
    SPREAD,
    MotionSearch,
    SearchBegin,
    Searched,
    Witness,
)

STARTS = 5
"""Postures from which each search begins."""
NEAREST = 4
"""Motions that keep most of the bounds with which a thorough search begins, too; measured: with one, 3 of 323 sets had
a plan that the next search found."""
POSTURES = 6
"""Postures from which one at rest is searched."""
AT_REST = frozenset(name for name in EVERY if name.value in list(Limit)[: list(Limit).index(Limit.LOAD)])
"""Those that a posture at rest has to keep."""


class WorkOverError(Exception):
    """A search was given up because its work was over: nothing is known of what was asked.

    Attributes:
        known: What was found until then.
    """

    def __init__(self, known: Findings) -> None:
        super().__init__(f"given up after a work of {known.work:.0f}")
        self.known = known


class ChunkProgram:
    """One chunk; what is found of it is returned, and passed on to the next search.

    Attributes:
        first: Knot from which the palms count: the hands have joined the chunk.

    Args:
        judge: Holds the robot.
        chunk: A valid chunk.
        begin: Where it is begun; at rest with the hands at its first step if not given.
        free: Whether the orientation of the left and of the right palm is free.
        now: When it is begun, on the clock of its observation [s]; with its first step if not given.
        twins: Judges of the same robot, loads and feet, with which searches from several starts go on side by side.
    """

    def __init__(
        self,
        judge: ChunkJudge,
        chunk: ActionChunk,
        begin: Begin | None = None,
        free: tuple[bool, bool] = (False, False),
        now: float | None = None,
        twins: Sequence[ChunkJudge] = (),
    ) -> None:
        self.judge, self.chunk, self.free = judge, chunk, np.array(free)
        self.now = chunk.t_obs if now is None else now
        self.begin = begin or judge.first_pose(prepare(chunk, judge.planner.hand_limits).chunk)
        everyone = judge, *twins
        self._searches = [MotionSearch(one, chunk, self.begin, self.now, self.free) for one in everyone]
        self._own = self._searches[0]
        self.targets, self.first = self._own.targets, self._own.first
        posture = judge.planner.config.posture
        exact, gentle = (replace(posture, **scales) for scales in (PALM_SCALES, GENTLE_SCALES))
        self._rounds = Round(exact, 1.0, 25), Round(gentle, FIRM_SCALE, 40)

    def find(
        self, enforced: frozenset[Limit], known: Findings = NOTHING, *, thorough: bool = False, work_max: float = inf
    ) -> tuple[Witness | None, Findings]:
        """A motion that does the chunk as given within the bounds of these kinds alone, if one is found.

        Args:
            enforced: Names of the kinds.
            known: What was found before.
            thorough: Search from `STARTS` starts and `NEAREST` motions. Else one has to do, and none is made where at a
                knot that was missed before no posture at rest keeps them: a posture of a plan would.
            work_max: Work of all searches after which none is begun any more.

        Returns:
            The motion, and what is known now.

        Raises:
            WorkOverError: If that work is reached before it is known.
        """
        found, starts = known.keeping(enforced), range(STARTS) if thorough else ()
        if found is not None or any(known.missing(less, starts) for less in known.tried if less <= enforced):
            return found, known
        if not thorough:
            rests, known = self._has_postures(enforced, known)
            if not rests:
                return None, known
        tries = _tries(enforced, known, thorough)
        searched = self._searched(enforced, [self._begin(one) for one in tries])
        for one in tries:
            if known.work >= work_max:
                raise WorkOverError(known)
            done = next(searched)
            known = known.counting(done)
            if enforced == EVERY and known.nearest is None:
                known = replace(known, nearest=done.first)
            if done.found is not None:
                return done.found, replace(known, moved=isinstance(one, Witness))
            known = known.without(enforced, one)
        return None, known

    def _begin(self, one: Try) -> SearchBegin:
        if isinstance(one, Witness):
            return None, one.knots.q[1:]
        return (self._own.scattered(one) if one else None), None

    def _searched(self, enforced: frozenset[Limit], begins: Sequence[SearchBegin]) -> Iterator[Searched]:
        """Searches from each of these, side by side, in the order of these: what is found is that of one by one."""
        if min(len(self._searches), len(begins)) <= 1:
            yield from (self._own.search(enforced, *begin) for begin in begins)
            return
        idle = SimpleQueue()
        for one in self._searches:
            idle.put(one)

        def search(begin: SearchBegin) -> Searched:
            one = idle.get()
            try:
                return one.search(enforced, *begin)
            finally:
                idle.put(one)

        # None is begun before as many earlier ones as can go on side by side are known to find nothing.
        side, todo = len(self._searches), iter(begins)
        with ThreadPoolExecutor(side) as pool:
            asked = deque(pool.submit(search, begin) for begin in islice(todo, side))
            while asked:
                yield asked.popleft().result()
                asked.extend(pool.submit(search, begin) for begin in islice(todo, 1))

    def with_motion(self, knots: KnotTrajectory, known: Findings = NOTHING) -> Findings:
        """What is known, and a motion that was found elsewhere, at the chunk's own speed, if it does the chunk."""
        one = self._own.witness(knots)
        return replace(known, motions=(*known.motions, one)) if one.near else known

    def nearest(self, known: Findings = NOTHING) -> tuple[Witness, Findings]:
        """What the planner's own weights come to with every bound enforced, and what is known then."""
        if known.nearest is not None:
            return known.nearest, known
        done = self._own.search(EVERY, None)
        return done.first, replace(known.counting(done), nearest=done.first)

    def track(self, witness: Witness) -> tuple[SampledTrajectory, tuple[HandMotion, HandMotion]]:
        """A motion as it would be followed, and the hands as given at its rows."""
        steps = self.targets.steps
        curve = curve_through(steps, witness.knots.q, self.begin.body.v)
        end = steps[-1] + steps[1] - steps[0]
        track = track_along(curve, centroidal_along(curve, steps[0], end, self.judge.planner.centroidal))
        times = np.minimum(track.start + GRID * np.arange(len(track.q)), steps[-1])
        return track, tuple(path.sample(times) for path in self.targets.paths)

    def raised(self, kind: Limit, known: Findings = NOTHING) -> tuple[Margin | None, Findings]:
        """What the bounds of a kind would have to be for a plan that keeps all the others; None where none is found.

        It is the value that such a plan has, which is not the least one. One start has to do. What is known then comes
        with it.
        """
        found, known = self.find(EVERY - {kind}, known)
        room = [] if found is None else self.margins(found)
        return next((one for one in room if NAMES[one.code] == kind and one.margin < 0.0), None), known

    def margins(self, witness: Witness) -> list[Margin]:
        """Least room that a motion leaves to every kind of bound, the tightest first."""
        problem = self.judge.planner.optimizer.measured(witness.knots)
        return sorted(
            self.judge.measured(problem, self.chunk.fps, float(self.targets.steps[0])), key=lambda one: one.share
        )

    def reach(self, witness: Witness) -> Margin:
        """How far the palms of a motion are from where they are asked to be, at the worst."""
        _, k, side = witness.worst
        T, wanted, bound = witness.knots.T_palms[k, side], self.targets.T_palms[k, side], self.judge.config.verdict
        off = float(np.linalg.norm(T[:3, 3] - wanted[:3, 3]))
        turn, time = float(angle_between(T[:3, :3], wanted[:3, :3])), float(self.targets.steps[k])
        turned = not self.free[side] and turn / bound.turn_feasible > off / bound.palm_feasible
        code, value, bound = (
            (Limit.ORIENTATION, turn, bound.turn_feasible) if turned else (Limit.REACH, off, bound.palm_feasible)
        )
        return Margin(
            code=code, subject=PALMS[side], time=time, step=max(round(time * self.chunk.fps), 0), value=value,
            bound=bound, unit=code.unit, margin=bound - value, share=(bound - value) / bound,
        )  # fmt: skip

    def rests(self, known: Findings) -> tuple[bool, Findings]:
        """Whether postures at rest keep all bounds where motions missed: else it is in vain to go slower.

        What is known then comes with it.
        """
        return self._has_postures(EVERY, known)

    def _has_postures(self, enforced: frozenset[Limit], known: Findings) -> tuple[bool, Findings]:
        """Whether postures at rest are found at the knots that were missed last, from `POSTURES` starts each."""
        for k, near in known.missed_at[-2:]:
            kinds = enforced & AT_REST
            rests = known.resting(k, kinds)
            if rests is None:
                rests = self._posture_at(k, near, kinds)
                known = replace(known, at_rest={**known.at_rest, (k, kinds): rests})
            if not rests:
                return False, known
        return True, known

    def _posture_at(self, k: int, near: np.ndarray, enforced: frozenset[Limit]) -> bool:
        stills, body, generator = self.judge.stills, self.judge.planner.optimizer.body, np.random.default_rng(0)
        stills.enforced[:] = self._own.rows(enforced)
        stance, T, bounds = body.tables.q_stance, self.targets.T_palms[k], self.judge.config.verdict
        for start in range(POSTURES):
            q = (body.body_of(near), stance)[start] if start < 2 else scattered(body, stance, SPREAD, generator)
            stills.search(T, q, self.targets.q_fingers[k], self._rounds)
            off = np.linalg.norm(stills.T_palms[1, :, :3, 3] - T[:, :3, 3], axis=1).max() <= bounds.palm_feasible
            turn = np.where(self.free, 0.0, angle_between(stills.T_palms[1, :, :3, :3], T[:, :3, :3]))
            if off and turn.max() <= bounds.turn_feasible and stills.excess()[1] <= 1.0:
                return True
        return False


def _tries(enforced: frozenset[Limit], known: Findings, thorough: bool) -> list[Try]:
    """What a search within the bounds of these kinds begins with, as far as it has not yet.

    What keeps most of these bounds may be near to what keeps all: of what keeps as many, what was found last. Where one
    start has to do, it is the present posture, until one is found that only another motion leads to.
    """
    latest = known.motions[::-1]
    best = sorted(latest, key=lambda one: len(enforced & set(one.broken)))
    if not thorough:
        return [best[0] if known.moved else 0]
    tried = known.tried.get(enforced, ())
    return [one for one in (*best[:NEAREST], *range(STARTS)) if one not in tried]
