"""How long hands that were elsewhere are on their way to the first chunk."""

from __future__ import annotations

import numpy as np

from wholebody.config import START_MAX
from wholebody.config.verdict import VerdictConfig
from wholebody.episode.result import EpisodeResult

APPROACH_NEAR, APPROACH_FAR = 1.0, 2.5
"""Longest way to a chunk that begins elsewhere, up to and from `START_MAX` on: so fast the planner joins it where the
limits of a hand allow it; measured, 0.3 m take 0.8 s [s]."""
WENT = 0.5
"""Share of the distance at the start that the farther hand is away from there at the end of a way [no unit]; chosen."""


def approach_steps(result: EpisodeResult, bounds: VerdictConfig) -> int:
    """Steps from the first on in which the hands are still on their way to a chunk that began elsewhere.

    They are no fault of the plan. A way that takes longer is none: then every step counts, as it does where the first
    step was where the hands were, and where the chunk came to the hands instead of the hands to the chunk. A robot that
    was put as near to the first step as it can stand has no way to go: every step counts.
    """
    palms = result.palms
    # The hands are there once they are both commanded and measured there: a robot follows a little behind its command.
    away = np.maximum(palms.moved, palms.errors)
    turns = np.where(result.orientation_free, 0.0, np.maximum(palms.moved_turns, palms.turns))
    off = ((away > bounds.palm_feasible) | (turns > bounds.turn_feasible)).any(axis=1)
    if not off.size or off.all() or result.placed:
        return 0
    first = int(np.argmin(off))
    distance, angle = result.start_jump
    went = np.linalg.norm(palms.asked[first] - result.start_palms, axis=1).max()
    if distance > bounds.palm_feasible and went < WENT * distance:
        return 0
    turned = 0.0 if all(result.orientation_free) else angle
    longest = 0.0
    if distance > START_MAX[0] or turned > START_MAX[1]:
        longest = APPROACH_FAR
    elif distance > bounds.palm_feasible or turned > bounds.turn_feasible:
        longest = APPROACH_NEAR
    return first if palms.times[first] - palms.times[0] <= longest else 0
