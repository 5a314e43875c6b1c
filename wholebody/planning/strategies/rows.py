"""When each strategy is tried and which attempt is kept, as rows that `docs/planner.md` shows.

The docstrings of the conditions and choices below are the words of that table.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from functools import cached_property

import numpy as np

from wholebody.config import PlannerConfig
from wholebody.planning.attempt import Attempt
from wholebody.planning.limit_projection import JUMP
from wholebody.planning.strategies.strategy import (
    ANEW,
    AS_GIVEN,
    FIRM_BOUNDS,
    FIRM_RELAXED,
    FREE_ORIENTATION,
    HOLDABLE,
    PARTED,
    PARTED_FIRM,
    RELAXED_ORIENTATION,
    UNREACHABLE,
    Strategy,
)
from wholebody.trajopt.budget import Budget

ARMS_SPENT_MAX = 1.08
"""Torque of an arm that is to hold a load still, as a share of the bound of plans; derived: their tolerance for it."""
HELD_RATE_MAX = 3.0
"""Fastest turn of the waist on the way to what is held [rad/s]: postures that hold a load lie apart, and a trunk thrown
from one to the next takes a leaning robot down; measured: a reach with 2 kg turns at 2.3, two falls at 4.6 and 5.6."""
CLEAR = 0.5
"""Share of the tolerances; derived: half of that of a distance is what the controller keeps less than a plan."""
RESERVE_UNREACHABLE = 0.15
"""Share of the budget that is kept while nothing is safe and hands are followed as far as they reach; chosen, no trial
is on record."""

Try = Callable[[Strategy, float, np.ndarray | None], Attempt]
"""Plans by a strategy with a slowdown; what its search begins with, if that is an attempt: configurations (k, nq)."""


class Overlap(Enum):
    """How near each other a chunk has the hands, where there are near poses at which they are apart."""

    NONE, TOLERATED, IN_THE_WAY = "apart", "no nearer than a plan that is followed may, or only after it", "nearer"


@dataclass(frozen=True)
class Asked:
    """Facts about a chunk before anything is tried, functions of the slowdown where they depend on it.

    Attributes:
        implausible: Whether what it means is a guess: then it is followed as if out of reach.
        overlap: Of its hands.
        lacking: How far off it a still robot has to hold what it carries [m]; 0 where hands carry nothing.
    """

    implausible: bool = False
    overlap: Callable[[float], Overlap] = lambda _: Overlap.NONE
    lacking: Callable[[float], float] = lambda _: 0.0


@dataclass
class Search:
    """Attempts at one speed.

    Attributes:
        config: Strategies' settings, and what counts as safe and as following.
        attempt: Makes one.
        budget: What all attempts together may compute; when it ends, so do attempts.
        asked: Of the chunk.
        first: What the speed began with.
        now: The best so far.
        begun: What the present rows began with.
    """

    config: PlannerConfig
    attempt: Try
    budget: Budget
    asked: Asked
    first: Attempt
    now: Attempt
    begun: Attempt

    @property
    def slowdown(self) -> float:
        """How many times slower than the chunk."""
        return self.first.targets.slowdown

    @property
    def jumps(self) -> bool:
        """Whether the chunk's steps are not what it can mean."""
        return self.asked.implausible or self.first.targets.projected.max() > JUMP

    @cached_property
    def heavy(self) -> bool:
        """Whether what hands carry is too heavy for the first attempt: its arms do not hold it, or no robot does."""
        config, first = self.config, self.first
        if self.jumps or first.arms_spent > ARMS_SPENT_MAX:
            return not self.jumps
        off = not first.follows(config) and first.tracking_error > config.tracking_error_max
        return off and self.asked.lacking(self.slowdown) > config.tracking_error_max


def is_far(config: PlannerConfig, one: Attempt) -> bool:
    """Whether nothing brings the palms near: so far away, or far away in spite of what they break."""
    return one.tracking_error > config.unreachable * (2.0 if one.is_safe(config) else 1.0)


def _is_clear(config: PlannerConfig, one: Attempt) -> bool:
    """Whether it is safe, and needs little of the tolerances for that."""
    return one.is_safe(config) and one.violation <= CLEAR * config.violation_max


# Conditions


def safe(search: Search) -> bool:
    """The plan is safe."""
    return search.now.is_safe(search.config)


def follows(search: Search) -> bool:
    """It follows, and the chunk does not jump."""
    return search.now.follows(search.config) and not search.jumps


def far(search: Search) -> bool:
    """The chunk jumps or is implausible, or a palm is so far off that nothing brings it near."""
    return search.jumps or is_far(search.config, search.first)


def within_reach(search: Search) -> bool:
    """A palm is not so far off that nothing brings it near."""
    return not far(search)


def out_of_reach(search: Search) -> bool:
    """The chunk jumps or is implausible, or a palm is off by more than `planner.unreachable`."""
    return far(search) or search.now.tracking_error > search.config.unreachable


def too_heavy(search: Search) -> bool:
    """The arms do not hold in the end what hands carry, or a still robot has to be far off the chunk with it."""
    return search.heavy


def lacks_strength(search: Search) -> bool:
    """It does not follow, and a still robot has to be off the chunk with what hands carry."""
    plain = not (search.jumps or search.heavy or search.now.follows(search.config))
    return plain and search.asked.lacking(search.slowdown) > 0.0


def turning_helps(search: Search) -> bool:
    """A palm is off by more than `planner.relax_error`, and not only where the plan begins, which no plan changes."""
    fixed = search.now.start_error if safe(search) else 0.0
    return search.now.tracking_error > max(search.config.relax_error, fixed)


