"""What the hands carry; part of `wholebody.config.ControllerConfig`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated


@dataclass(frozen=True, kw_only=True)
class LoadConfig:
    """Masses in the hands that the program and the plans count on."""

    source: str = "observed"
    """'observed': from the torques of the arms, if states have them; 'told': `left` and `right`, whatever is seen."""
    left: Annotated[float, "kg"] = 0.0
    """Mass in the left hand until another one is observed."""
    right: Annotated[float, "kg"] = 0.0
    """Mass in the right hand."""
    reserve: Annotated[float, "kg"] = 0.25
    """Mass that plans leave room for in each hand, as long as its load is not known."""
    follow: Annotated[float, "kg"] = 0.03
    """Difference between what is observed and what the program counts on from which it counts on that."""
    replan: Annotated[float, "kg"] = 0.15
    """Change of a mass from which the plan that is followed is made anew; what became lighter by less than
    twice as much has to last for 0.5 s."""
