"""What each row of the plan's program costs; a bound's weight is one over its scale squared."""

from __future__ import annotations

import numpy as np

from wholebody.config import TrajectoryConfig
from wholebody.planning.trajopt.layout import (  # fmt: skip
    EDGE,
    HOLD,
    LIMIT,
    LOAD,
    LOWEST,
    N_JOINTS,
    NEAR,
    TILT,
    TORQUE,
    ZMP,
    Scales,
    n_sided,
)

TILT_SCALE = 2e-3
"""Excess of a tilt that costs as much as 1 [rad]; likewise below."""
LOWEST_SCALE = 1e-3
"""[m]"""
LIMIT_SCALE = 3e-3
"""[rad]"""
HOLD_SCALE = 2e-2
"""Share of the torque limit."""
DISTANCE_SCALE = 1.5e-3
"""[m]"""
COM_SCALE = 1e-3
"""[m]"""
LOAD_SCALE = 1e-2
"""Share of the weight."""
TORQUE_SCALE = 2e-2
"""Share of the torque limit."""
ZMP_SCALE = 1e-3
"""[m]"""
CAPTURE_SCALE = 2e-3
"""[m]"""
ACCELERATION_SCALE = 2.0
"""[m/s^2, rad/s^2]"""
SPEED_SCALE = 0.05
"""[m/s, rad/s]"""
FRICTION_SCALE = 1e-2
"""Share of the weight."""
ROOMS = (0.01, 0.01, 0.05, 0.05, 0.012, 0.005, 0.05, 0.08, 0.02, 0.006, 30.0, 1.0, 0.3)
"""What of the plan's margins may be used up, in the order and the units of the scales above: most bounds of the plan
stand before those of the controller and the robot. Whether the robot balances is judged from the whole curve."""
SOFTNESS_MAX = 3.0
"""Of the bounds on configurations: past a joint limit a leg can be straight, and nothing is linear any more."""


def scales(c: TrajectoryConfig) -> Scales:
    """Weights of what is wanted."""
    return Scales(
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


def sided(n_edges: int, softness: float) -> np.ndarray:
    """Weights of the bounds of a knot, (n_sided,); their scales are multiplied by ``softness``."""
    firm = min(softness, SOFTNESS_MAX)
    scales = _columns(
        n_edges, TILT_SCALE * firm, LOWEST_SCALE * firm, LIMIT_SCALE * firm, HOLD_SCALE * firm, DISTANCE_SCALE * firm,
        COM_SCALE * firm, LOAD_SCALE * softness, TORQUE_SCALE * softness, ZMP_SCALE * softness,
        CAPTURE_SCALE * softness, ACCELERATION_SCALE * softness, SPEED_SCALE * firm, FRICTION_SCALE * softness,
    )  # fmt: skip
    return scales**-2


def rooms(n_edges: int) -> np.ndarray:
    """By how much the bounds of a knot may be exceeded before a plan cannot be followed any more, (n_sided,)."""
    return _columns(n_edges, *ROOMS)


def _columns(n_edges: int, *values: float) -> np.ndarray:
    """One value for each kind of bound, in the order of the constants above, for each bound of a knot (n_sided,)."""
    ends = np.array([
        LOWEST, LIMIT, HOLD, NEAR, EDGE, LOAD + n_edges, TORQUE + n_edges, ZMP + n_edges, ZMP + 2 * n_edges,
        ZMP + 3 * n_edges, ZMP + 3 * n_edges + N_JOINTS, ZMP + 3 * n_edges + 2 * N_JOINTS, n_sided(n_edges),
    ])  # fmt: skip
    return np.repeat(values, np.diff(ends, prepend=TILT))
