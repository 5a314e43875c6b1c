"""Why a chunk has no plan: smallest sets of kinds of bounds, each of which together forbids it.

What the chunk's own numbers exceed forbids it by itself. Of the bounds of a plan, some are added while the plan found
without them breaks them, worst first, until there is no plan: the last one is needed. That is repeated with what is
needed given, until that is enough. So with the set alone no plan is found from `chunk_program.STARTS` starts, and
without any one member of it one is found, which is kept. The searches are local: a set is irreducible as far as they
tell, and no more.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from wholebody.planning.judgement.chunk_margins import chunk_margins
from wholebody.planning.judgement.chunk_program import EVERY, NAMES, ChunkProgram, Witness
from wholebody.planning.judgement.limits import Limit, Margin

SETS = 3
"""Most disjoint sets of bounds of a plan that are looked for."""
SEARCHES = 30
"""Searches for a motion after which no further set is begun; chosen: some two seconds."""
RATES = (
    (Limit.HAND_SPEED, Limit.HAND_ACCELERATION, Limit.HAND_JERK),
    (Limit.TURN_SPEED, Limit.TURN_ACCELERATION, Limit.TURN_JERK),
)
"""Of each row the first that is exceeded is a cause: what is too fast is too sudden, too."""


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


def causes(program: ChunkProgram) -> list[Cause]:
    """All that are found of a chunk, what its own numbers exceed first; none if there is a plan as given."""
    found = list(_of_numbers(program))
    allowed = EVERY
    for number in range(SETS):
        if (number and program.searches > SEARCHES) or program.find(allowed) is not None:
            break
        one = _of_plan(program, allowed)
        found.append(one)
        allowed = allowed - set(one.kinds)
        if Limit.REACH in one.kinds:
            break
    return found


def _of_numbers(program: ChunkProgram) -> Iterator[Cause]:
    judge, chunk = program.judge, program.chunk
    margins = {one.code: one for one in chunk_margins(chunk, judge.planner.hand_limits, judge.spec)}
    margins[Limit.START] = judge.start_margin(chunk, program.begin, program.now)
    if judge.scene is not None and (near := judge.scene.asked(chunk)) is not None:
        margins[Limit.SCENE_DISTANCE] = near
    numbers = Limit.START, Limit.FINGER_RANGE, Limit.INTO_FLOOR, Limit.SCENE_DISTANCE
    exceeded = [code for code in numbers if code in margins]
    exceeded = [code for code in exceeded if margins[code].margin < 0.0]
    for row in RATES:
        exceeded += [code for code in row if code in margins and margins[code].margin < 0.0][:1]
    points = judge.asked(chunk)[0]
    for code in exceeded:
        one = margins[code]
        side = int(one.subject.startswith("right"))
        where = one.time, side, tuple(points[min(one.step, len(chunk) - 1), side].tolist())
        witness = program.find(frozenset())
        yield Cause((code,), (one,), where, witness is not None, {code: witness} if witness else {})


def _of_plan(program: ChunkProgram, allowed: frozenset[Limit]) -> Cause:
    """A smallest set among the kinds allowed, which together leave no plan."""
    kinds = _irreducible(program, allowed)
    found = {name: program.find(frozenset(kinds) - {name}) for name in kinds}
    witnesses = {name: witness for name, witness in found.items() if witness is not None}
    alone = program.find(frozenset(kinds), thorough=True) is None
    nearest = program.nearest()
    _, knot, side = nearest.worst
    time = min(float(nearest.targets.steps[knot]), (len(program.chunk) - 1) / program.chunk.fps)
    where = time, side, tuple(nearest.targets.T_palms[knot, side, :3, 3].tolist())
    best: dict[Limit, Margin] = {}
    for one in program.margins(nearest):
        if NAMES[one.code] in kinds:
            best.setdefault(NAMES[one.code], one)
    members = tuple(best[name] for name in kinds) if kinds else (program.reach(nearest),)
    irreducible = alone and len(witnesses) == len(kinds)
    return Cause(tuple(kinds) or (Limit.REACH,), members, where, irreducible, witnesses)


def _irreducible(program: ChunkProgram, allowed: frozenset[Limit]) -> list[Limit]:
    """Kinds that together leave no plan.

    Kinds are added while the plan found without them breaks them, worst first. The one that ends this is needed: there
    was a plan without it. Then the same is done with that one given, among those added before, until what is needed is
    enough.
    """
    needed: list[Limit] = []
    while True:
        kinds = list(needed)
        while (found := program.find(frozenset(kinds))) is not None:
            rest = [name for name in allowed if name not in kinds]
            if not rest:
                return kinds
            # Where a plan keeps the others by chance, all of them together are what forbids.
            kinds += [name for name in program.broken(found) if name in rest][:1] or sorted(rest)
        if len(kinds) == len(needed):
            return needed
        needed.append(kinds[-1])
        allowed = frozenset(kinds)
