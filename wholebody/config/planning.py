"""When plans are asked for; part of `wholebody.config.ControllerConfig`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated


@dataclass(frozen=True, kw_only=True)
class PlanningConfig:
    """Settings of when a plan is asked for, and of how long it takes in simulation, where time goes on meanwhile."""

    lead: Annotated[float, "s"] = 0.1
    """Time from asking for a plan to the instant at which it takes over; 0: at once, the robot waits."""
    lead_max: Annotated[float, "s"] = 0.8
    """Longest lead; a plan that comes too late is asked for again with twice the lead."""
    latency: str = "fixed"
    """Latency of a simulated planner: 'fixed' takes `lead` times `factor`, 'measured' the CPU time used times
    `factor`."""
    factor: float = 1.0
    """How many times longer than that it takes."""
    budget: float = 160.0
    """Most linearisations and steps for the plan of a chunk, each of 40 knots; of more or fewer knots in proportion."""
