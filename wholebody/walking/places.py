"""Places in the floor plane: soles, and the base between them.

Points of the plane are complex numbers ``x + iy`` [m]: to turn one is to multiply it, and Python's arithmetic on them
takes a tenth of the time of an array's.
"""

from __future__ import annotations

from cmath import exp
from dataclasses import dataclass
from math import atan2, cos, sin

STRAIGHT = 1e-9
"""Turning speed below which a motion is straight [rad/s]; derived: its arc differs by less than rounding does."""


@dataclass(frozen=True, slots=True)
class Place:
    """A pose in the floor plane.

    Attributes:
        point: ``x + iy`` in world [m].
        heading: Angle of its x axis about the vertical [rad].
    """

    point: complex
    heading: float

    def to(self, point: complex, turn: float = 0.0) -> Place:
        """Place that is at a point [m] of this one's axes, turned by an angle [rad]."""
        return Place(self.world(point), self.heading + turn)

    def world(self, point: complex) -> complex:
        """Point of this one's axes in world [m]."""
        return self.point + point * exp(1j * self.heading)

    def seen(self, point: complex) -> complex:
        """Point of the world in this one's axes [m]."""
        return (point - self.point) * exp(-1j * self.heading)

    def turn_to(self, other: Place) -> float:
        """Angle from this one's heading to another's, -pi to pi [rad]."""
        angle = other.heading - self.heading
        return atan2(sin(angle), cos(angle))

    def between(self, other: Place, share: float = 0.5) -> Place:
        """Place on the straight way to another one, turned as far."""
        way, turn = share * (other.point - self.point), share * self.turn_to(other)
        return Place(self.point + way, self.heading + turn)


@dataclass(frozen=True, slots=True)
class Velocity:
    """Velocity in the floor plane, in the axes of what moves.

    Attributes:
        way: Speed ahead + i speed to the left [m/s].
        turn: Turning speed, positive to the left [rad/s].
    """

    way: complex = 0j
    turn: float = 0.0

    @property
    def is_rest(self) -> bool:
        """Whether nothing moves."""
        return self.way == 0.0 and self.turn == 0.0


def moved(place: Place, velocity: Velocity, time: float) -> Place:
    """Place after a time [s] at a constant velocity: on an arc."""
    angle = velocity.turn * time
    if abs(velocity.turn) < STRAIGHT:
        return place.to(velocity.way * time, angle)
    return place.to(velocity.way * (exp(1j * angle) - 1.0) / (1j * velocity.turn), angle)
