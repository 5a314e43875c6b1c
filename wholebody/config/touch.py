"""Settings of hands that touch something."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated


@dataclass(frozen=True, kw_only=True)
class TouchConfig:
    """How hard a hand that touches may push, and how softly it does.

    The defaults are chosen: they hold in every row of ``python -m tests.studies.touch``.
    """

    force_found: Annotated[float, "N"] = 9.0
    """Force on a palm that no known mass accounts for, from which the hand counts as touching."""
    force_max: Annotated[float | tuple[float, float, float], "N"] = 60.0
    """Largest force with which a hand pushes, whatever balance allows; or three: ahead, aside and up in the stance."""
    tipping_share: float = 0.65
    """Share of the force that would tip the robot, at that place and in that direction, with which a hand pushes."""
    stiffness: Annotated[float | tuple[float, float, float], "N/m"] = 600.0
    """Of a hand that touches; or three, along the same axes."""
    mass: Annotated[float, "kg"] = 2.0
    """That a hand that touches seems to have: about that of an arm."""
