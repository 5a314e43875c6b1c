"""The reach that was learned by `make loop`: both palms go to a goal each, drawn by a seed."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np

from models.spec import RobotSpec
from policy.action_spec.anchor import Anchor
from policy.learned import LEARNED
from policy.learned.act import ActNetwork
from policy.learned.stance_act import FIRST_SEED, StanceAct
from policy.observation import Observation

WEIGHTS = Path(__file__).with_name("reach.npz")
"""The network; what it learned from is in `README.md` beside it."""
LOW, HIGH = np.array([0.26, 0.10, 0.75]), np.array([0.42, 0.30, 1.15])
"""Corners of where a goal of the left palm can be, in the stance; the right one's are mirrored [m]; chosen: low ones
need a lean, all can be reached at once."""
REACHED = 0.03
"""Distance of a palm from its goal within which it is reached [m]; as of the trials in `docs/lerobot.md`."""
SECONDS = 5.0
"""Time of an episode [s]; derived: the 150 steps of the task."""


def goals_of(rng: np.random.Generator) -> np.ndarray:
    """Goals of the left and right palm in the stance, drawn from somebody's numbers, shape (2, 3), [m]."""
    return rng.uniform(LOW, HIGH, (2, 3)) * np.array([[1.0, 1.0, 1.0], [1.0, -1.0, 1.0]])


@cache
def network() -> ActNetwork:
    """The network in the package, read once."""
    return ActNetwork.load(WEIGHTS)


class LearnedReach(StanceAct):
    """Answers where the robot is with a way to its goals.

    Args:
        seed: Of the goals.
        robot: As of `StanceAct`.

    Attributes:
        goals: Of the left and right palm in the stance, shape (2, 3), [m].
        off: Larger distance of a palm from its goal when it was last seen [m].

    Raises:
        PolicyError: If it is for another robot.
    """

    def __init__(self, seed: int = 0, robot: RobotSpec | None = None) -> None:
        super().__init__(f"{LEARNED}#{seed}", network(), SECONDS, robot)
        self.goals, self.off = goals_of(np.random.default_rng(FIRST_SEED + seed)), np.inf

    @property
    def told(self) -> str:
        """What became of its goals, in words."""
        far = f"{1e3 * self.off:.0f} mm from the goal of the farther palm when it last looked"
        return f"{far}: {'reached' if self.off <= REACHED else 'not reached'}"

    def reset(self, task: str = "") -> None:
        """Begin an episode; the task is told by the goals alone."""
        super().reset(task)
        self.off = np.inf

    def _shown(self, observation: Observation, anchor: Anchor, palms: np.ndarray) -> np.ndarray:
        ways = self.goals - palms
        self.off = float(np.linalg.norm(ways, axis=1).max())
        return ways.ravel()
