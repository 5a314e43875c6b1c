"""What each row of the plan's program costs; a bound's weight is one over its scale squared."""

from __future__ import annotations

import numpy as np

from wholebody.config import PosturePlanConfig
from wholebody.posture import knots as at

TILT = 2e-3
"""Excess of a tilt that costs as much as 1 [rad]; likewise below."""
LOWEST = 1e-3
"""[m]"""
JOINT_LIMIT = 3e-3
"""[rad]"""
DISTANCE = 0.8e-3
"""[m]"""
COM_EDGE = 1e-3
"""[m]"""
LOAD = 1e-2
"""Share of the weight."""
TORQUE = 2e-2
"""Share of the torque limit."""
ZMP_EDGE = 1e-3
"""[m]"""
ACCELERATION = 2.0
"""[m/s^2, rad/s^2]"""
SPEED = 0.05
"""[m/s, rad/s]"""


def hands(r: np.ndarray, config: PosturePlanConfig) -> list[tuple[slice, float, np.ndarray, float]]:
    """For each hand's position and orientation: rows, scale, error (K,) over where it begins to give, that."""
    out = []
    for i in (0, 1):
        for start, sigma, give in (
            (6 * i, config.position, config.position_give),
            (6 * i + 3, config.orientation, config.orientation_give),
        ):
            rows = slice(start, start + 3)
            out.append((rows, sigma, np.linalg.norm(r[:, rows], axis=1) / give, give))
    return out


def position(r: np.ndarray, config: PosturePlanConfig) -> np.ndarray:
    """Weights of the rows of `Knots.position`, r and answer (K, N_POSITION).

    Far from its target a hand pulls with a force that grows no more.
    """
    c, w = config, np.zeros_like(r)
    for rows, sigma, far, _ in hands(r, c):
        w[:, rows] = (1.0 / (sigma**2 * (1.0 + far)))[:, None]
    w[:, at.COM], w[:, at.TORSO], w[:, at.PELVIS] = c.com**-2, c.torso**-2, c.pelvis**-2
    w[:, at.HEIGHT], w[:, at.JOINTS] = c.height**-2, c.posture**-2
    return w


def give(r: np.ndarray, config: PosturePlanConfig) -> float:
    """What the hands' true cost has more than their weighted squares."""
    total = 0.0
    for _, sigma, far, unit in hands(r, config):
        total += np.sum((unit / sigma) ** 2 * (2.0 * (far - np.log1p(far)) - far**2 / (1.0 + far)))
    return float(total)


def motion(config: PosturePlanConfig) -> np.ndarray:
    """Weights of the quadratic rows of `Knots.motion`, (N_MOTION,)."""
    w = np.zeros(at.N_MOTION)
    w[at.MOMENT], w[at.WAIST], w[at.SLIDE] = config.zmp**-2, config.waist_torque**-2, config.slide**-2
    return w


def speed(config: PosturePlanConfig) -> np.ndarray:
    """Weights of the velocities, (N_BODY,)."""
    w = np.full(at.N_BODY, config.stillness**-2)
    w[at.LEGS] = config.leg_stillness**-2
    return w


def sided(n: int) -> np.ndarray:
    """Weights of the rows of `Knots.bounds`, (n,)."""
    w = np.zeros(n)
    w[at.TILTS], w[at.LOWEST], w[at.JOINT_LIMITS] = TILT**-2, LOWEST**-2, JOINT_LIMIT**-2
    w[at.DISTANCES], w[at.EDGES] = DISTANCE**-2, COM_EDGE**-2
    return w


def bound(n: int) -> np.ndarray:
    """Weights of the one-sided rows of `Knots.motion`, (n,)."""
    w = np.zeros(n)
    w[at.LOAD], w[at.ZMP_EDGES], w[at.TORQUES] = LOAD**-2, ZMP_EDGE**-2, TORQUE**-2
    return w
