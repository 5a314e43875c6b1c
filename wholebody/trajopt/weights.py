"""Weights of the residuals, and scale and tolerance of every kind of bound."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from wholebody.config import TrajectoryConfig
from wholebody.trajopt.arrays import TrajectoryWeights
from wholebody.trajopt.layout import (  # fmt: skip
    BASE_HEIGHT,
    COM_EDGE,
    DISTANCE,
    N_BETWEEN,
    N_FRICTION,
    N_JOINTS,
    POSITION,
    STATIC,
    TILT,
    UPPER,
)

TORQUE_SCALE = 2e-2
"""Excess over a bound on torques that costs 1, as a share of it; chosen as `Bound` says."""
PER_EDGE = -1
"""Number of bounds where there is one for each edge of the support."""
SOFTNESS_MAX = 3.0
"""Largest factor on the scales of bounds on configurations; chosen: past a joint limit a leg can be straight, where
steps of the base are no longer linear in the joints."""


class Bound(NamedTuple):
    """One kind of bound of a knot.

    A scale is an excess that costs 1, far below what any margin allows for. A tolerance is less than the margin between
    the plan's bound and that of the controller or the robot; balance is judged from the whole curve besides.
    """

    name: str
    count: int
    scale: float
    tolerance: float
    unit: str
    on_configuration: bool


BOUNDS = (
    Bound("tilt of torso and pelvis", BASE_HEIGHT - TILT, 2e-3, 0.01, "rad", True),
    Bound("pelvis height", POSITION - BASE_HEIGHT, 1e-3, 0.01, "m", True),
    Bound("joint position", STATIC - POSITION, 3e-3, 0.05, "rad", True),
    Bound("waist torque at rest", DISTANCE - STATIC, 2e-2, 0.05, "share of the limit", True),
    Bound("distance to bodies and floor", COM_EDGE - DISTANCE, 1.5e-3, 0.012, "m", True),
    Bound("centre of mass", PER_EDGE, 1e-3, 0.005, "m", True),
    Bound("vertical force", 1, 1e-2, 0.05, "share of the weight", False),
    Bound("torque of waist and arms", UPPER, TORQUE_SCALE, 0.08, "share of the limit", False),
    Bound("zero-moment point", PER_EDGE, 1e-3, 0.02, "m", False),
    Bound("capture point", PER_EDGE, 2e-3, 0.006, "m", False),
    Bound("acceleration", N_JOINTS, 2.0, 30.0, "rad/s^2", False),
    Bound("speed", N_JOINTS, 0.05, 1.0, "rad/s", True),
    Bound("friction", N_FRICTION, 1e-2, 0.3, "share of the weight", False),
)
"""Bounds in the order of `wholebody.trajopt.layout`, scales and tolerances [unit of each]; chosen as `Bound` says."""


def weights(c: TrajectoryConfig) -> TrajectoryWeights:
    """Weights of the residuals."""
    return TrajectoryWeights(
        position=c.position,
        position_give=c.position_give,
        orientation=c.orientation,
        orientation_give=c.orientation_give,
        com=c.com**-2,
        torso=c.torso**-2,
        pelvis=c.pelvis**-2,
        height=c.height**-2,
        posture=c.posture**-2,
        zmp=c.zmp**-2,
        waist=c.waist_torque**-2,
        slide=c.slide**-2,
        smooth=c.smoothness**-2,
        speed=c.stillness**-2,
        legs=c.leg_stillness**-2,
    )


@lru_cache(maxsize=16)
def penalties(n_edges: int, softness: float) -> np.ndarray:
    """Penalties of the bounds of a knot, (n_inequalities,); their scales are multiplied by ``softness``."""
    firm = min(softness, SOFTNESS_MAX)
    scales = [bound.scale * (firm if bound.on_configuration else softness) for bound in BOUNDS]
    return _kept(_each(n_edges, scales) ** -2)


@lru_cache(maxsize=4)
def tolerances(n_edges: int) -> np.ndarray:
    """Tolerances of a knot: how much a plan that is followed may exceed its bounds, (n_inequalities,)."""
    return _kept(_each(n_edges, [bound.tolerance for bound in BOUNDS]))


@lru_cache(maxsize=16)
def between(softness: float) -> np.ndarray:
    """Penalties of the torques between knots, (N_BETWEEN,), where they count."""
    return _kept(np.full(N_BETWEEN, (softness * TORQUE_SCALE) ** -2))


def _kept(values: np.ndarray) -> np.ndarray:
    """Array made read-only: it is handed out again."""
    values.flags.writeable = False
    return values


def _each(n_edges: int, values: list[float]) -> np.ndarray:
    """One value for each kind of bound, for each bound of a knot (n_inequalities,)."""
    return np.repeat(values, [n_edges if bound.count == PER_EDGE else bound.count for bound in BOUNDS])
