"""Settings of hands that touch something."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class TouchConfig:
    """How hard a hand that touches may push, and how softly it does.

    The defaults are chosen: they hold in every row of ``python -m tests.studies.touch``.
    """

    force_found: float = 9.0
    """Force on a palm that no known mass accounts for, from which the hand counts as touching [N]."""
    force_max: float = 60.0
    """Largest force with which a hand pushes, whatever balance allows [N]."""
    tipping_share: float = 0.65
    """Share of the force that would tip the robot, at that place and in that direction, with which a hand pushes."""
    stiffness: float = 600.0
    """Of a hand that touches [N/m]."""
    mass: float = 2.0
    """That a hand that touches seems to have [kg]: about that of an arm."""
