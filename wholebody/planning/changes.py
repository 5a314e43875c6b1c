"""What was changed in a chunk to make it feasible, and where: each reason with what it does to the hands."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wholebody.config import PlannerConfig
from wholebody.planning.attempt import Attempt
from wholebody.planning.preparation import PreparedChunk, most_near
from wholebody.types import Reason

MOVED_MIN = 1e-3
"""Distance by which steps of a chunk are moved from which that is told [m]; chosen: less is within the scatter of a
policy."""


@dataclass(frozen=True)
class PlanChange:
    """Change of a chunk for one reason.

    Attributes:
        moved: How far a hand is elsewhere for it at each knot, shape (K,), [m].
        seen: Whether a person would see it there, a hand elsewhere or turned, or all of it slower, shape (K,).
        detail: One sentence about the whole chunk.
    """

    moved: np.ndarray
    seen: np.ndarray
    detail: str


def changes(
    chosen: Attempt,
    prepared: PreparedChunk,
    clamp: np.ndarray,
    config: PlannerConfig,
    *,
    elsewhere: bool,
    distance: float,
) -> dict[Reason, PlanChange]:
    """All of a chunk, the most important first.

    Args:
        chosen: The plan.
        prepared: The chunk that it is of.
        clamp: How far each hand was led along the plan at the knots, (K, 2), [m].
        config: Distance and angle from which a person sees that a hand is elsewhere.
        elsewhere: Whether the chunk begins where the hands are not.
        distance: How far the farther hand is from where the chunk has it at the first knot [m].
    """
    targets, times, near = chosen.targets, prepared.times, config.clamp_tolerance
    steps = targets.steps
    lift, noise, turn, jump = (
        most_near(times, values, steps)
        for values in (prepared.lift, prepared.moved, prepared.turned, targets.projected)
    )
    clamp, joining, slower = clamp.max(axis=1), _joining(chosen), targets.slowdown > 1.0
    if clamp.any() and distance > near:
        # A plan begins where the hands are: that they are away from the chunk there is seen all the same.
        clamp[0] = max(clamp[0], distance)
    none, every = np.zeros(len(steps)), np.ones(len(steps), dtype=bool)
    reached = f"targets moved by up to {max(clamp.max(), jump.max()):.3f} m, slowed {targets.slowdown:.2f} times"
    lifted = f"the hands were to go into the floor: targets lifted by {lift.max():.3f} m"
    scatter = f"steps scatter: followed the curve through them in {', '.join(prepared.smoothed)}"
    noisy = PlanChange(noise, (noise > near) | (turn > config.turn_tolerance), scatter)
    listed = (
        (Reason.INTO_FLOOR, lift.any(), PlanChange(lift, lift > 0.0, lifted)),
        (Reason.NOISY_CHUNK, prepared.implausible, noisy),
        (Reason.OUT_OF_REACH, clamp.any(), PlanChange(np.where(clamp > near, clamp, 0.0), clamp > near, reached)),
        (Reason.TOO_FAST_FOR_BALANCE, slower, PlanChange(none, every, reached)),
        (Reason.STEPS_JUMP, jump.max() > MOVED_MIN, PlanChange(jump, jump > near, reached)),
        (Reason.FAR_START, elsewhere, PlanChange(none, joining, reached)),
        (Reason.POSTURE_INFEASIBLE, not chosen.is_safe(config), PlanChange(none, every, reached)),
        (Reason.NOISY_CHUNK, prepared.smoothed and not prepared.implausible, noisy),
    )
    return {reason: change for reason, holds, change in listed if holds}


def _joining(chosen: Attempt) -> np.ndarray:
    """Whether a hand is still on its way to the chunk at each knot, shape (K,)."""
    ends = [path.join.s + path.join.duration for path in chosen.targets.paths if path.join is not None]
    return chosen.targets.steps < max(ends, default=-np.inf)
