"""The plan of a chunk: the first attempt that follows it safely, else the best of those made."""

from __future__ import annotations

from dataclasses import replace

from wholebody.config import PlannerConfig
from wholebody.planning.attempt import Attempt
from wholebody.planning.limit_projection import JUMP
from wholebody.planning.strategies.rows import AT_A_SPEED, BETTER, Asked, Overlap, Row, Search, Try, is_far
from wholebody.planning.strategies.strategy import AS_GIVEN, FALLBACK, FALLBACK_ANEW, PARTED, STOP
from wholebody.trajopt.budget import Budget

RESERVE = 0.25
"""Share of the budget that is kept while nothing is safe, for strategies that follow the hands less; chosen, no trial
is on record."""
ATTEMPT_MIN = 0.1
"""Share of the budget with which it is worth to begin one more attempt that follows the hands; chosen, no trial is on
record."""


def as_given(config: PlannerConfig, attempt: Try, budget: Budget, asked: Asked) -> Attempt | None:
    """What `best` takes of a plausible chunk where an attempt at its own speed follows it, else None."""
    budget.kept = RESERVE
    search = _begun(config, attempt, budget, asked, 1.0)
    if search.now.start_violation > config.violation_max or is_far(config, search.now):
        return None
    _go(search, BETTER)
    plain = search.now.targets.projected.max() <= JUMP and not search.heavy
    return search.now if plain and search.now.follows(config) else None


def best(config: PlannerConfig, attempt: Try, budget: Budget, asked: Asked) -> Attempt:
    """The first attempt that follows the chunk safely, else the safe one nearest to it, else the least unsafe one.

    Args:
        config: Strategies' settings, and what counts as safe and as following.
        attempt: Makes one.
        budget: What all attempts together may compute; when it ends, so do attempts.
        asked: Of the chunk.
    """
    tried: list[Attempt] = []
    for slowdown in (1.0, *config.slowdowns):
        budget.kept = 0.0 if any(one.is_safe(config) for one in tried) else RESERVE
        if tried and not budget.allows(ATTEMPT_MIN):
            break
        # Accelerations fall with the square of the slowdown, and what palms lack for them at least as much.
        lacks = min((one.tracking_error for one in tried), default=0.0) / slowdown**2
        if lacks > config.tracking_error_max and slowdown < max(config.slowdowns):
            continue
        search = _begun(config, attempt, budget, asked, slowdown)
        # No strategy mends where the plan begins: it is in the state. What is out of reach at the end stays so at any
        # speed.
        hopeless = search.now.start_violation > config.violation_max
        if not hopeless and _go(search, AT_A_SPEED):
            return search.now
        tried.append(search.now)
        if hopeless or search.now.distance[-1].max() > config.tracking_error_max:
            break
    safe = [one for one in tried if one.is_safe(config)]
    if safe:
        return min(safe, key=lambda one: one.mean_error)
    return _without_hands(config, attempt, budget, tried)


def _begun(config: PlannerConfig, attempt: Try, budget: Budget, asked: Asked, slowdown: float) -> Search:
    """Search at a speed, with what is tried first there."""
    strategy = PARTED if asked.overlap(slowdown) is Overlap.IN_THE_WAY else AS_GIVEN
    first = attempt(strategy.at(slowdown), slowdown, None)
    return Search(config, attempt, budget, asked, first, first, first)


def _go(search: Search, rows: tuple[Row, ...]) -> bool:
    """Go through rows; whether the plan is found, which is ``search.now``."""
    before, search.begun = search.begun, search.now
    found = any(_is_taken(search, row) for row in rows)
    search.begun = before
    return found


def _is_taken(search: Search, row: Row) -> bool:
    """Whether a row, after what it says is tried, ends the search."""
    if not row.when(search):
        return False
    if row.reserve is not None:
        search.budget.kept = 0.0 if search.now.is_safe(search.config) else row.reserve
    if row.strategy is None:
        _go(search, row.better)
        return row.take
    if not search.budget.allows(ATTEMPT_MIN):
        return False
    strategy = row.strategy.at(search.slowdown)
    new = search.attempt(strategy, search.slowdown, search.now.knots.q[1:])
    if row.better:
        improved = replace(search, now=new)
        _go(improved, row.better)
        new = improved.now
    kept = row.keep(search, new)
    if kept is None:
        return False
    search.now = kept
    if kept is new:
        _go(search, row.then)
    return row.take


def _without_hands(config: PlannerConfig, attempt: Try, budget: Budget, tried: list[Attempt]) -> Attempt:
    """Where nothing that follows the hands is safe: the bounds outweigh the hands by orders of magnitude."""
    budget.kept = 0.0
    for strategy in (FALLBACK, FALLBACK_ANEW, STOP):
        if not budget.allows(ATTEMPT_MIN / 2.0) or (strategy is FALLBACK_ANEW and not tried[-1].warm_started):
            continue
        tried.append(attempt(strategy, 1.0, None))
        if strategy is FALLBACK and tried[-1].is_safe(config):
            return tried[-1]
    return max(tried, key=lambda one: (one.violation <= config.violation_max, -one.imbalance(config)))
