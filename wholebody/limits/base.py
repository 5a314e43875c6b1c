"""A limit bounds accelerations: rows ``lower <= J dv <= upper``, each with a name."""

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
        upper: ``J dv <= upper``, shape (k,). One-sided by convention: a two-sided limit gives two rows.
        labels: One name a row.
    """

    J: np.ndarray
    upper: np.ndarray
    labels: tuple[str, ...]


class Limit(Protocol):
    """Anything that bounds the acceleration at the robot's present state."""

    def rows(self, robot: Robot) -> Rows:
        """Rows at the robot's present state."""
        ...


def barrier(margin: np.ndarray, rate: np.ndarray, *, brake: np.ndarray | float, dt: float) -> np.ndarray:
    r"""Largest acceleration towards a bound from which one can still stop before it.

    The speed towards the bound may be at most ``sqrt(2 brake margin)``, reached within a few control periods; past the
    bound it must turn back. Far from the bound it does not bind.

    Args:
        margin: Distance to the bound, negative past it, shape (k,).
        rate: Speed towards the bound, shape (k,).
        brake: Deceleration that is always available, positive.
        dt: Time within which the allowed speed is to be reached [s].

    Returns:
        Upper bound on the acceleration towards the bound, shape (k,), never below ``-2 brake`` inside the bound.
    """
    inside = np.maximum(margin, 0.0)
    # A plain square root has infinite slope at zero: below the distance covered in dt it continues as a line.
    linear = 2.0 * brake * dt**2
    allowed = np.where(inside > linear, np.sqrt(2.0 * brake * inside), inside / dt)
    allowed = np.where(margin < 0.0, margin / (4.0 * dt), allowed)
    return (allowed - rate) / dt
