"""One attempt at a chunk: the whole-body trajectory at one speed with one set of weights, and how it is judged."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from wholebody.config import PlannerConfig
from wholebody.planning.trajectory import CentroidalTrack, SampledTrajectory, track_along
from wholebody.reference import HandPath
from wholebody.reference.cubic import CubicBSpline
from wholebody.trajopt.layout import LOWER, WAIST
from wholebody.trajopt.optimizer import KnotTrajectory

Followed = tuple[CubicBSpline, CentroidalTrack, float]
"""The curve of a motion, where the mass goes along it, and the torques that it asks for, as a share of the motors'."""


class Modes(NamedTuple):
    """Ways of one plan: hands led to where what they carry can be held, torques between knots bounded at once."""

    holding: bool
    strained: bool


@dataclass(frozen=True)
class Targets:
    """What a chunk asks of the hands at one speed; K knots.

    Attributes:
        slowdown: Factor by which the chunk takes longer.
        paths: Of the hands, as the chunk has them within the limits of a hand.
        projected: How far each of the chunk's H steps was moved for that, shape (H,), [m].
        steps: Path parameters of the knots, shape (K,), [s].
        T_palms: Palm poses wanted, shape (K, 2, 4, 4).
        q_fingers: Fingers of the left, then of the right hand, shape (K, n_fingers), [rad].
        asked: Number of knots within the chunk; at the others hands come to rest.
        pushes: Forces that the chunk tells the left and the right palm, world axes, shape (K, 6), [N].
    """

    slowdown: float
    paths: tuple[HandPath, HandPath]
    projected: np.ndarray
    steps: np.ndarray
    T_palms: np.ndarray
    q_fingers: np.ndarray
    asked: int
    pushes: np.ndarray

    def off(self, T_palms: np.ndarray) -> np.ndarray:
        """Distances of palm poses (K, 2, 4, 4) from those wanted, shape (K, 2), [m]."""
        return np.linalg.norm(T_palms[:, :, :3, 3] - self.T_palms[:, :, :3, 3], axis=2)

    def near(self, T_palms: np.ndarray, distance: float) -> int:
        """Number of palm poses (k, 2, 4, 4), from the second knot on, that are so near to those wanted [m]."""
        n = min(len(T_palms), len(self.T_palms) - 2)
        off = np.linalg.norm((T_palms[:n] - self.T_palms[1 : n + 1])[:, :, :3, 3], axis=2).max(axis=1, initial=0.0)
        far = np.flatnonzero(off > distance)
        return int(far[0]) if len(far) else n


@dataclass(frozen=True)
class Attempt:
    """The plan of a chunk by one strategy; K knots.

    Attributes:
        strategy: Its name.
        targets: What it is to follow.
        knots: What the optimiser found.
        distance: Of each palm from where it should be, shape (K, 2), [m].
        curve: The same as it is followed.
        centroidal: Where the mass and the trunk go along it.
        drift: `ContactFeasibility.capture_point_drift` of it [m].
        deficit: `ContactFeasibility.friction_impulse_deficit` of it [m/s].
        warm_started: Whether the search began with a part of the plan before.
        strain: Largest torque of waist and arms on the whole curve, as a share of what motors give (`Effort.strain`).
        arms_spent: Largest torque of the arms where it comes to rest, as a share of its bound; 0 if nothing is carried.
    """

    strategy: str
    targets: Targets
    knots: KnotTrajectory
    distance: np.ndarray
    curve: CubicBSpline
    centroidal: CentroidalTrack
    drift: float
    deficit: float
    warm_started: bool
    strain: float = 0.0
    arms_spent: float = 0.0

    @cached_property
    def trajectory(self) -> SampledTrajectory:
        """The whole of it, sampled for the control loop; most attempts are judged without."""
        return track_along(self.curve, self.centroidal)

    @property
    def tracking_error(self) -> float:
        """Largest distance of a palm from where it should be [m]."""
        return float(self.distance.max())

    @property
    def start_error(self) -> float:
        """Palm error at the first knot, where the plan begins, whatever the targets [m]."""
        return float(self.distance[0].max())

    @property
    def mean_error(self) -> float:
        """Mean distance of the palms from where the chunk wants them at its own times [m]."""
        steps, wanted = self.targets.steps, self.targets.T_palms[:, :, :3, 3]
        own_time = steps[0] + (steps - steps[0]) / self.targets.slowdown
        reached = self.knots.T_palms[:, :, :3, 3].reshape(len(steps), -1).T
        late = np.stack([np.interp(own_time, steps, x) for x in reached], axis=1).reshape(-1, 2, 3)
        return float(np.mean(np.linalg.norm(late - wanted, axis=2)))

    @property
    def violation(self) -> float:
        """Largest excess over a bound, in terms of its tolerance; of torques between knots, what no motor gives."""
        return max(float(self.knots.violation.max()), self.strain if self.strain > 1.0 else 0.0)

    @property
    def start_violation(self) -> float:
        """Largest excess at the first knot, whose accelerations take the start to the second one."""
        return float(self.knots.violation[0])

    @property
    def waist_rate(self) -> float:
        """Fastest joint of the waist [rad/s]."""
        return float(np.abs(self.knots.v[:, LOWER : LOWER + WAIST]).max())

    def imbalance(self, config: PlannerConfig) -> float:
        """What the plan wants of the floor beyond what that gives; 1 is all that the controller makes up for."""
        unreachable = self.tracking_error > config.unreachable
        limit = config.friction_deficit_unreachable if unreachable else config.friction_deficit_max
        return max(self.drift / config.capture_point_drift_max, self.deficit / limit)

    def is_safe(self, config: PlannerConfig) -> bool:
        """Whether it keeps its bounds and its balance."""
        return self.violation <= config.violation_max and self.imbalance(config) <= 1.0

    def unsafety(self, config: PlannerConfig) -> int:
        """0 if it is safe, 1 if it keeps its bounds at least, 2 if it does not."""
        return 0 if self.is_safe(config) else 1 + (self.violation > config.violation_max)

    def follows(self, config: PlannerConfig) -> bool:
        """Whether it is safe and near enough to the chunk."""
        near = self.tracking_error <= config.tracking_error_max or self.mean_error <= config.mean_error_max
        return near and self.is_safe(config)
