"""What the hands carry; part of `wholebody.config.ControllerConfig`."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class LoadConfig:
    """Masses in the hands that the program and the plans count on."""

    source: str = "observed"
    """'observed': from the torques of the arms, if states have them; 'told': `left` and `right`, whatever is seen."""
    left: float = 0.0
    """Mass in the left hand until another one is observed [kg]."""
    right: float = 0.0
    """Mass in the right hand [kg]."""
    reserve: float = 0.25
    """Mass that plans leave room for in each hand, as long as its load is not known [kg]."""
    follow: float = 0.03
    """Difference between what is observed and what the program counts on from which it counts on that [kg]."""
    replan: float = 0.15
    """Change of a mass from which the plan that is followed is made anew [kg]; what became lighter by less than
    twice as much has to last for 0.5 s."""
