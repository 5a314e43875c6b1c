"""A limit bounds accelerations: one-sided rows ``J dv <= upper``, each with a name."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from wholebody.robot.state import Robot


@dataclass(frozen=True)
class Rows:
    """Inequalities on the generalised acceleration.

    Attributes:
        J: Shape (k, nv).
        upper: ``J dv <= upper``, shape (k,); a two-sided limit gives two rows.
        labels: One name a row.
    """

    J: np.ndarray
    upper: np.ndarray
    labels: tuple[str, ...]


TIME_CONSTANT = 0.02
"""Time constant of the approach to a bound [s]; chosen: ten ticks of 2 ms."""


class ProgramLimit(Protocol):
    """Anything that bounds the acceleration at the robot's present state."""

    def rows(self, robot: Robot) -> Rows:
        """Rows at the robot's present state."""
        ...


def braking_bound(margin: np.ndarray, rate: np.ndarray, brake: np.ndarray | float) -> np.ndarray:
    r"""Largest acceleration towards a bound from which one can still stop before it.

    The speed towards the bound may be at most ``sqrt(2 brake margin)``, which is approached with `TIME_CONSTANT`; past
    the bound it must turn back. Far from the bound it does not bind. A motion that has kept to it from afar brakes with
    about ``brake``, and ``2.1 brake`` for a moment at the end, where the square root becomes a line.

    Args:
        margin: Distance to the bound, negative past it, shape (k,).
        rate: Speed towards the bound, shape (k,).
        brake: Deceleration that is always available, positive.

    Returns:
        Upper bound on the acceleration towards the bound, shape (k,): excess of the allowed over the present speed, per
        time constant. It has no floor: a motion that is already much too fast is asked for more than ``brake``.
    """
    inside = np.maximum(margin, 0.0)
    # A plain square root has infinite slope at zero: nearer than a time constant's way it continues as a line.
    linear = 2.0 * brake * TIME_CONSTANT**2
    allowed = np.where(inside > linear, np.sqrt(2.0 * brake * inside), inside / TIME_CONSTANT)
    allowed = np.where(margin < 0.0, margin / (4.0 * TIME_CONSTANT), allowed)
    return (allowed - rate) / TIME_CONSTANT
