"""Why a chunk has no plan: smallest sets of kinds of bounds, each of which together forbids it.

What the chunk's own numbers exceed forbids it by itself: without that bound, the hands' own path is the motion. Of
the bounds of a plan, those are added that the plan found without them breaks, worst first, until there is no plan; then
each is left out without which there is none either. So with the set alone no plan is found from
`chunk_program.STARTS` starts, and without any one member of it one is found, which is kept. The searches are local: a
set is irreducible as far as they tell, and no more.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from math import inf

import numpy as np

from policy.geometry.rotations import angle_between
from wholebody.planning.judgement.chunk_margins import AT_START, rates_from
from wholebody.planning.judgement.limits import Limit, Margin
from wholebody.verdict.why.chunk_program import ChunkProgram, WorkOverError
from wholebody.verdict.why.findings import NOTHING, Findings
from wholebody.verdict.why.motion_search import EVERY, NAMES, Witness

SETS = 3
"""Most disjoint sets of bounds of a plan that are looked for."""
RATES = (
    (Limit.HAND_SPEED, Limit.HAND_ACCELERATION, Limit.HAND_JERK),
    (Limit.TURN_SPEED, Limit.TURN_ACCELERATION, Limit.TURN_JERK),
)
"""Rates of hands in rows, of which the one that asks for the largest slow-down is a cause; the order of each in time
is its place in it."""


@dataclass(frozen=True)
class Cause:
    """Bounds that together forbid a chunk.

    Attributes:
        kinds: Names of their kinds; `Limit.REACH` where the hands cannot be there however the body moves.
        members: Where the chunk, or the motion nearest to it, runs into each of them.
        where: Time since the first step [s], hand (0 left, 1 right) and palm point asked for there (3,), [m].
        irreducible: Whether no plan is found with them alone, and one without any one of them.
        witnesses: For each kind a motion without it.
    """

    kinds: tuple[Limit, ...]
    members: tuple[Margin, ...]
    where: tuple[float, int, tuple[float, ...]]
    irreducible: bool
    witnesses: Mapping[Limit, Witness] = field(default_factory=dict, compare=False)


def causes(
    program: ChunkProgram, known: Findings = NOTHING, begin_max: float = inf, end_max: float = inf
) -> tuple[list[Cause], bool, Findings]:
    """What is found of a chunk, its own numbers first, then the smallest sets; nothing if there is a plan as given.

    Args:
        program: Of the chunk.
        known: What was found of it before.
        begin_max: Work of all searches from which no further set is begun.
        end_max: The same from which a set that was begun is given up.

    Returns:
        The causes, whether all were looked for, up to `SETS` sets, and what is known then.
    """
    found = list(_of_numbers(program))
    sets, every, known = _find_sets(program, known, begin_max, end_max)
    # A bound that forbids by itself says more than two that do so together.
    for kinds in sorted(sets, key=len):
        cause, known = _of_plan(program, kinds, known)
        found.append(cause)
    return found, every, known


def _find_sets(
    program: ChunkProgram, known: Findings, begin_max: float, end_max: float
) -> tuple[list[frozenset[Limit]], bool, Findings]:
    """Disjoint irreducible sets, whether all were looked for, up to `SETS` sets, and what is known then."""
    sets, allowed = list[frozenset[Limit]](), EVERY
    while len(sets) < SETS:
        if sets and known.work >= begin_max:
            return sets, False, known
        try:
            kinds, known = _irreducible(program, allowed, known, end_max)
        except WorkOverError as over:
            return sets, False, over.known
        if kinds is None:
            break
        sets.append(kinds)
        allowed = allowed - kinds
        if not kinds:
            break
    return sets, True, known


def _of_numbers(program: ChunkProgram) -> Iterator[Cause]:
    judge, chunk = program.judge, program.chunk
    margins, first = judge.numbers(chunk, program.begin, program.now), {}
    if _begins_there(program):
        every = rates_from(chunk, program.begin.hands, judge.planner.hand_limits)
        first = {one.code: one for one in every if one.subject.endswith(AT_START)}
    numbers = Limit.START, Limit.FINGER_RANGE, Limit.INTO_FLOOR, Limit.SCENE_DISTANCE
    exceeded = _exceeded(margins, numbers)
    for row in RATES[: 1 if program.free.all() else 2]:
        exceeded += _worst(margins, row) + _worst(first, row)
    points = judge.asked(chunk)[0]
    for one in exceeded:
        side = int(one.subject.startswith("right"))
        where = one.time, side, tuple(points[min(one.step, len(chunk) - 1), side].tolist())
        # Without it the hands' own path is the motion: no body is asked.
        yield Cause((one.code,), (one,), where, irreducible=True)


def _exceeded(margins: Mapping[Limit, Margin], codes: Iterable[Limit]) -> list[Margin]:
    return [margins[code] for code in codes if code in margins and margins[code].margin < 0.0]


def _worst(margins: Mapping[Limit, Margin], row: tuple[Limit, ...]) -> list[Margin]:
    """Exceeded rate that needs the largest slow-down."""
    return sorted(_exceeded(margins, row), key=slow_down)[-1:]


def slow_down(one: Margin) -> float:
    """How many times slower a rate is within its bound: a k-th one falls with the k-th power; 1 of other bounds."""
    power = next((1 + row.index(one.code) for row in RATES if one.code in row), 0)
    return (one.value / one.bound) ** (1.0 / power) if power else 1.0


def _begins_there(program: ChunkProgram) -> bool:
    """Whether the chunk is begun with its first step, and that with the hands: they have no time to join it."""
    judge, chunk, bounds = program.judge, program.chunk, program.judge.config.verdict
    (p, R), (at, turned) = judge.asked(chunk), judge.at(program.begin)
    far, turn = np.linalg.norm(at - p[0], axis=1).max(), angle_between(turned, R[0]).max()
    return bool(program.now <= chunk.t_obs and far <= bounds.palm_feasible and turn <= bounds.turn_feasible)


def _of_plan(program: ChunkProgram, kinds: frozenset[Limit], known: Findings) -> tuple[Cause, Findings]:
    """What is told of kinds that together leave no plan, and what is known then."""
    witnesses: dict[Limit, Witness] = {}
    for name in sorted(kinds):
        found, known = program.find(kinds - {name}, known)
        if found is not None:
            witnesses[name] = found
    nearest, known = program.nearest(known)
    _, knot, side = nearest.worst
    # The stop after the last step is the plan's: what the chunk asks for there is its last step.
    step = min(max(round(float(nearest.targets.steps[knot]) * program.chunk.fps), 0), len(program.chunk) - 1)
    where = step / program.chunk.fps, side, tuple(program.judge.asked(program.chunk)[0][step, side].tolist())
    best: dict[Limit, Margin] = {}
    for one in program.margins(nearest):
        if NAMES[one.code] in kinds:
            best.setdefault(NAMES[one.code], one)
    ordered = tuple(name for name in best if name in kinds)
    members = tuple(best[name] for name in ordered) if kinds else (program.reach(nearest),)
    # What was found for another set since may be a plan of this one after all.
    irreducible = len(witnesses) == len(kinds)
    if irreducible:
        found, known = program.find(kinds, known, thorough=True)
        irreducible = found is None
    return Cause(ordered or (Limit.REACH,), members, where, irreducible, witnesses), known


def _irreducible(
    program: ChunkProgram, allowed: frozenset[Limit], known: Findings, work_max: float
) -> tuple[frozenset[Limit] | None, Findings]:
    """Kinds among those allowed that together leave no plan, none of which can be left out; None if there is one.

    The kind that a plan breaks worst is added until there is no plan, then each is left out without which there is none
    either. So far one start has to do; where more of them find a plan after all, what that one breaks is added. What is
    known then comes with them.
    """
    find = partial(program.find, work_max=work_max)
    found, known = find(allowed, known)
    if found is not None:
        return None, known
    kinds: list[Limit] = []
    while True:
        found, known = find(frozenset(kinds), known)
        while found is not None:
            rest = [name for name in found.broken if name in allowed]
            if not rest:
                return None, known
            kinds.append(rest[0])
            found, known = find(frozenset(kinds), known)
        for name in list(kinds):
            found, known = find(frozenset(kinds) - {name}, known)
            if found is None:
                kinds.remove(name)
        found, known = find(frozenset(kinds), known, thorough=True)
        if found is None:
            return frozenset(kinds), known
