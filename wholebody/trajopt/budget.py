"""How much the plan of a chunk may compute."""

from __future__ import annotations

from math import inf
from time import thread_time

KNOTS = 40
"""Knots of the plan whose linearisation, or step, counts as one: those of a chunk of 50 steps at its own speed."""
SEARCH_MAX = 42.0
"""Most linearisations and steps of one search, each of all its knots if these are more than `KNOTS` [no unit];
measured: nine in ten end by themselves before."""


class Budget:
    """Work for a plan: linearisations and steps, the same on every machine, and CPU time where that is limited.

    Args:
        work: Linearisations and steps of `KNOTS` knots together; those of fewer or more knots count in proportion.
        seconds: CPU time of this thread from now on [s]; with a limit, the plan depends on the machine.

    Attributes:
        spent: Work done so far.
        kept: Share of work and time that is kept for later.
        timed_out: Whether a search was ended, or not begun, for lack of time.
    """

    def __init__(self, work: float = inf, seconds: float = inf) -> None:
        self._work, self._seconds, self._begin = work, seconds, thread_time()
        self.spent = self.kept = 0.0
        self.timed_out = False
        self.begin_search(KNOTS)

    def count(self, knots: int) -> None:
        """One linearisation or step of so many knots was done."""
        self.spent += knots / KNOTS

    def allows(self, share: float) -> bool:
        """Whether that share of work and time is left for another search, without what is kept for later."""
        room = 1.0 - self.kept - share
        return self._allows(self.spent <= room * self._work, self._elapsed <= room * self._seconds)

    def begin_search(self, knots: int) -> None:
        """A search begins, of so many knots: it takes `SEARCH_MAX` at most, and leaves what is kept for later."""
        room, most = 1.0 - self.kept, SEARCH_MAX * max(knots / KNOTS, 1.0)
        self._search = self.spent, self._elapsed
        self._search_end = min(room * self._work, self.spent + most), room * self._seconds

    def affords(self, knots: int) -> bool:
        """Whether the search that is going on may do linearisations and steps of so many knots together."""
        work, seconds = self._search_end
        return self._allows(self.spent + knots / KNOTS <= work, self._elapsed <= seconds)

    @property
    def half_spent(self) -> bool:
        """Whether half of what the search had is spent."""
        (begin, since), (work, seconds) = self._search, self._search_end
        return 2.0 * self.spent > begin + work or 2.0 * self._elapsed > since + seconds

    @property
    def _elapsed(self) -> float:
        """CPU time since the beginning [s]; not looked at where it is not limited."""
        return 0.0 if self._seconds == inf else thread_time() - self._begin

    def _allows(self, work: bool, time: bool) -> bool:
        self.timed_out |= not time
        return work and time
