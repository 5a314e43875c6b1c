"""The plan of a chunk and what it says of itself."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from wholebody.planning.changes import MOVED_MIN, PlanChange
from wholebody.planning.trajectory import SampledTrajectory
from wholebody.reference import HandPath
from wholebody.robot.contact_schedule import ContactSchedule
from wholebody.trajopt.optimizer import KnotTrajectory
from wholebody.types import Reason


@dataclass(frozen=True)
class PlanReport:
    """What had to be changed for a chunk to be feasible; K knots of the body's trajectory.

    Attributes:
        steps: Path parameters of the knots, shape (K,), [s].
        tracking_error: Distance of each planned palm from where the chunk wants it, shape (K, 2), [m].
        slowdown: Factor by which the chunk takes longer, at least 1.
        zmp_margin: Distance of the planned zero-moment point from the edge of the support, shape (K,), [m].
        changes: What was changed, and where, by reason, most important first.
        strategy: Name of the strategy that the plan was found with, of `wholebody.planning.strategies`.
        violation: Largest excess over a bound of the trajectory, in terms of the tolerance of the bound.
        safe: Whether the trajectory keeps its bounds and its balance, between its knots too.
        work: Linearisations and steps that were computed for it, as `planning.budget` counts them.
        timed_out: Whether more would have been, with more time.
        implausible: Whether smoothing moved a hand so far that what the chunk means is a guess.
    """

    steps: np.ndarray
    tracking_error: np.ndarray
    slowdown: float
    zmp_margin: np.ndarray
    changes: Mapping[Reason, PlanChange] = field(default_factory=dict)
    strategy: str = ""
    violation: float = 0.0
    safe: bool = True
    work: float = 0.0
    timed_out: bool = False
    implausible: bool = False

    @property
    def reasons(self) -> tuple[Reason, ...]:
        """Why it is not followed as given, most important first."""
        return tuple(self.changes)

    @property
    def hindered(self) -> bool:
        """Whether the way to a chunk that begins elsewhere is slow because of what the robot was doing."""
        return Reason.FAR_START in self.changes and self.slowdown > 1.0

    def seen_at(self, s: float) -> Reason | None:
        """Why a person sees the chunk followed otherwise than given at the path parameter ``s`` [s], if it is."""
        k = self._knot(s)
        return next((reason for reason, change in self.changes.items() if change.seen[k]), None)

    def moved_at(self, s: float) -> Reason | None:
        """Why a hand is elsewhere than given there, however little a person would see of that."""
        k = self._knot(s)
        return next((reason for reason, change in self.changes.items() if change.moved[k] > MOVED_MIN), None)

    def moved_by(self, s: float) -> float:
        """How far a hand is elsewhere than given there, for whatever reason [m]."""
        k = self._knot(s)
        return max((float(change.moved[k]) for change in self.changes.values()), default=0.0)

    def _knot(self, s: float) -> int:
        """The knot nearest to a path parameter [s], the last where some are as near: the first may have one time."""
        return len(self.steps) - 1 - int(np.abs(self.steps[::-1] - s).argmin())

    def quicker(self, other: PlanReport) -> bool:
        """Whether this plan is balanced and quicker than another one."""
        return self.safe and self.slowdown < other.slowdown


@dataclass(frozen=True)
class ChunkPlan:
    """A chunk made feasible; parameters ``s`` are seconds since the chunk's observation, from ``start`` to ``end``.

    Attributes:
        paths: Of both hands.
        trajectory: Of the body, as it is followed.
        start, end: [s]
        report: What had to be changed.
        knots: What the trajectory was made of.
        contacts: Which feet it counts on, and where.
    """

    paths: tuple[HandPath, HandPath]
    trajectory: SampledTrajectory
    start: float
    end: float
    report: PlanReport
    knots: KnotTrajectory
    contacts: ContactSchedule

    @property
    def is_finite(self) -> bool:
        """Whether every number that is followed is finite; nothing else of a plan is trusted where one is not."""
        curves = [part for path in self.paths for part in (path.curve.breaks, path.curve.coefficients)]
        body = self.trajectory
        moved = [body.q, body.v, body.ddq, body.com, body.momentum, body.height, *body.pelvis, *body.torso]
        numbers = [self.start, self.end, self.report.slowdown, body.start]
        return all(np.isfinite(part).all() for part in (*curves, *moved, numbers))

    @property
    def rate(self) -> float:
        """Speed along the chunk, 1 being the chunk's own."""
        return 1.0 / self.report.slowdown

    def pushes_at(self, s: float) -> np.ndarray:
        """Forces on the left and the right palm that it counts on at a parameter [s], world axes, shape (6,), [N]."""
        if self.knots.pushes is None:
            return np.zeros(6)
        pushes, steps = self.knots.pushes, self.report.steps
        k = min(max((s - steps[0]) / (steps[1] - steps[0]), 0.0), len(pushes) - 1.0001)
        share, first = math.modf(k)
        return (1.0 - share) * pushes[int(first)] + share * pushes[int(first) + 1]

    def rest(self, s: float, rate: float, knot: float) -> np.ndarray:
        """Rest of the plan from a parameter on [s], followed at a rate: configurations (k, nq), ``knot`` apart [s]."""
        step = rate * knot
        at = s + step * np.arange(1.0, 1.0 + (self.end - s) / max(step, 1e-3))
        return self.trajectory.q[[self.trajectory.row(x) for x in at]]
