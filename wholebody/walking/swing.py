r"""The foot that is up: a curve to where and when it is to land, taken up anew from where it is at every tick.

Each coordinate follows the quintic from its position, speed and acceleration to those wanted, so place and time of the
landing may change at any moment without a jump. Upwards the foot goes to the lift, and from there down to the floor,
where it arrives with a speed: one that arrives at rest would touch 60 to 100 ms before its time, since the last part
of its way is below a millimetre.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import tau

from wholebody.walking.places import Place

LIFTED = 0.45
"""Share of the swing after which the foot is at its highest [no unit]; chosen: the way down is the longer one."""
EARLY = 0.04
"""Time before the landing at which the foot has stopped moving over the floor [s]; chosen: two hundredths of the way
are left then, and a sole that touches early does not scrape."""
FROZEN = 0.06
"""Time before the landing from which place and time stay as they are [s]; chosen: a later change could not be
followed."""
LANDING_SPEED = 0.1
"""Speed with which the sole meets the floor [m/s]; measured: with 0.1 it is there within 5 ms of its time."""
DOWN, FASTEST_DOWN = 10.0, 0.4
"""Acceleration and speed with which a sole goes on down that met nothing when it was to [m/s^2, m/s]; chosen: 2 cm in
0.07 s."""


@dataclass(frozen=True, slots=True)
class Course:
    """A coordinate that moves: position, speed and acceleration, real or complex [m or rad; per s; per s^2]."""

    x: complex
    v: complex = 0.0
    a: complex = 0.0

    def towards(self, goal: Course, left: float, dt: float) -> Course:
        """Course a period ``dt`` later on the quintic to a goal ``left`` away [s]; the goal where that is over."""
        if left <= dt:
            return goal
        s, x, v, a = dt / left, self.x, self.v * left, self.a * left * left
        d_0, d_1, d_2 = goal.x - x - v - 0.5 * a, goal.v * left - v - a, goal.a * left * left - a
        c_3, c_4, c_5 = 10 * d_0 - 4 * d_1 + 0.5 * d_2, -15 * d_0 + 7 * d_1 - d_2, 6 * d_0 - 3 * d_1 + 0.5 * d_2
        place = x + s * (v + s * (0.5 * a + s * (c_3 + s * (c_4 + s * c_5))))
        speed = v + s * (a + s * (3 * c_3 + s * (4 * c_4 + s * 5 * c_5)))
        change = a + s * (6 * c_3 + s * (12 * c_4 + s * 20 * c_5))
        return Course(place, speed / left, change / (left * left))


@dataclass(frozen=True, slots=True)
class Swing:
    """The sole of a foot that is up.

    Attributes:
        way: Over the floor, ``x + iy`` in world [m].
        height: Of the sole in world [m].
        heading: [rad]
        lean: By how much the sole rises along world's axes, ``x + iy`` [m/m].
    """

    way: Course
    height: Course
    heading: Course
    lean: Course = Course(0j)

    @classmethod
    def from_rest(cls, sole: Place, height: float, lean: complex = 0j) -> Swing:
        """Swing that begins with the sole at rest."""
        return cls(Course(sole.point), Course(height), Course(sole.heading), Course(lean))

    @property
    def place(self) -> Place:
        """Where the sole is."""
        return Place(self.way.x, self.heading.x)

    def advance(
        self, goal: Place, floor: float, lift: float, done: float, left: float, dt: float, slope: complex = 0j
    ) -> Swing:
        """Swing a period ``dt`` later.

        Args:
            goal: Where it is to land.
            floor: Height at which it is to [m].
            lift: How high over that it goes [m].
            done: Share of the swing that is over, 0 to 1.
            left: Time until it is to land [s]; past it, it goes on down.
            dt: [s]
            slope: Of the floor, ``x + iy`` [m/m]: the sole has it from its highest on.
        """
        if left <= dt:
            height = Course(self.height.x + self.height.v * dt, max(self.height.v - DOWN * dt, -FASTEST_DOWN))
            return replace(self, way=Course(self.way.x), heading=Course(self.heading.x), height=height)
        over, lean = max(left - EARLY, 0.0), Course(slope)
        way, heading = self.way, self.heading
        if over > 0.5 * EARLY or way.v != 0.0:
            turn = goal.heading - heading.x
            turn -= tau * round(turn / tau)  # measured headings jump by a whole turn, feet do not
            way = way.towards(Course(goal.point), over, dt)
            heading = heading.towards(Course(heading.x + turn), over, dt)
        if done < LIFTED:
            total = left / (1.0 - done)
            height = self.height.towards(Course(floor + lift), (LIFTED - done) * total, dt)
            lean = self.lean.towards(lean, (LIFTED - done) * total, dt)
        else:
            height = self.height.towards(Course(floor, -LANDING_SPEED), left, dt)
        return Swing(way, height, heading, lean)
