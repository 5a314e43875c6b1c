"""Picking up and putting down, learned by `make loop TASK=place`: where the thing stands is drawn by a seed."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np

from models.places import ON_TABLE
from models.spec import RobotSpec
from policy.action_spec.anchor import Anchor
from policy.errors import PolicyError
from policy.learned import LEARNED_PLACE
from policy.learned.act import ActNetwork
from policy.learned.stance_act import FIRST_SEED, StanceAct
from policy.learned.things import shown_of, thing_in_stance
from policy.observation import Observation

WEIGHTS = Path(__file__).with_name("place.npz")
"""The network; what it learned from is in `README.md` beside it."""
SPREAD = (0.02, 0.04)
"""How far ahead and aside of its usual place the thing stands at most, both ways [m]; chosen."""
SPOT = (ON_TABLE[0], 0.02)
"""Where on the table it is to be put [m]; chosen: in the middle, 90 mm at least from where it stands."""
ON_SPOT, STANDS, LET_GO = 0.03, 0.005, 0.12
"""How far beside the spot and how high above the table it may be, and how near a palm may be to it [m]; chosen: half of
the cylinder's width, a sheet of rounding, and twice as far as in the palm."""
SECONDS = 14.0
"""Time of an episode [s]; derived: the 420 steps of the task."""


def off_spot(
    begin: np.ndarray, at: np.ndarray, palms: np.ndarray, spot: tuple[float, float] = SPOT, up: float = 0.0
) -> float:
    """How far a thing is from standing on a spot with no hand at it [m]; 0 or less: it is put down.

    Args:
        begin: Where it stood, (3,) [m].
        at: Where it is, (3,) [m].
        palms: Where both palms are, (2, 3) [m].
        spot: Where it is to be, x and y [m].
        up: How much higher it is to stand than it stood [m].
    """
    off, near = float(np.linalg.norm(at[:2] - spot)), float(np.linalg.norm(palms - at, axis=1).min())
    return max(off - ON_SPOT, abs(float(at[2] - begin[2]) - up) - STANDS, LET_GO - near)


def drawn(rng: np.random.Generator, spread: tuple[float, float] = SPREAD) -> np.ndarray:
    """How far ahead and to the left of its usual place a thing stands, drawn from somebody's numbers, (2,) [m]."""
    return rng.uniform(-1.0, 1.0, 2) * spread


@cache
def network() -> ActNetwork:
    """The network in the package, read once."""
    return ActNetwork.load(WEIGHTS)


class LearnedPlace(StanceAct):
    """Picks up the cylinder on the table and puts it down on the spot.

    Args:
        seed: Of where it stands.
        robot: As of `StanceAct`.

    Attributes:
        sees_objects: Whether observations are to tell where things are.
        off: How far the thing was from being put down when it was last seen [m], as of `off_spot`.

    Raises:
        PolicyError: If it is for another robot.
    """

    sees_objects = True

    def __init__(self, seed: int = 0, robot: RobotSpec | None = None) -> None:
        super().__init__(f"{LEARNED_PLACE}#{seed}", network(), SECONDS, robot)
        self._aside, self.off = drawn(np.random.default_rng(FIRST_SEED + seed)), np.inf
        self._first: np.ndarray | None = None

    @property
    def told(self) -> str:
        """What became of the thing, in words."""
        if self.off <= 0.0:
            return "the cylinder stood on the spot when it last looked: put down"
        return f"{1e3 * self.off:.0f} mm from done when it last looked: not put down"

    def arranged(self, usual: np.ndarray) -> np.ndarray:
        """Poses of the scene's bodies at the beginning (k, 7), given the usual ones.

        Raises:
            PolicyError: If there are none.
        """
        if not len(usual):
            raise PolicyError("it picks up the first thing of a scene, and there is none in this one")
        poses = np.array(usual)
        poses[0, :2] += self._aside
        return poses

    def reset(self, task: str = "") -> None:
        """Begin an episode; the task is told by numbers alone."""
        super().reset(task)
        self.off, self._first = np.inf, None

    def _shown(self, observation: Observation, anchor: Anchor, palms: np.ndarray) -> np.ndarray:
        thing = thing_in_stance(observation, anchor)
        self._first = thing if self._first is None else self._first
        self.off = off_spot(self._first, thing, palms)
        return shown_of(thing, palms)

    def _begin(self, observation: Observation, anchor: Anchor) -> np.ndarray:
        """What was asked for: of a hand that holds something the fingers are not where they were asked to be."""
        asked = self._asked(observation.time)
        return super()._begin(observation, anchor) if asked is None else asked
