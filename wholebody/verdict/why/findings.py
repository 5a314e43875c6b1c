"""What searches for motions of one chunk have found so far: each search is begun with it, and returns it with more."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from wholebody.planning.judgement.limits import Limit
from wholebody.verdict.why.motion_search import Searched, Witness

Try = int | Witness
"""What a search begins with: the posture of a start, the present one for 0, or a motion that was found."""


@dataclass(frozen=True)
class Findings:
    """What is known of one chunk; nothing before the first search.

    Attributes:
        motions: Those that do it within whatever bounds, in the order in which they were found.
        moved: Whether what was found last was led to by a motion.
        tried: What searches within the bounds of some kinds began with in vain.
        missed_at: Knots that were missed, and postures near them.
        at_rest: Whether postures at rest keep the bounds of some kinds at a knot.
        nearest: What the planner's own weights come to with every bound enforced; None before that is searched.
        searches: Motions searched for so far.
        work: What that took, as budgets count it.
    """

    motions: tuple[Witness, ...] = ()
    moved: bool = False
    tried: Mapping[frozenset[Limit], tuple[Try, ...]] = field(default_factory=dict)
    missed_at: tuple[tuple[int, np.ndarray], ...] = ()
    at_rest: Mapping[tuple[int, frozenset[Limit]], bool] = field(default_factory=dict)
    nearest: Witness | None = None
    searches: int = 0
    work: float = 0.0

    def keeping(self, enforced: frozenset[Limit]) -> Witness | None:
        """The first motion within the bounds of these kinds; None if none was found."""
        return next((one for one in self.motions if one.keeps(enforced)), None)

    def missing(self, enforced: frozenset[Limit], starts: Iterable[Try]) -> bool:
        """Whether no plan was found within the bounds of kinds that were tried, from each of these, and none since."""
        return all(start in self.tried[enforced] for start in starts) and self.keeping(enforced) is None

    def resting(self, knot: int, enforced: frozenset[Limit]) -> bool | None:
        """Whether a posture at rest keeps these kinds at a knot, by what is known of more or fewer; None if nothing."""
        for (k, kinds), found in self.at_rest.items():
            if k == knot and (kinds >= enforced if found else kinds <= enforced):
                return found
        return None

    def counting(self, done: Searched) -> Findings:
        """These, and what a search came to."""
        return replace(
            self, motions=(*self.motions, *done.near), missed_at=(*self.missed_at, *done.missed),
            searches=self.searches + done.motions, work=self.work + done.work,
        )  # fmt: skip

    def without(self, enforced: frozenset[Limit], tried: Try) -> Findings:
        """These, and that nothing was found from there within the bounds of these kinds."""
        return replace(self, tried={**self.tried, enforced: (*self.tried.get(enforced, ()), tried)})


NOTHING = Findings()
"""What is known before the first search."""
