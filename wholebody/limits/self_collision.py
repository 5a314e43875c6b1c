"""Keep the bodies of the robot apart."""

from __future__ import annotations

from wholebody.limits.base import Rows, barrier
from wholebody.proximity import Proximity
from wholebody.robot import Robot


class SelfCollisionLimit:
    """The nearest pairs of bodies do not come closer than their margin.

    Args:
        proximity: Distances of the watched pairs.
        trigger: Distance beyond the margin from which a pair counts [m].
        brake: Deceleration of approaching bodies that is always available [m/s^2].
        dt: Time constant of the bound [s].
        most: Largest number of pairs, nearest first.
    """

    def __init__(self, proximity: Proximity, *, trigger: float, brake: float, dt: float = 0.02, most: int = 24) -> None:
        self.proximity, self.trigger, self.brake, self.dt, self.most = proximity, trigger, brake, dt, most

    def rows(self, robot: Robot) -> Rows:
        """One row per near pair."""
        self.proximity.update(robot.data, self.trigger)
        near = self.proximity.near(self.trigger, self.most)
        J, drift = self.proximity.rates(robot.data, near)
        speed = J @ robot.v
        room = self.proximity.distance[near] - self.proximity.margin[near]
        upper = barrier(room, -speed, brake=self.brake, dt=self.dt) + drift
        return Rows(-J, upper, tuple(self.proximity.labels[k] for k in near))
