"""What a walk is told of the robot, tick by tick."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from wholebody.walking.places import Place

LEVEL, STEEPEST = 0.01, 0.08
"""Slopes below which a floor counts as level, and above which none is stepped on [m/m]; chosen: soles that press into
a level floor tilt by less; 4.6 degrees are more than was tried."""


@dataclass(frozen=True, slots=True)
class WalkReadings:
    """What a walk is told of the robot.

    Attributes:
        dcm: Capture point in world [m].
        omega: Of its pendulum [1/s].
        soles: Both soles as measured, left first; heights: of their middles [m].
        touching: Whether the floor presses on each; None if that is not known.
        slope: By how much the floor rises along world's axes, ``x + iy`` [m/m].
        tilts: By how much each sole does, likewise.
        leans: Whether its torso leans so far that feet which a step has left apart are not closed.
    """

    dcm: complex
    omega: float
    soles: tuple[Place, Place]
    heights: tuple[float, float]
    touching: tuple[bool, bool] | None = None
    slope: complex = 0j
    tilts: tuple[complex, complex] = (0j, 0j)
    leans: bool = False


def rise(slope: complex, way: complex) -> float:
    """How much a floor of a slope ``x + iy`` [m/m] rises along a way over it [m]."""
    return slope.real * way.real + slope.imag * way.imag


def floor_under(tilts: Sequence[complex]) -> complex:
    """Slope of the floor under both soles, ``x + iy`` [m/m]: what both have of it, for one may be on an edge.

    Args:
        tilts: By how much each sole rises along world's axes, likewise.
    """
    along = [
        min(a, b, key=abs) if a * b > 0.0 else 0.0 for a, b in zip(*((t.real, t.imag) for t in tilts), strict=True)
    ]
    slope = complex(*along)
    return 0j if abs(slope) < LEVEL else slope * min(STEEPEST / abs(slope), 1.0)
