"""What is to be done: goals, and whether they are met."""

from __future__ import annotations

import numpy as np

from policy.action_spec.anchor import Anchor

SIDES = ("left", "right")
LOW, HIGH = np.array([0.26, 0.10, 0.75]), np.array([0.42, 0.30, 1.15])
"""Corners of where a goal of the left palm can be, in the stance; the right one's are mirrored [m]; chosen: low ones
need a lean, all can be reached at once."""
REACHED = 0.03
"""Distance of a palm from its goal within which it is reached [m]; as of the trials in `docs/lerobot.md`."""


class Reach:
    """Both palms have a goal each, drawn anew by `next`.

    Args:
        seed: Of the goals.

    Attributes:
        goals: Of the left and right palm in the stance, shape (2, 3), [m].
        names: Of their numbers among observations.
        marks: How many balls show them.
    """

    marks = len(SIDES)
    names = tuple(f"goal_{side}_{axis}.pos" for side in SIDES for axis in "xyz")

    def __init__(self, seed: int) -> None:
        self._rng = np.random.default_rng(seed)
        self.next()

    def next(self) -> None:
        """Draw other goals."""
        self.draw(self._rng)

    def draw(self, rng: np.random.Generator) -> None:
        """Draw other goals from somebody's numbers."""
        self.goals = rng.uniform(LOW, HIGH, (2, 3)) * np.array([[1.0, 1.0, 1.0], [1.0, -1.0, 1.0]])

    def shown(self) -> dict[str, float]:
        """The goals' numbers by name."""
        return dict(zip(self.names, self.goals.ravel().tolist(), strict=True))

    def in_world(self, anchor: Anchor) -> list[np.ndarray]:
        """The goals in world, (3,) each [m]."""
        T = anchor.T_world_stance
        return [T[:3, :3] @ goal + T[:3, 3] for goal in self.goals]
