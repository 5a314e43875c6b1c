"""In what ways a chunk is planned, in which order, and which of the plans is taken.

=====================  ===================================================================================
preview                as given with next to no search, where only whether is asked, not how well
as given               the chunk's own speed, the planner's weights
parted                 instead, where hands are asked into each other: towards the nearest poses at which they are apart
slower                 the same at each of ``planner.slowdowns``, where the faster one is unsafe or far off
relaxed orientation    palms may turn away from their orientation where they miss their position
free orientation       the same with less weight still, where that is not enough
firm bounds            palms pull less, where they pull a bound past its tolerance
held                   towards the nearest places where a still robot holds what it carries
unreachable            low weights on the hands, for targets out of reach and chunks that mean nothing
fallback               low weights on the hands, where nothing above is safe
stop                   no weight on the hands: come to rest
=====================  ===================================================================================
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from wholebody.config import PlannerConfig, TrajectoryConfig
from wholebody.planning.attempt import Attempt
from wholebody.planning.limit_projection import JUMP
from wholebody.trajopt.budget import Budget

FIRM = 3.0
"""Factor on the scales of the palms where bounds are exceeded for them; chosen: the bounds weigh nine times as much."""

GENTLE = 2.0
"""Factor on the scale of the palms' positions where they are led to what is held; measured: with 1 the plan of 2 kg
spends 95 % of the waist's torque, with 3 palms stay 5 mm further off."""

ARMS_SPENT_MAX = 1.08
"""Torque of an arm that is to hold a load still, as a share of the bound of plans; derived: their tolerance for it."""


class Begin(Enum):
    """What the search of an attempt begins with; where that ends, inverse kinematics from knot to knot goes on."""

    PLAN_BEFORE = "the plan before, as long as it is near the palms wanted"
    LAST_ATTEMPT = "the attempt before it at the same speed"
    START = "the present state alone"


@dataclass(frozen=True)
class Strategy:
    """One way to plan a chunk.

    Attributes:
        name: As in reports.
        weights: Of the optimiser, from the planner's settings.
        begin: What its search begins with.
    """

    name: str
    weights: Callable[[PlannerConfig], TrajectoryConfig]
    begin: Begin


def _relaxed(config: PlannerConfig) -> TrajectoryConfig:
    return replace(config.posture, orientation=config.orientation_relaxed)


def _free(config: PlannerConfig) -> TrajectoryConfig:
    return replace(config.posture, orientation=config.orientation_free)


def _firm(config: PlannerConfig) -> TrajectoryConfig:
    posture = config.posture
    return replace(posture, position=FIRM * posture.position, orientation=FIRM * posture.orientation)


def _firm_relaxed(config: PlannerConfig) -> TrajectoryConfig:
    return replace(_firm(config), orientation=FIRM * config.orientation_relaxed)


def _gentle_free(config: PlannerConfig) -> TrajectoryConfig:
    posture = config.posture
    return replace(posture, position=GENTLE * posture.position, orientation=FIRM * config.orientation_free)


AS_GIVEN = Strategy("as_given", lambda c: c.posture, Begin.PLAN_BEFORE)
PREVIEW = Strategy("preview", lambda c: c.posture, Begin.START)
"""As given, with hardly any search: enough to tell that a plain chunk can be done."""
ANEW = Strategy("as_given", lambda c: c.posture, Begin.START)
"""As given again, where beginning with the plan before led to where the search cannot leave."""
SLOWER = Strategy("slower", lambda c: c.posture, Begin.START)
PARTED = Strategy("parted", _relaxed, Begin.PLAN_BEFORE)
"""Towards `HandsApart`, where a chunk has the hands nearer to each other than plans bring them."""
PARTED_SLOWER = Strategy("parted", _relaxed, Begin.START)
PARTED_FIRM = Strategy("parted", _firm_relaxed, Begin.LAST_ATTEMPT)
FIRM_BOUNDS = Strategy("firm_bounds", _firm, Begin.LAST_ATTEMPT)
FIRM_RELAXED = Strategy("firm_bounds", _firm_relaxed, Begin.LAST_ATTEMPT)
"""Firm bounds again, where palms may turn: a load is often held that way."""
RELAXED_ORIENTATION = Strategy("relaxed_orientation", _relaxed, Begin.LAST_ATTEMPT)
FREE_ORIENTATION = Strategy("free_orientation", _free, Begin.LAST_ATTEMPT)
HELD = Strategy("held", _gentle_free, Begin.START)
"""Palms towards `HoldablePlaces`, the search beginning with its postures: for loads that cannot be held as given."""
UNREACHABLE = Strategy("unreachable", lambda c: c.weights_unreachable, Begin.PLAN_BEFORE)
FALLBACK = Strategy("fallback", lambda c: c.weights_fallback, Begin.PLAN_BEFORE)
FALLBACK_ANEW = Strategy("fallback", lambda c: c.weights_fallback, Begin.START)
STOP = Strategy("stop", lambda c: c.weights_stop, Begin.START)

