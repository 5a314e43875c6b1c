"""A streak on the table that a hand wipes off."""

from __future__ import annotations

import numpy as np

from lerobot_robot_wholebody.drawn import Drawn
from models.places import TABLE_HEIGHT
from policy.action_spec.anchor import Anchor
from policy.scripted.chores import wipe_off
from policy.scripted.contact import HAND_HALF
from policy.scripted.policy import ScriptedPolicy
from wholebody.live.served.messages import Seen

SPOTS, HALF = 5, 0.08
"""How many spots a streak is of [no unit], and how far both ends are from its middle [m]; chosen: a hand's width
apart."""
MIDDLE, SPREAD, TURNED = (0.36, 0.16), (0.02, 0.03), 0.4
"""Usual middle of a streak, how far ahead and aside it is of that at most [m], and how far it is turned from across the
table at most, both ways [rad]; chosen: where the left hand reaches past both ends."""
WIPES, PUSHES = 0.03, (5.0, 20.0)
"""Distance of the palm from a spot that it wipes off [m], and forces with which it has to push on the table for that
[N]; chosen: less than a hand's half width, and what wipes, but does not scratch."""
GONE = -1.0
"""Height of the ball that shows a spot which was wiped off [m]; chosen: under the floor."""


class Wipe(Drawn):
    """A streak of spots on the table is to be wiped off with the left hand; it is elsewhere each time.

    Args:
        seed: Of where it is.

    Attributes:
        spots: Where they are, x and y in world, shape (n, 2), [m].
        left: Which of them are there, shape (n,).
    """

    scene, held, steps, words = "table", 1, 390, "wipe the streak off the table"
    marks = SPOTS
    names = tuple(f"to_streak_{end}_{axis}.pos" for end in ("near", "far") for axis in "xyz")

    def draw(self, rng: np.random.Generator) -> None:
        """Draw another streak from somebody's numbers."""
        middle, turned = MIDDLE + rng.uniform(-1.0, 1.0, 2) * SPREAD, TURNED * rng.uniform(-1.0, 1.0)
        way = HALF * np.array([np.sin(turned), -np.cos(turned)])
        self.spots = middle + np.linspace(-1.0, 1.0, SPOTS)[:, None] * way
        self.left = np.ones(SPOTS, dtype=bool)

    def objects(self, usual: np.ndarray) -> np.ndarray | None:
        """None are its own; what was wiped off is dirty again."""
        self.left[:] = True

    def script(self) -> ScriptedPolicy:
        """Motion of an expert."""
        return wipe_off(self.spots[[0, -1]])

    def shown(self, seen: Seen, anchor: Anchor, palms: np.ndarray) -> dict[str, float]:
        """The ways from the left palm to the nearer and the farther end of what is left; none where nothing is."""
        self._wipe(seen, palms)
        ends = self._ends(palms)
        ways = ends - palms[0] if len(ends) else np.zeros((2, 3))
        return dict(zip(self.names, ways.ravel().tolist(), strict=True))

    def in_world(self, anchor: Anchor) -> list[np.ndarray]:
        """The spots in world, (3,) each [m]; those that were wiped off are under the floor."""
        heights = np.where(self.left, TABLE_HEIGHT, GONE)
        return list(np.column_stack([self.spots, heights]))

    def far(self, seen: Seen, palms: np.ndarray) -> float:
        """Way of the palm to the nearer end of what is left, and on to the other one [m]; 0 where nothing is left."""
        self._wipe(seen, palms)
        ends = self._ends(palms)
        if not len(ends):
            return 0.0
        return float(np.linalg.norm(ends[0] - palms[0]) + np.linalg.norm(ends[1] - ends[0]))

    def _ends(self, palms: np.ndarray) -> np.ndarray:
        """Where the palm is on the nearer and the farther end of what is left, (2, 3) or none, [m]."""
        spots = np.column_stack([self.spots, np.full(SPOTS, TABLE_HEIGHT + HAND_HALF)])[self.left]
        ends = spots[[0, -1]] if len(spots) else spots
        return ends[np.argsort(np.linalg.norm(ends - palms[0], axis=1), kind="stable")]

    def _wipe(self, seen: Seen, palms: np.ndarray) -> None:
        """Wipe off what the left hand is on, if it pushes as it should."""
        least, most = PUSHES
        if least <= np.linalg.norm(seen.forces[0]) <= most:
            self.left &= np.linalg.norm(self.spots - palms[0, :2], axis=1) > WIPES
