"""In what ways a chunk is planned, in which order, and which of the plans is taken.

=====================  ===================================================================================
as given               the chunk's own speed, the planner's weights
slower                 the same at each of ``planner.slowdowns``, where the faster one is unsafe or far off
relaxed orientation    palms may turn away from their orientation where they miss their position
free orientation       the same with less weight still, where that is not enough
firm bounds            palms pull less, where they pull a bound past its tolerance
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

FIRM = 3.0
"""Factor on the scales of the palms where bounds are exceeded for them; chosen: the bounds weigh nine times as much."""


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


AS_GIVEN = Strategy("as_given", lambda c: c.posture, Begin.PLAN_BEFORE)
ANEW = Strategy("as_given", lambda c: c.posture, Begin.START)
"""As given again, where beginning with the plan before led to where the search cannot leave."""
SLOWER = Strategy("slower", lambda c: c.posture, Begin.START)
FIRM_BOUNDS = Strategy("firm_bounds", _firm, Begin.LAST_ATTEMPT)
RELAXED_ORIENTATION = Strategy("relaxed_orientation", _relaxed, Begin.LAST_ATTEMPT)
FREE_ORIENTATION = Strategy("free_orientation", _free, Begin.LAST_ATTEMPT)
UNREACHABLE = Strategy("unreachable", lambda c: c.weights_unreachable, Begin.PLAN_BEFORE)
FALLBACK = Strategy("fallback", lambda c: c.weights_fallback, Begin.PLAN_BEFORE)
FALLBACK_ANEW = Strategy("fallback", lambda c: c.weights_fallback, Begin.START)
STOP = Strategy("stop", lambda c: c.weights_stop, Begin.START)

Try = Callable[[Strategy, float, np.ndarray | None], Attempt]
"""Plans by a strategy with a slowdown; what its search begins with, if that is an attempt: configurations (k, nq)."""


def best(config: PlannerConfig, attempt: Try, *, implausible: bool) -> Attempt:
    """The first attempt that follows the chunk safely, else the safe one nearest to it, else the least unsafe one.

    Args:
        config: Strategies' settings, and what counts as safe and as following.
        attempt: Makes one.
        implausible: Whether what the chunk means is a guess: then it is followed as if out of reach.
    """
    tried: list[Attempt] = []
    for slowdown in (1.0, *config.slowdowns):
        now = _at_speed(config, attempt, slowdown)
        jumps = implausible or now.projected.max() > JUMP
        if now.follows(config) and not jumps:
            return now
        if jumps or now.tracking_error > config.unreachable:
            unreachable = attempt(UNREACHABLE, slowdown, None)
            if unreachable.is_safe(config) and unreachable.deficit <= config.friction_deficit_unreachable:
                steadier = now.follows(config) and now.imbalance(config) < unreachable.imbalance(config)
                return now if steadier else unreachable
        tried.append(now)
        # What is out of reach at the end stays so at any speed.
        if now.distance[-1].max() > config.tracking_error_max:
            break
    safe = [one for one in tried if one.is_safe(config)]
    if safe:
        return min(safe, key=lambda one: one.mean_error)
    return _without_hands(config, attempt, tried)


def _at_speed(config: PlannerConfig, attempt: Try, slowdown: float) -> Attempt:
    """The best attempt at one speed with full weight on the hands' positions."""
    now = attempt(AS_GIVEN if slowdown == 1.0 else SLOWER, slowdown, None)
    good = now.tracking_error <= config.warm_start_error and now.violation <= config.warm_start_violation
    if now.warm_started and not good:
        anew = attempt(ANEW, slowdown, None)
        now = min(now, anew, key=lambda one: (not one.is_safe(config), one.knots.cost))
    for strategy in (RELAXED_ORIENTATION, FREE_ORIENTATION):
        if now.tracking_error > config.relax_error:
            relaxed = attempt(strategy, slowdown, now.knots.q[1:])
            now = min(now, relaxed, key=lambda one: (one.violation > config.violation_max, one.tracking_error))
    if now.violation > config.violation_max:
        firm = attempt(FIRM_BOUNDS, slowdown, now.knots.q[1:])
        now = firm if firm.is_safe(config) else now
    return now


def _without_hands(config: PlannerConfig, attempt: Try, tried: list[Attempt]) -> Attempt:
    """Where nothing that follows the hands is safe: the bounds outweigh the hands by orders of magnitude."""
    fallback = attempt(FALLBACK, 1.0, None)
    if fallback.is_safe(config):
        return fallback
    others = (FALLBACK_ANEW, STOP) if fallback.warm_started else (STOP,)
    tried = [*tried, fallback, *(attempt(one, 1.0, None) for one in others)]
    return max(tried, key=lambda one: (one.violation <= config.violation_max, -one.imbalance(config)))
