"""Bounds that a verdict is given by; part of `wholebody.config.ControllerConfig`."""

from __future__ import annotations

from dataclasses import dataclass
from math import radians
from typing import Annotated

from wholebody.errors import ConfigError


@dataclass(frozen=True, kw_only=True)
class VerdictConfig:
    """How far palms may be from the chunk as given, each step at its own time, after the approach."""

    palm_feasible: Annotated[float, "m"] = 0.02
    """Distance up to which a step counts as done as given."""
    palm_repair: Annotated[float, "m"] = 0.05
    """Distance up to which it counts as repaired; further away it is another motion."""
    turn_feasible: Annotated[float, "rad"] = radians(10.0)
    """Angle up to which a palm counts as turned as given; nothing is asked of an orientation that is free."""
    turn_repair: Annotated[float, "rad"] = radians(25.0)
    """Angle up to which it counts as repaired."""

    def __post_init__(self) -> None:
        for kind, unit in (("palm", "m"), ("turn", "rad")):
            feasible, repair = getattr(self, f"{kind}_feasible"), getattr(self, f"{kind}_repair")
            if not feasible <= repair:
                raise ConfigError(
                    f"verdict.{kind}_feasible is {feasible:g} {unit}; it must be at most verdict.{kind}_repair, "
                    f"{repair:g} {unit}",
                    setting=f"verdict.{kind}_feasible",
                )
