r"""When and where a foot that is up may land, and how far its reaction throws the capture point until then.

A foot goes to its place on a quintic. While it is accelerated by ``a`` it takes ``REACTION a`` of the acceleration of
the centre of mass that the trunk does not make up for, which moves the capture point by

    (REACTION / omega) int_0^t exp(omega (t - s)) a(s) ds

The quintic is linear in its end and in the place, speed and acceleration from which it begins, and the integral of each
of its parts has a closed form: those of ``exp(z (1 - s)) s^n`` over 0..1 are ``m_0 = (e^z - 1) / z``,
``m_n = (n m_(n-1) - 1) / z``.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from math import exp

from wholebody.walking.adjustment import Landing
from wholebody.walking.swing import EARLY, Course

TIMES = 24
"""Steps between the soonest and the latest time of a landing that are tried [no unit]; chosen: 18 ms each in a walk."""
ACCELERATION, PEAK = 20.0, 5.77
"""Largest acceleration of a foot that is up, over the floor [m/s^2], above which its landing is not moved, and by which
a quintic from rest to rest exceeds way over time squared; measured: with 30, and a reach by the time that the step had
before, 5 of 24 realistic robots fell of the step that was to catch them, and 0 of 30 with this; definition."""
REACTION = 0.1
"""Acceleration of the centre of mass for that of a foot that the trunk does not make up for [no unit]; measured: a leg
is a fifth of the robot, and 30 m/s^2 of a foot were 3 m/s^2 of the centre of mass."""
LEAST = 0.01
"""Least time in which a foot comes to its place [s]; chosen, to divide by."""


def landings(
    way: Course, corners: tuple[complex, complex], times: Iterable[float], omega: float, reaction: float, most: float
) -> Iterator[Landing]:
    """Landings of a foot that is up, one for each time.

    Args:
        way: Of the foot over the floor, in the axes of the stance sole.
        corners: Of where legs can set it down there [m].
        times: Until it carries [s].
        omega: Of the pendulum [1/s].
        reaction: As `REACTION`; 0 for a foot whose trunk makes up for it.
        most: Time [s] beyond which a later landing reaches no further. Measured: where it did, a walk that its arms
            disturbed was put off to a landing 0.19 m beside its place, 5 of 40 walks to palms.
    """
    for time in times:
        left = max(min(time, most) - EARLY, 0.0)
        middle, span = way.x + 0.5 * way.v * left, (1.0 + 1j) * ACCELERATION * left * left / PEAK
        low, high = (_within(middle + by, *corners) for by in (-span, span))
        yield Landing(time, low, high, *(thrown(way, time, omega, reaction) if reaction else ()))


def thrown(way: Course, time: float, omega: float, reaction: float) -> tuple[complex, float]:
    """How far a foot that lands after a time [s] throws the capture point: at 0 [m], and for each metre from there."""
    left = max(time - EARLY, LEAST)
    z = omega * left
    m_0 = (exp(z) - 1.0) / z
    m_1 = (m_0 - 1.0) / z
    m_2 = (2.0 * m_1 - 1.0) / z
    m_3 = (3.0 * m_2 - 1.0) / z
    end, speed = 60.0 * m_1 - 180.0 * m_2 + 120.0 * m_3, -36.0 * m_1 + 96.0 * m_2 - 60.0 * m_3
    change = m_0 - 9.0 * m_1 + 18.0 * m_2 - 10.0 * m_3
    scale = reaction / z * exp(omega * (time - left))
    return scale * (-way.x * end + way.v * left * speed + way.a * left * left * change), scale * end


def _within(point: complex, low: complex, high: complex) -> complex:
    """The point of a box that is nearest to one."""
    return complex(min(max(point.real, low.real), high.real), min(max(point.imag, low.imag), high.imag))
