"""Probabilities of a fall and of being followed."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Chance:
    """A probability and how well it is known.

    Attributes:
        p: Probability.
        low, high: Between which 90 % of the models fitted to other draws of the same data lie.
    """

    p: float
    low: float
    high: float


@dataclass(frozen=True, kw_only=True)
class Odds:
    """Odds of the chunk of an input that is likeliest to make the robot fall, and of the one least likely followed.

    Attributes:
        fall_as_given: That the robot falls where it is followed without plans, until 4 s after its last step.
        fall_s: When that chunk begins [s].
        followed: That it stands, with both palms within 20 mm of every step at its own time, by the supervisor.
        followed_s: When that chunk begins [s].
        alarm: Whether the first is so large that an alarm is due, at a bound that misses few falls; None where the
            model was fitted to too few falls for such a bound, or it would go off for most chunks that do not fall.
        unlike: Quantities in which a chunk is unlike those that the model was fitted to; then the numbers are a guess.
        chunks: How many chunks were looked at. fitted_to: How many the model was fitted to: few are a beginning.
        world: In which robot: ``true``, as modelled, or ``realistic``.
    """

    fall_as_given: Chance
    fall_s: float
    followed: Chance
    followed_s: float
    alarm: bool | None
    unlike: tuple[str, ...]
    chunks: int
    fitted_to: int
    world: str
