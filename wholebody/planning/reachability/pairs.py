"""What the map is asked: a pair of palm points, how the palms are turned, and what they carry."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from itertools import product

import numpy as np

from policy.geometry.rotations import rotvec_to_matrix

MIRROR = np.diag([1.0, -1.0, 1.0])
"""Reflection from one side of the body to the other [no unit]; definition."""
BOX_LOW, BOX_HIGH = np.array([-0.3, -0.35, 0.05]), np.array([0.75, 0.75, 1.75])
"""Box of the points of the left palm that the map knows, in world, and of the right one mirrored [m]; chosen: past the
reach of the arms ahead, aside and up."""
PALM_AT_REST = np.array([0.26, 0.2, 0.86])
"""The left palm point in the stance [m]; derived: the stance of the G1 with hands."""
SHARES, NEAR_MAX = (0.15, 0.10, 0.15), 0.25
"""Shares of pairs for a fit that are mirror images, have one palm at rest, or are near each other, and up to how
far [m]; chosen: nobody asks for two points at random, and arms that are in each other's way are rare among them."""
LOAD_KNOWN = 2.0
"""Largest mass in a hand that it knows [kg]; derived: held level, the wrist's 5 N m are spent at 2 kg."""


class Turn(StrEnum):
    """How both palms are turned, right as the left one mirrored.

    Attributes:
        rotvec: Rotation of the left wrist in world, whose x points along the fingers and y out of the back of the hand.
        free: Whether nothing is asked.
        sentence: What it says.
    """

    rotvec: tuple[float, float, float]
    free: bool
    sentence: str

    def __new__(cls, code: str, degrees: tuple[float, float, float], sentence: str, free: bool = False) -> Turn:
        """A member with its rotation and sentence."""
        turn = str.__new__(cls, code)
        turn._value_, turn.sentence, turn.free = code, sentence, free
        turn.rotvec = tuple(np.deg2rad(degrees).tolist())
        return turn

    FACING = "facing", (0, 0, 0), "fingers ahead, palms facing each other"
    DOWN = "down", (90, 0, 0), "fingers ahead, palms down"
    UP = "up", (-90, 0, 0), "fingers ahead, palms up"
    HANGING = "hanging", (0, 90, 0), "fingers to the floor, palms facing each other"
    ANY = "any", (0, 0, 0), "however they are turned", True

    @property
    def rotations(self) -> np.ndarray:
        """Rotations of the left and the right palm in world, shape (2, 3, 3)."""
        R = rotvec_to_matrix(np.array(self.rotvec))
        return np.array([R, MIRROR @ R @ MIRROR])


TURNS = tuple(Turn)
"""Turns in the order of their numbers in a map."""
PALM_AHEAD = 0.15
"""Distance of a palm from a wrist that turns it [m]; chosen: the wrist's three joints are 0.08 to 0.21 m behind it."""
HIPS, LEANS, TWISTS = (0.76, 0.6, 0.42), (0.0, 30.0, 55.0), (0.0, 45.0, -45.0)
"""Heights of the pelvis [m], and angles by which the trunk leans and is twisted [deg], of postures in terms of which a
map sees a pair; chosen: all that the bounds allow, in three steps."""
SHOULDER_UP, SHOULDER_AHEAD, SHOULDER_ASIDE = 0.29, 0.20, 0.12
"""Shoulders above the pelvis, ahead of it where the trunk leans, and aside [m]; derived: URDF, and the pelvis goes back
by a third where the trunk leans."""


def _shoulders() -> np.ndarray:
    """Shoulders of the trunk in each of these postures, upright first, shape (27, 2, 3), [m]."""
    found = []
    for hip, lean, twist in product(HIPS, np.deg2rad(LEANS), np.deg2rad(TWISTS)):
        middle = np.array([SHOULDER_AHEAD * np.sin(lean), 0.0, hip + SHOULDER_UP * np.cos(lean)])
        aside = SHOULDER_ASIDE * np.array([-np.sin(twist), np.cos(twist), 0.0])
        found.append((middle + aside, middle - aside))
    return np.array(found)


def _palms_ahead() -> np.ndarray:
    """What leads from a wrist to its palm for each turn, nothing where it is free, shape (n_turns, 2, 3), [m]."""
    return np.array([(0.0 if turn.free else PALM_AHEAD) * turn.rotations[:, :, 0] for turn in TURNS])


BODY = _shoulders(), _palms_ahead()
"""What features are made with, for the kernels."""


@dataclass(frozen=True)
class Pairs:
    """n pairs of palms.

    Attributes:
        points: Palm points in world, left and right, shape (n, 2, 3), [m].
        turns: Numbers of their `Turn` in `TURNS`, shape (n,).
        loads: Masses in the hands, shape (n, 2), [kg].
    """

    points: np.ndarray
    turns: np.ndarray
    loads: np.ndarray

    def __len__(self) -> int:
        return len(self.turns)

    def __getitem__(self, chosen: np.ndarray | slice) -> Pairs:
        return Pairs(self.points[chosen], self.turns[chosen], self.loads[chosen])

    @staticmethod
    def of(parts: list[Pairs]) -> Pairs:
        """One after the other."""
        fields = zip(*((one.points, one.turns, one.loads) for one in parts), strict=True)
        return Pairs(*(np.concatenate(field) for field in fields))

    def mirrored(self) -> Pairs:
        """Mirror image of the pair, on the other side of the body."""
        return Pairs(self.points[:, ::-1] @ MIRROR, self.turns, self.loads[:, ::-1])

    def poses(self, i: int) -> np.ndarray:
        """Palm poses of one in world, shape (2, 4, 4)."""
        T = np.tile(np.eye(4), (2, 1, 1))
        T[:, :3, :3], T[:, :3, 3] = TURNS[self.turns[i]].rotations, self.points[i]
        return T


def draw(n: int, generator: np.random.Generator) -> Pairs:
    """Pairs drawn at random: both points in the box, half of them with empty hands."""
    points = generator.uniform(BOX_LOW, BOX_HIGH, (n, 2, 3))
    points[:, 1] = points[:, 1] @ MIRROR
    loads = generator.uniform(0.0, LOAD_KNOWN, (n, 2)) * (generator.random((n, 1)) < 0.5)
    return Pairs(points, generator.integers(0, len(TURNS), n), loads)


def draw_often_asked(n: int, generator: np.random.Generator) -> Pairs:
    """Pairs as of `draw`, but for shares of `SHARES`: mirror images, one palm at rest, and palms near each other."""
    pairs = draw(n, generator)
    left, right = pairs.points[:, 0], pairs.points[:, 1]
    mirrored, resting, near = np.split(generator.permutation(n), np.cumsum([round(share * n) for share in SHARES]))[:3]
    right[mirrored] = left[mirrored] @ MIRROR
    right[resting] = PALM_AT_REST * np.array([1.0, -1.0, 1.0])
    away = generator.standard_normal((len(near), 3))
    away *= NEAR_MAX * generator.random((len(near), 1)) / np.linalg.norm(away, axis=1, keepdims=True)
    right[near] = left[near] + away
    return pairs