HELD_RATE_MAX = 3.0
"""Fastest turn of the waist on the way to what is held [rad/s]: postures that hold a load lie apart, and a trunk thrown
from one to the next takes a leaning robot down; measured: a reach with 2 kg turns at 2.3, two falls at 4.6 and 5.6."""

Try = Callable[[Strategy, float, np.ndarray | None], Attempt]
"""Plans by a strategy with a slowdown; what its search begins with, if that is an attempt: configurations (k, nq)."""


class Overlap(Enum):
    """How near each other a chunk has the hands, where there are near poses at which they are apart."""

    NONE, TOLERATED, IN_THE_WAY = "apart", "no nearer than a plan that is followed may, or only after it", "nearer"


@dataclass(frozen=True)
class Asked:
    """What is known of a chunk before anything is tried, by slowdown where it is a function.

    Attributes:
        implausible: Whether what it means is a guess: then it is followed as if out of reach.
        overlap: Of its hands.
        lacking: How far off it a still robot has to hold what it carries [m]; 0 where hands carry nothing.
    """

    implausible: bool = False
    overlap: Callable[[float], Overlap] = lambda _: Overlap.NONE
    lacking: Callable[[float], float] = lambda _: 0.0


CLEAR = 0.5
"""Share of the tolerances; derived: half of that of a distance is what the controller keeps less than a plan."""
RESERVE, RESERVE_UNREACHABLE = 0.25, 0.15
"""Share of the budget that is kept while nothing is safe, for strategies that follow the hands less: while attempts
follow them in full, and as far as they reach; chosen, no trial is on record."""
ATTEMPT_MIN = 0.1
"""Share of the budget with which it is worth to begin one more attempt that follows the hands; chosen, no trial is on
record."""


def as_given(config: PlannerConfig, attempt: Try, budget: Budget, asked: Asked) -> Attempt | None:
    """What `best` takes of a plausible chunk where an attempt at its own speed follows it, else None."""
    budget.kept = RESERVE
    now = attempt(_first(1.0, asked), 1.0, None)
    if now.start_violation > config.violation_max or _far(config, now):
        return None
    now = _improved(config, attempt, budget, now, asked)
    return now if now.follows(config) and now.targets.projected.max() <= JUMP else None


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
        now = attempt(_first(slowdown, asked), slowdown, None)
        jumps = asked.implausible or now.targets.projected.max() > JUMP
        if now.start_violation > config.violation_max:
            # No strategy mends that: it is in the state that the plan begins with.
            tried.append(now)
            break
        far = jumps or _far(config, now)
        heavy = not jumps and _heavy(config, now, asked)
        held = _held(config, attempt, budget, slowdown, asked) if heavy else None
        if held is None and not far:
            now = _improved(config, attempt, budget, now, asked)
        if not (jumps or heavy or now.follows(config)) and asked.lacking(slowdown) > 0.0:
            budget.kept = 0.0
            held = _held(config, attempt, budget, slowdown, asked)
        if held is not None:
            return held
        if now.follows(config) and not jumps:
            return now
        if far or now.tracking_error > config.unreachable:
            steady = _out_of_reach(config, attempt, budget, now)
            if steady is not None:
                return steady
            now = _improved(config, attempt, budget, now, asked) if far else now
        tried.append(now)
        # What is out of reach at the end stays so at any speed.
        if now.distance[-1].max() > config.tracking_error_max:
            break
    safe = [one for one in tried if one.is_safe(config)]
    if safe:
        return min(safe, key=lambda one: one.mean_error)
    return _without_hands(config, attempt, budget, tried)


def _first(slowdown: float, asked: Asked) -> Strategy:
    """What is tried first at a speed."""
    if asked.overlap(slowdown) is Overlap.IN_THE_WAY:
        return PARTED if slowdown == 1.0 else PARTED_SLOWER
    return AS_GIVEN if slowdown == 1.0 else SLOWER


def _heavy(config: PlannerConfig, now: Attempt, asked: Asked) -> bool:
    """Whether what hands carry is too heavy for an attempt: its arms do not hold it in the end, or no robot does."""
    if now.arms_spent > ARMS_SPENT_MAX:
        return True
    far = not now.follows(config) and now.tracking_error > config.tracking_error_max
    return far and asked.lacking(now.targets.slowdown) > config.tracking_error_max


def _held(config: PlannerConfig, attempt: Try, budget: Budget, slowdown: float, asked: Asked) -> Attempt | None:
    """Palms led to where a still robot holds its load, if that follows the chunk, or the load is what keeps it off."""
    if not budget.allows(ATTEMPT_MIN):
        return None
    held = attempt(HELD, slowdown, None)
    too_heavy = held.is_safe(config) and asked.lacking(slowdown) > config.clamp_tolerance
    holds = held.arms_spent <= ARMS_SPENT_MAX and held.waist_rate <= HELD_RATE_MAX
    return held if holds and (too_heavy or held.follows(config)) else None


