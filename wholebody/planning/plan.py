"""The plan of a chunk and what it says of itself."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from wholebody.planning.trajectory import SampledTrajectory
from wholebody.reference import HandPath
from wholebody.types import Reason


@dataclass(frozen=True)
class PlanReport:
    """What had to be changed for a chunk to be feasible; K knots of the body's trajectory.

    Attributes:
        steps: Path parameters of the knots, shape (K,), [s].
        tracking_error: Distance of each planned palm from where the chunk wants it, shape (K, 2), [m].
        clamped: How far each hand was moved at each knot, shape (K, 2), [m].
        slowdown: Factor by which the chunk takes longer, at least 1.
        zmp_margin: Distance of the planned zero-moment point from the edge of the support, shape (K,), [m].
        reasons: Why it is not followed as given, most important first.
        strategy: Name of the strategy that the plan was found with, of `wholebody.planning.strategies`.
        violation: Largest excess over a bound of the trajectory, in terms of the tolerance of the bound.
        safe: Whether the trajectory keeps its bounds and its balance, between its knots too.
        projected: How far the steps of a chunk that jumps were moved to be steps that a hand can do [m].
        lift: How far the hands were lifted out of the floor at each knot, shape (K,), [m].
        out_of_reach: Whether a hand was moved at a knot by more than is left to the whole-body program, shape (K,).
        smoothed: Names of the parts of the chunk that scattered and were smoothed.
        implausible: Whether smoothing moved them so far that what the chunk means is a guess.
    """

    steps: np.ndarray
    tracking_error: np.ndarray
    clamped: np.ndarray
    slowdown: float
    zmp_margin: np.ndarray
    reasons: tuple[Reason, ...] = ()
    strategy: str = ""
    violation: float = 0.0
    safe: bool = True
    projected: float = 0.0
    lift: np.ndarray = field(default_factory=lambda: np.zeros(1))
    out_of_reach: np.ndarray = field(default_factory=lambda: np.zeros(1, dtype=bool))
    smoothed: tuple[str, ...] = ()
    implausible: bool = False

    @property
    def hindered(self) -> bool:
        """Whether the way to a chunk that begins elsewhere is slow because of what the robot was doing."""
        return Reason.FAR_START in self.reasons and self.slowdown > 1.0

    def at(self, s: float) -> PlanReport:
        """What it says of one instant: targets that are moved elsewhere on the path are not moved there.

        Args:
            s: Path parameter [s].
        """
        moved = Reason.OUT_OF_REACH in self.reasons
        if not moved and not self.lift.any():
            return self
        step = self.steps[1] - self.steps[0] if len(self.steps) > 1 else 1.0
        k = min(max(round((s - self.steps[0]) / step), 0), len(self.steps) - 1)
        reasons = self.reasons
        if moved and not self.out_of_reach[k]:
            reasons = tuple(reason for reason in reasons if reason is not Reason.OUT_OF_REACH)
        return replace(self, reasons=reasons, lift=self.lift[k : k + 1], clamped=self.clamped[k : k + 1])

    def quicker(self, other: PlanReport) -> bool:
        """Whether this plan is balanced and quicker than another one."""
        return self.safe and self.slowdown < other.slowdown


@dataclass(frozen=True)
class ChunkPlan:
    """A chunk made feasible; parameters ``s`` are seconds since the chunk's observation, from ``start`` to ``end``."""

    paths: tuple[HandPath, HandPath]
    trajectory: SampledTrajectory
    start: float
    end: float
    report: PlanReport

    @property
    def rate(self) -> float:
        """Speed along the chunk, 1 being the chunk's own."""
        return 1.0 / self.report.slowdown
