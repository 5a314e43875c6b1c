"""What each row of the plan's program costs; a bound's weight is one over its scale squared."""

from __future__ import annotations

import numpy as np

from wholebody.config import PosturePlanConfig
from wholebody.posture.tables import (
    EDGE,
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
)  # fmt: skip

TILT_SCALE = 2e-3
"""Excess of a tilt that costs as much as 1 [rad]; likewise below."""
LOWEST_SCALE = 1e-3
"""[m]"""
LIMIT_SCALE = 3e-3
"""[rad]"""
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
SOFTNESS_MAX = 3.0
"""Of the bounds on configurations: past a joint limit a leg can be straight, and nothing is linear any more."""


def scales(c: PosturePlanConfig) -> Scales:
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
    w = np.empty(n_sided(n_edges))
    firm = min(softness, SOFTNESS_MAX)
    load, torque, zmp = LOAD + n_edges, TORQUE + n_edges, ZMP + n_edges
    capture, rate = ZMP + 2 * n_edges, ZMP + 3 * n_edges
    w[TILT:LOWEST], w[LOWEST:LIMIT], w[LIMIT:NEAR] = TILT_SCALE * firm, LOWEST_SCALE * firm, LIMIT_SCALE * firm
    w[NEAR:EDGE], w[EDGE:load] = DISTANCE_SCALE * firm, COM_SCALE * firm
    w[load:torque], w[torque:zmp], w[zmp:capture] = LOAD_SCALE * softness, TORQUE_SCALE * softness, ZMP_SCALE * softness
    w[capture:rate] = CAPTURE_SCALE * softness
    w[rate : rate + N_JOINTS], w[rate + N_JOINTS :] = ACCELERATION_SCALE * softness, SPEED_SCALE * firm
    return w**-2
