"""What a walk is told of the robot, tick by tick."""

from __future__ import annotations

from dataclasses import dataclass

from wholebody.walking.places import Place


@dataclass(frozen=True, slots=True)
class WalkReadings:
    """What a walk is told of the robot.

    Attributes:
        dcm: Capture point in world [m].
        omega: Of its pendulum [1/s].
        soles: Both soles as measured, left first; heights: of their middles [m].
        touching: Whether each carries weight; None if that is not known.
    """

    dcm: complex
    omega: float
    soles: tuple[Place, Place]
    heights: tuple[float, float]
    touching: tuple[bool, bool] | None = None
