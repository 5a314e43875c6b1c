"""The base that a walk follows: a place between the feet that moves as smoothly as what is told allows."""

from __future__ import annotations

from cmath import exp
from collections.abc import Sequence
from math import ceil, copysign, hypot, sqrt

from wholebody.walking.places import Place, Velocity, moved

ACCELERATION = (0.3, 0.8)
"""Largest acceleration of the base along its way [m/s^2] and about the vertical [rad/s^2]; chosen: from rest to 0.4 m/s
in two steps."""
FASTEST = (0.35, 0.2, 0.45)
"""Speeds along its axes and about the vertical on the way to a goal [m/s, m/s, rad/s]; chosen: a step of 0.25 m, and
aside what a person may tell a walk."""
BRAKE = 0.7
"""Share of the acceleration with which the base comes to rest at a goal [no unit]; chosen: the rest follows."""
THERE = (5e-4, 1e-3)
"""Distance [m] and angle [rad] from a goal at which the base is there; derived: a tenth of what plans count as moved
feet."""
AWAY = 0.05
"""Distance of a foot from where it was to be set down from which the base comes after it [m]; measured: pushed by 10 N
s ahead on the spot, the robot went all of its 0.33 m back in the next step, and fell."""
COMING = 4.0
"""Rate with which it does [1/s]; chosen: within two steps, and palms are led by 5 m/s^2 at most then."""
AHEAD = 0.05
"""Period in which the base is foreseen [s]; chosen: ramps are straight and arcs short over it."""


class Guide:
    """A place that moves by a velocity that is told, or to a goal, within `ACCELERATION`.

    Attributes:
        place: Where it is.
        velocity: In its own axes.
        change: Of that velocity, ahead + i to the left [m/s^2] and about the vertical [rad/s^2].
        wanted: Velocity that is told; None for a goal.
        goal: Place to go to, or None.
    """

    def __init__(self, place: Place) -> None:
        self.place, self.velocity, self.change = place, Velocity(), (0j, 0.0)
        self.wanted: Velocity | None = Velocity()
        self.goal: Place | None = None
        self._behind, self._pace, self._pull = 0j, 0j, 0j

    def follow(self, velocity: Velocity) -> None:
        """Move with a velocity from now on."""
        self.wanted, self.goal = velocity, None

    def go_to(self, goal: Place) -> None:
        """Move to a place, and stay there."""
        self.wanted, self.goal = None, goal

    def come_after(self, foot: complex) -> None:
        """Come after a foot that was set down so far from its place in world [m], steps at once beside where to."""
        self._behind += foot if abs(foot) > AWAY else 0j

    @property
    def rests(self) -> bool:
        """Whether it has come to rest, and to its goal."""
        still = self.velocity.is_rest
        return still and (self.wanted.is_rest if self.goal is None else self._missing() == (0j, 0.0))

    @property
    def told(self) -> tuple[Velocity | None, Place | None]:
        """What it is told now: a velocity, or a goal."""
        return self.wanted, self.goal

    def aim(self) -> Velocity:
        """Velocity that it takes up: what is told, or what leads it to its goal."""
        return self.wanted or self._towards()

    def motion(self) -> tuple[complex, complex]:
        """Velocity [m/s] and acceleration [m/s^2] of its point in world."""
        axes, way, turn = exp(1j * self.place.heading), self.velocity.way, self.velocity.turn
        return way * axes + self._pace, (self.change[0] + 1j * turn * way) * axes + self._pull

    def come(self, dt: float) -> None:
        """Come after feet for a period [s]."""
        if self._behind == 0j and self._pace == 0j:
            return
        self._pull = COMING * (COMING * self._behind - 2.0 * self._pace)
        self._pace += self._pull * dt
        step = self._pace * dt
        self.place, self._behind = Place(self.place.point + step, self.place.heading), self._behind - step
        if abs(self._behind) < THERE[0] and abs(self._pace) < THERE[0]:
            self._behind = self._pace = self._pull = 0j

    def advance(self, dt: float) -> None:
        """Move on by a period [s]; by none, nothing changes."""
        if dt <= 0.0:
            return
        wanted = self.aim()
        before = self.velocity
        way, turn = wanted.way - before.way, wanted.turn - before.turn
        most, most_turn = ACCELERATION[0] * dt, ACCELERATION[1] * dt
        way = way if abs(way) <= most else way * (most / abs(way))
        turn = max(min(turn, most_turn), -most_turn)
        self.change = way / dt, turn / dt
        self.velocity = Velocity(before.way + way, before.turn + turn)
        mean = Velocity(before.way + 0.5 * way, before.turn + 0.5 * turn)
        self.place = moved(self.place, mean, dt)
        if self.goal is not None and self._missing() == (0j, 0.0):
            self.place, self.velocity = self.goal, Velocity()

    def foresee(self, times: Sequence[float]) -> list[tuple[Place, bool]]:
        """Where it will be after times [s], which rise, and whether it will have come to rest."""
        copy, now, places = Guide(Place(self.place.point + self._behind, self.place.heading)), 0.0, []
        copy.velocity, copy.wanted, copy.goal = self.velocity, self.wanted, self.goal
        for time in times:
            steps = max(ceil((time - now) / AHEAD), 0)
            for _ in range(steps):
                copy.advance((time - now) / steps)
            now = max(now, time)
            places.append((copy.place, copy.rests))
        return places

    def _missing(self) -> tuple[complex, float]:
        """Way [m] and angle [rad] to the goal in its own axes; zeros where it is there."""
        way, turn = self.place.seen(self.goal.point), self.place.turn_to(self.goal)
        slow = abs(self.velocity.way) <= ACCELERATION[0] * AHEAD and abs(self.velocity.turn) <= ACCELERATION[1] * AHEAD
        there = slow and abs(way) < THERE[0] and abs(turn) < THERE[1]
        return (0j, 0.0) if there else (way, turn)

    def _towards(self) -> Velocity:
        """Velocity with which it would come to rest at its goal."""
        way, turn = self._missing()
        size, (ahead, aside, most) = abs(way), FASTEST
        fastest = size / hypot(way.real / ahead, way.imag / aside) if size > 0.0 else 0.0
        speed = min(sqrt(2.0 * BRAKE * ACCELERATION[0] * size), fastest, 8.0 * size)
        rate = min(sqrt(2.0 * BRAKE * ACCELERATION[1] * abs(turn)), most, 8.0 * abs(turn))
        return Velocity(way * (speed / size) if size > 0.0 else 0j, copysign(rate, turn))
