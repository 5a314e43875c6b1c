"""Keep hands and forearms off the floor."""

from __future__ import annotations

import numpy as np

from wholebody.collision.floor_clearance import FloorClearance
from wholebody.collision.proximity import point_rates
from wholebody.limits.base import Rows, braking_bound
from wholebody.robot.state import Robot


class FloorLimit:
    """The lowest points of the bodies below the elbows do not come closer to the floor than a distance.

    For a point at height z with rate ``J v``: ``-J dv <= braking_bound(z - distance, -J v) + drift``.

    Args:
        underside: The bodies.
        distance: To be kept from the floor [m].
        trigger: Height beyond that distance from which a body counts [m].
        brake: Deceleration of falling bodies that is always available [m/s^2].
        prescribed: Velocities whose acceleration is not the program's to choose, indices into ``v``: fingers go where
            their reference says, so the arms have to keep them up.
    """

    def __init__(
        self,
        underside: FloorClearance,
        *,
        distance: float,
        trigger: float,
        brake: float,
        prescribed: np.ndarray | None = None,
    ) -> None:
        self.underside, self.distance, self.trigger, self.brake = underside, distance, trigger, brake
        self.prescribed = np.zeros(0, dtype=int) if prescribed is None else prescribed

    def rows(self, robot: Robot) -> Rows:
        """One row for each body near the floor."""
        points = self.underside.lowest(robot.data)
        near = np.flatnonzero(points[:, 2] - self.distance < self.trigger)
        up = np.tile([0.0, 0.0, 1.0], (len(near), 1))
        J, drift = point_rates(robot.data, self.underside.supports[near], points[near], up, robot.v)
        room = points[near, 2] - self.distance
        upper = braking_bound(room, -(J @ robot.v), self.brake) + drift
        J[:, self.prescribed] = 0.0
        return Rows(-J, upper, tuple(self.underside.labels[k] for k in near))
