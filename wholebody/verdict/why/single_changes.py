"""Single changes of a chunk, of each kind the smallest that makes it hold.

A change is tried by planning the changed chunk at its own speed and no other, which is enough to tell: a chunk that is
planned slower does not hold. What is told is a change that held.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf

import numpy as np

from policy.chunk import ActionChunk
from wholebody.planning.judgement.chunk_judge import ChunkJudge
from wholebody.planning.plan import ChunkPlan
from wholebody.verdict.repair import Change, ChangeKind, changed, hands_of, slowed, towards

MOVED_MOST, SLOWER_MOST = 0.15, 3.0
"""How far a palm may be moved, and how many times slower a chunk may be, by a change that is offered [m, no unit];
chosen: what a person would still call the same motion, nearer or slower."""
SLOWER_FIRST = 2.0
"""Slow-down that is tried before the largest one [no unit]; chosen: most that help are less, and shorter to plan."""
FINE, HALVINGS = 0.02, 5
"""Slow-downs are found to this share, others to so many halvings of their range; chosen."""


class SingleChanges:
    """Changes one chunk that does not hold.

    Args:
        judge: Holds the robot.
        chunk: A valid chunk.
        plan: What was planned for it.
        at_first: Whether a chunk is feasible as it is, by its plan at its own speed, as far as little work tells.
        holds: The same with all the work that a plan may take: what is told has to hold by both.
        work: Linearisations and steps after which no further change is tried.

    Attributes:
        complete: Whether there was work left for every try.
    """

    def __init__(
        self,
        judge: ChunkJudge,
        chunk: ActionChunk,
        plan: ChunkPlan,
        at_first: Callable[[ActionChunk], bool],
        holds: Callable[[ActionChunk], bool],
        work: float = inf,
    ) -> None:
        self._judge, self._plan, self._left = judge, plan, work
        self._at_first, self._holds = at_first, holds
        self.chunk, self.complete = chunk, True

    def all(self) -> list[Change]:
        """Smallest change of each kind that is found; none for what that kind does not cure."""
        found = self.slower(), self.moved(), self.turned(), self.lighter()
        return [one for one in found if one is not None]

    def slower(self) -> Change | None:
        """The least slow-down."""
        for low, high in ((1.0, SLOWER_FIRST), (SLOWER_FIRST, SLOWER_MOST)):
            least = self._least(lambda x: slowed(self.chunk, float(np.exp(x))), np.log(low), np.log(high), FINE)
            if least is not None:
                return self._change("slower", slowed(self.chunk, float(np.exp(least))), float(np.exp(least)))
        return None

    def moved(self) -> Change | None:
        """Palms led the least share of the way to where the plan has them."""
        return self._bent("moved", 1.0, 0.0)

    def turned(self) -> Change | None:
        """Palms turned the least share of the way to how the plan has them."""
        return self._bent("turned", 0.0, 1.0)

    def lighter(self) -> Change | None:
        """Lightening of the loads that are told, by the least share that helps."""
        loads = self._judge.loads
        if not sum(loads):
            return None

        def lightened(share: float) -> ActionChunk:
            self._judge.carry(*((1.0 - share) * load for load in loads))
            return self.chunk

        try:
            share = self._least(lightened, 0.0, 1.0, 0.5**HALVINGS)
        finally:
            self._judge.carry(*loads)
        return None if share is None else Change("lighter", 1.0, 0.0, 0.0, self.chunk, share * sum(loads))

    def _bent(self, kind: ChangeKind, position: float, turn: float) -> Change | None:
        goal = hands_of(self._plan, self.chunk)

        def led(share: float) -> ActionChunk:
            return towards(self.chunk, goal, share * position, share * turn, self._judge.planner.offsets)

        share = self._least(led, 0.0, 1.0, 0.5**HALVINGS)
        return None if share is None else self._change(kind, led(share), 1.0)

    def _least(self, chunk_at: Callable[[float], ActionChunk], low: float, high: float, fine: float) -> float | None:
        """The least value found to hold, by bisection below a larger one; None if that does not hold."""
        found, middle, optimizer = [], high, self._judge.planner.optimizer
        end = optimizer.work + self._left
        while not found or high - low > fine:
            if optimizer.work >= end:
                self.complete = False
                break
            if self._at_first(chunk_at(middle)):
                found.append(middle)
                high = middle
            elif not found:
                break
            else:
                low = middle
            middle = 0.5 * (low + high)
        held = next((value for value in reversed(found) if self._holds(chunk_at(value))), None)
        self._left = end - optimizer.work
        return held

    def _change(self, kind: ChangeKind, chunk: ActionChunk, factor: float) -> Change:
        return Change(kind, factor, *changed(self._judge, slowed(self.chunk, factor), chunk), chunk)
