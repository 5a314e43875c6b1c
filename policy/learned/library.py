"""The policies in the package by name."""

from __future__ import annotations

from models.spec import RobotSpec
from policy.learned import LEARNED, LEARNED_PLACE
from policy.learned.place import LearnedPlace
from policy.learned.reach import LearnedReach
from policy.learned.stance_act import StanceAct

KINDS = {LEARNED: LearnedReach, LEARNED_PLACE: LearnedPlace}


def learned_policy(name: str, seed: int = 0, robot: RobotSpec | None = None) -> StanceAct:
    """The one of a name of `policy.learned.NAMES`, with what a seed draws.

    Raises:
        PolicyError: If it is for another robot.
    """
    return KINDS[name](seed, robot)