def violates(search: Search) -> bool:
    """A bound is exceeded by more than its tolerance."""
    return search.now.violation > search.config.violation_max


def hands_near(search: Search) -> bool:
    """A palm is off or a bound exceeded, and the chunk has the hands nearer to each other than plans bring them."""
    in_vain = violates(search) or turning_helps(search)
    return in_vain and search.asked.overlap(search.slowdown) is Overlap.TOLERATED


def parted(search: Search) -> bool:
    """Hands are led apart: they are turned already, and know their way."""
    return search.now.strategy == PARTED.name


def not_parted(search: Search) -> bool:
    """Hands are not led apart."""
    return not parted(search)


def misled(search: Search) -> bool:
    """It began with the plan before, and breaks a bound or is a little off."""
    config, error = search.config, search.now.tracking_error
    return search.now.warm_started and (config.warm_start_error < error <= config.relax_error or violates(search))


def _reaches(search: Search) -> bool:
    return search.begun.tracking_error <= search.config.unreachable


def spends_tolerance(search: Search) -> bool:
    """It reaches, and needs more than half of a tolerance."""
    return _reaches(search) and not _is_clear(search.config, search.now)


def reaches_turned(search: Search) -> bool:
    """It reaches, and a palm is off."""
    return _reaches(search) and turning_helps(search)


def apart_in_vain(search: Search) -> bool:
    """It still does not follow well within the tolerances."""
    return not (_reaches(search) and _is_clear(search.config, search.now) and search.now.follows(search.config))


def firm_is_off(search: Search) -> bool:
    """A palm is far off then; with a load, a little off."""
    config = search.config
    return search.now.tracking_error > (config.warm_start_error if search.now.arms_spent > 0.0 else config.relax_error)


# Choices


def nearer(search: Search, new: Attempt) -> Attempt:
    """The safer one, and of two alike the nearer one."""
    config = search.config
    return min(
        search.now,
        new,
        key=lambda each: (not _is_clear(config, each), each.unsafety(config), each.tracking_error),
    )


def cheaper(search: Search, new: Attempt) -> Attempt:
    """Safe one of two attempts, or the cheaper one if both are or neither is."""
    return min(search.now, new, key=lambda one: (not one.is_safe(search.config), one.knots.cost))


def if_safe(search: Search, new: Attempt) -> Attempt | None:
    """The new one, if it is safe."""
    return new if new.is_safe(search.config) else None


def unless_less_safe(search: Search, new: Attempt) -> Attempt | None:
    """The new one, unless it alone is not safe."""
    return new if new.is_safe(search.config) or not safe(search) else None


def holds(search: Search, new: Attempt) -> Attempt | None:
    """The new one, if it holds the load and follows, or the load is what keeps it off."""
    config = search.config
    heavy = new.is_safe(config) and search.asked.lacking(search.slowdown) > config.clamp_tolerance
    holding = new.arms_spent <= ARMS_SPENT_MAX and new.waist_rate <= HELD_RATE_MAX
    return new if holding and (heavy or new.follows(config)) else None


def steadier(search: Search, new: Attempt) -> Attempt | None:
    """Choose the new one if it is safe and its soles hold, or the present one if that follows and is steadier."""
    config, now = search.config, search.now
    if not (new.is_safe(config) and new.deficit <= config.friction_deficit_unreachable):
        return None
    return now if now.follows(config) and now.imbalance(config) < new.imbalance(config) else new


@dataclass(frozen=True)
class Row:
    """A line of the table.

    Attributes:
        when: Where it holds, the row counts.
        strategy: What is tried; nothing if None.
        keep: What is gone on with, of the present attempt and the new one; the present one where it answers None.
        better: Rows for the new attempt before that; without a strategy, for the present one.
        then: Rows that follow where the new attempt is kept.
        reserve: Share of the budget that is kept from now on while nothing is safe; as before if None.
        take: Whether what is kept is the plan.
    """

    when: Callable[[Search], bool]
    strategy: Strategy | None = None
    keep: Callable[[Search, Attempt], Attempt | None] = nearer
    better: tuple[Row, ...] = ()
    then: tuple[Row, ...] = ()
    reserve: float | None = None
    take: bool = False


TURNED = (
    Row(misled, ANEW, cheaper),
    Row(turning_helps, RELAXED_ORIENTATION),
    Row(turning_helps, FREE_ORIENTATION),
)
"""Rows for palms that are far off: turning them brings them nearer, and beginning anew rarely does."""

APART = (
    Row(spends_tolerance, PARTED_FIRM),
    Row(reaches_turned, FREE_ORIENTATION),
    Row(apart_in_vain, AS_GIVEN, unless_less_safe, better=TURNED),
)

BETTER = (
    Row(safe, reserve=0),
    Row(hands_near, PARTED),
    Row(not_parted, better=TURNED),
    Row(parted, better=APART),
    Row(violates, FIRM_BOUNDS, if_safe, then=(Row(firm_is_off, FIRM_RELAXED),)),
)
"""What makes an attempt with full weight on the hands' positions better."""

AT_A_SPEED = (
    Row(too_heavy, HOLDABLE, holds, take=True),
    Row(within_reach, better=BETTER),
    Row(lacks_strength, HOLDABLE, holds, reserve=0, take=True),
    Row(follows, take=True),
    Row(out_of_reach, UNREACHABLE, steadier, reserve=RESERVE_UNREACHABLE, take=True),
    Row(far, better=BETTER),
)
"""What follows the first attempt at a speed, which is as given, or parted where the chunk itself has the hands nearer
to each other than a plan that is followed may."""
