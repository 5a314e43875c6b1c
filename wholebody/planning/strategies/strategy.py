"""Ways to plan a chunk: what each weighs, and what its search begins with."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum

from wholebody.config import PlannerConfig, TrajectoryConfig

FIRM_FACTOR = 3.0
"""Factor on the scales of the palms where bounds are exceeded for them; chosen: the bounds weigh nine times as much."""

GENTLE = 2.0
"""Factor on the scale of the palms' positions where they are led to what is held; measured: with 1 the plan of 2 kg
spends 95 % of the waist's torque, with 3 palms stay 5 mm further off."""


HANDS_LIGHT = {
    "position": 0.02,
    "orientation": 0.15,
    "orientation_give": 0.1,
    "com": 0.02,
    "zmp": 0.03,
    "torso": 0.2,
    "pelvis": 0.2,
    "posture": 0.5,
    "height": 0.05,
    "stillness": 2.0,
}
"""Scales other than the planner's for chunks that cannot be followed [m, rad, m/s]; chosen: hands weigh little beside
posture and balance, far less than any bound."""
HANDS_AS_FAR = HANDS_LIGHT | {"position_give": 0.1}
"""Scales of hands for targets out of reach [m, rad, m/s]; chosen: palm errors of up to 0.1 m in full."""
HANDS_LEFT_OUT = HANDS_LIGHT | {"position": 10.0, "orientation": 10.0}
"""Scales of hands where no motion follows them safely [m, rad, m/s]; chosen: the robot comes to rest."""


class BeginAt(Enum):
    """What the search of an attempt begins with; where that ends, inverse kinematics from knot to knot goes on."""

    PLAN_BEFORE = "the plan before, as long as it is near the palms wanted"
    LAST_ATTEMPT = "the attempt before it at the same speed"
    START = "the present state alone"


@dataclass(frozen=True)
class Strategy:
    """One way to plan a chunk.

    Attributes:
        name: As in reports.
        weights: Of the optimiser, from the planner's settings.
        begin: What its search begins with.
        slower: Instead, for a path that is followed slower than the chunk's own speed.
    """

    name: str
    weights: Callable[[PlannerConfig], TrajectoryConfig]
    begin: BeginAt
    slower: Strategy | None = None

    def at(self, slowdown: float) -> Strategy:
        """Strategy that is tried at a slowdown."""
        return self if slowdown == 1.0 or self.slower is None else self.slower


def _relaxed(config: PlannerConfig) -> TrajectoryConfig:
    return replace(config.posture, orientation=config.orientation_relaxed)


def _free(config: PlannerConfig) -> TrajectoryConfig:
    return replace(config.posture, orientation=config.orientation_free)


def _firm(config: PlannerConfig) -> TrajectoryConfig:
    posture = config.posture
    return replace(posture, position=FIRM_FACTOR * posture.position, orientation=FIRM_FACTOR * posture.orientation)


def _firm_relaxed(config: PlannerConfig) -> TrajectoryConfig:
    return replace(_firm(config), orientation=FIRM_FACTOR * config.orientation_relaxed)


def _gentle_free(config: PlannerConfig) -> TrajectoryConfig:
    posture = config.posture
    return replace(posture, position=GENTLE * posture.position, orientation=FIRM_FACTOR * config.orientation_free)


SLOWER = Strategy("slower", lambda c: c.posture, BeginAt.START)
AS_GIVEN = Strategy("as_given", lambda c: c.posture, BeginAt.PLAN_BEFORE, SLOWER)
PREVIEW = Strategy("preview", lambda c: c.posture, BeginAt.START)
"""A plan as given with hardly any search: enough to tell that a plain chunk can be done."""
ANEW = Strategy("as_given", lambda c: c.posture, BeginAt.START)
"""A plan as given once more, where beginning with the plan before led to where the search cannot leave."""
PARTED = Strategy("parted", _relaxed, BeginAt.PLAN_BEFORE, Strategy("parted", _relaxed, BeginAt.START))
"""Towards `HandsApart`, where a chunk has the hands nearer to each other than plans bring them."""
PARTED_FIRM = Strategy("parted", _firm_relaxed, BeginAt.LAST_ATTEMPT)
FIRM_BOUNDS = Strategy("firm_bounds", _firm, BeginAt.LAST_ATTEMPT)
FIRM_RELAXED = Strategy("firm_bounds", _firm_relaxed, BeginAt.LAST_ATTEMPT)
"""Firm bounds again, where palms may turn: a load is often held that way."""
RELAXED_ORIENTATION = Strategy("relaxed_orientation", _relaxed, BeginAt.LAST_ATTEMPT)
FREE_ORIENTATION = Strategy("free_orientation", _free, BeginAt.LAST_ATTEMPT)
HOLDABLE = Strategy("holdable", _gentle_free, BeginAt.START)
"""Palms towards `HoldablePlaces`, the search beginning with its postures: for loads that cannot be held as given."""
UNREACHABLE = Strategy("unreachable", lambda c: replace(c.posture, **HANDS_AS_FAR), BeginAt.PLAN_BEFORE)
FALLBACK = Strategy("fallback", lambda c: replace(c.posture, **HANDS_LIGHT), BeginAt.PLAN_BEFORE)
FALLBACK_ANEW = Strategy("fallback", lambda c: replace(c.posture, **HANDS_LIGHT), BeginAt.START)
STOP = Strategy("stop", lambda c: replace(c.posture, **HANDS_LEFT_OUT), BeginAt.START)
