"""The inverted pendulum under the centre of mass: the constants of every bound on the capture point."""

from __future__ import annotations

import math

GRAVITY = 9.81
"""[m/s^2]; chosen: as in MuJoCo's and Pinocchio's models of the robot."""
LOWEST_HEIGHT = 0.2
"""Least height of the pendulum [m]; chosen: a robot that has fallen still has a finite frequency."""


def natural_frequency(height: float) -> float:
    """``omega = sqrt(g / height)`` [1/s] for a centre of mass at a height over the floor [m].

    Source:
        Pratt, Carff, Drakunov and Goswami 2006, "Capture Point: A Step toward Humanoid Push Recovery", Humanoids.
    """
    return math.sqrt(GRAVITY / max(height, LOWEST_HEIGHT))
