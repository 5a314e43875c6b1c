"""Keep the bodies of the robot apart."""

from __future__ import annotations

import numpy as np

from wholebody.collision.proximity import Proximity
from wholebody.limits.base import Rows, braking_bound
from wholebody.robot.state import Robot


class SelfCollisionLimit:
    """The nearest pairs of bodies do not come closer than their margin.

    For a pair at distance d with rate ``J v``: ``-J dv <= braking_bound(d - margin, -J v) + drift``.

    Args:
        proximity: Distances of the watched pairs.
        trigger: Distance beyond the margin from which a pair counts [m].
        brake: Deceleration of approaching bodies that is always available [m/s^2].
        least: Number of nearest pairs that always have a row.
        most: Largest number of rows, nearest pairs first.
        prescribed: Velocities whose acceleration is not the program's to choose, indices into ``v``: fingers go where
            their reference says, so the arms have to make room.
    """

    def __init__(
        self,
        proximity: Proximity,
        *,
        trigger: float,
        brake: float,
        least: int = 10,
        most: int = 24,
        prescribed: np.ndarray | None = None,
    ) -> None:
        self.proximity, self.trigger, self.brake, self.least, self.most = proximity, trigger, brake, least, most
        self.prescribed = np.zeros(0, dtype=int) if prescribed is None else prescribed

    def rows(self, robot: Robot) -> Rows:
        """One row per near pair."""
        self.proximity.update(robot.q, robot.data, self.trigger, self.least)
        near = self.proximity.near(self.trigger, self.most, self.least)
        J, drift = self.proximity.rates(robot.data, near, robot.v)
        room = self.proximity.distance[near] - self.proximity.margin[near]
        upper = braking_bound(room, -(J @ robot.v), self.brake) + drift
        J[:, self.prescribed] = 0.0
        return Rows(-J, upper, tuple(self.proximity.labels[k] for k in near))
