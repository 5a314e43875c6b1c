"""A chunk whose palms are out of reach from where the robot stands: where it would have to stand, beside the loop."""

from __future__ import annotations

from math import atan2

import numpy as np

from models.spec import RobotSpec
from policy.chunk import ActionChunk
from wholebody.config import ControllerConfig
from wholebody.errors import PlanningError
from wholebody.planning.plan import ChunkPlan
from wholebody.planning.reachability.standing_place import StandingPlace, stand_for
from wholebody.robot.feet import Feet
from wholebody.types import Reason

SPARE = 0.1
"""How much further from the palms than where it is sent the robot could stand [m]; chosen: it arrives within 3 cm, and
plans keep further from their bounds than a posture."""


class StandElsewhereError(PlanningError):
    """A chunk is in reach from another base; ``place`` is that one, with a posture that reaches it there."""

    def __init__(self, place: StandingPlace) -> None:
        super().__init__(place)
        self.place = place

    def __str__(self) -> str:
        x, y, heading = self.place.base
        return f"its hands are out of reach from here; from ({x:.2f}, {y:.2f}), heading {heading:.2f} rad, they are not"


def require_reach(chunk: ActionChunk, plan: ChunkPlan, spec: RobotSpec, config: ControllerConfig) -> None:
    """Let a plan pass that leads where its chunk ends, and one whose chunk ends out of reach from everywhere.

    Raises:
        StandElsewhereError: If the end of the chunk is in reach from another base.
    """
    if Reason.OUT_OF_REACH not in plan.report.changes:
        return
    left, right = ends(chunk)
    place = stand_for(left, right, base_of(plan.contacts.feet(), spec), config, spare=SPARE)
    if place.reached and place.steps > 0:
        raise StandElsewhereError(place)


def base_of(feet: Feet, spec: RobotSpec) -> tuple[float, float, float]:
    """Where a robot stands: midway between its soles x, y [m], and their heading [rad]."""
    x, y, _ = feet.floor(spec).point.tolist()
    ahead, aside, _ = feet.R[:, :, 0].sum(axis=0).tolist()
    return x, y, atan2(aside, ahead)


def ends(chunk: ActionChunk) -> np.ndarray:
    """Where the wrists of a chunk end, shape (2, 4, 4)."""
    return np.stack([chunk.T_world_lhand[-1], chunk.T_world_rhand[-1]])
