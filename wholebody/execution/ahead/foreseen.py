"""What will be followed a little later."""

from __future__ import annotations

from dataclasses import dataclass

from wholebody.planning.trajectory import BodyState
from wholebody.reference import HandMotion


@dataclass(frozen=True)
class Foreseen:
    """What will be followed at a time to come, if the robot tracks until then as it does now.

    Attributes:
        s: Parameter of the plan [s].
        rate: Its derivative; 0 while there is no plan.
        body: What the trajectory asks for.
        hands: What both hands will be commanded to do, rows (2, 40).
    """

    s: float
    rate: float
    body: BodyState
    hands: HandMotion