def _far(config: PlannerConfig, now: Attempt) -> bool:
    """Whether nothing brings the palms near: so far away, or far away in spite of what they break."""
    return now.tracking_error > config.unreachable * (2.0 if now.is_safe(config) else 1.0)


def _improved(config: PlannerConfig, attempt: Try, budget: Budget, now: Attempt, asked: Asked) -> Attempt:
    """An attempt with full weight on the hands' positions, or a better one at the same speed."""
    budget.kept = 0.0 if now.is_safe(config) else budget.kept
    slowdown = now.targets.slowdown
    in_vain = now.violation > config.violation_max or _turning_helps(config, now)
    if in_vain and asked.overlap(slowdown) is Overlap.TOLERATED and budget.allows(ATTEMPT_MIN):
        now = _nearer(config, now, attempt(PARTED_SLOWER if slowdown > 1.0 else PARTED, slowdown, None))
    improved = _improved_apart if now.strategy == PARTED.name else _improved_as_given
    now = improved(config, attempt, budget, now)
    if now.violation > config.violation_max and budget.allows(ATTEMPT_MIN):
        firm = attempt(FIRM_BOUNDS, slowdown, now.knots.q[1:])
        now = firm if firm.is_safe(config) else now
        enough = config.warm_start_error if now.arms_spent > 0.0 else config.relax_error
        if now is firm and now.tracking_error > enough and budget.allows(ATTEMPT_MIN):
            now = _nearer(config, now, attempt(FIRM_RELAXED, slowdown, now.knots.q[1:]))
    return now


def _improved_as_given(config: PlannerConfig, attempt: Try, budget: Budget, now: Attempt) -> Attempt:
    """Where palms are far off, turning them brings them nearer, and beginning anew rarely does."""
    slowdown, violates = now.targets.slowdown, now.violation > config.violation_max
    a_little_off = config.warm_start_error < now.tracking_error <= config.relax_error
    if now.warm_started and (a_little_off or violates) and budget.allows(ATTEMPT_MIN):
        anew = attempt(ANEW, slowdown, None)
        now = min(now, anew, key=lambda one: (not one.is_safe(config), one.knots.cost))
    for strategy in (RELAXED_ORIENTATION, FREE_ORIENTATION):
        if _turning_helps(config, now) and budget.allows(ATTEMPT_MIN):
            now = _nearer(config, now, attempt(strategy, slowdown, now.knots.q[1:]))
    return now


def _improved_apart(config: PlannerConfig, attempt: Try, budget: Budget, now: Attempt) -> Attempt:
    """Hands that were led apart are turned already, and know their way; as given where that does not follow."""
    slowdown = now.targets.slowdown
    near = now.tracking_error <= config.unreachable
    if near and not _is_clear(config, now) and budget.allows(ATTEMPT_MIN):
        now = _nearer(config, now, attempt(PARTED_FIRM, slowdown, now.knots.q[1:]))
    if near and _turning_helps(config, now) and budget.allows(ATTEMPT_MIN):
        now = _nearer(config, now, attempt(FREE_ORIENTATION, slowdown, now.knots.q[1:]))
    if (near and _is_clear(config, now) and now.follows(config)) or not budget.allows(ATTEMPT_MIN):
        return now
    given = _improved_as_given(config, attempt, budget, attempt(SLOWER if slowdown > 1.0 else AS_GIVEN, slowdown, None))
    return given if given.is_safe(config) or not now.is_safe(config) else now


def _nearer(config: PlannerConfig, one: Attempt, other: Attempt) -> Attempt:
    """The safer of two attempts, and of two alike the one that is nearer to the chunk."""
    return min(one, other, key=lambda each: (not _is_clear(config, each), each.unsafety(config), each.tracking_error))


def _is_clear(config: PlannerConfig, one: Attempt) -> bool:
    """Whether it is safe, and needs little of the tolerances for that."""
    return one.is_safe(config) and one.violation <= CLEAR * config.violation_max


def _turning_helps(config: PlannerConfig, now: Attempt) -> bool:
    """Whether a palm is off that may come nearer if it turns: where the plan begins, no plan changes how far it is."""
    fixed = now.start_error if now.is_safe(config) else 0.0
    return now.tracking_error > max(config.relax_error, fixed)


def _out_of_reach(config: PlannerConfig, attempt: Try, budget: Budget, now: Attempt) -> Attempt | None:
    """The chunk followed as if out of reach, if that is steady; ``now`` where it follows and is steadier."""
    budget.kept = 0.0 if now.is_safe(config) else RESERVE_UNREACHABLE
    if not budget.allows(ATTEMPT_MIN):
        return None
    far = attempt(UNREACHABLE, now.targets.slowdown, None)
    if not (far.is_safe(config) and far.deficit <= config.friction_deficit_unreachable):
        return None
    return now if now.follows(config) and now.imbalance(config) < far.imbalance(config) else far


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
