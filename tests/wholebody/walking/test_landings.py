"""Strategy: what a foot throws the capture point by, against the quintic that it goes on, summed up in small steps."""

from math import exp, inf

import numpy as np
import pytest

from wholebody.walking.landings import ACCELERATION, PEAK, REACTION, landings, thrown
from wholebody.walking.swing import EARLY, Course

OMEGA, CORNERS = 3.85, (-0.5 - 0.4j, 0.5 - 0.15j)


@pytest.mark.parametrize("time", [0.1, 0.27, 0.5])
def test_a_foot_throws_by_what_its_accelerations_come_to(time):
    rng, dt = np.random.default_rng(4), 1e-5
    for _ in range(3):
        way, end = Course(*(complex(*rng.normal(0.0, scale, 2)) for scale in (0.2, 0.5, 5.0))), 0.3 - 0.2j
        now, summed = way, 0j
        for k in range(round((time - EARLY) / dt)):
            summed += REACTION / OMEGA * exp(OMEGA * (time - (k + 0.5) * dt)) * now.a * dt
            now = now.towards(Course(end), time - EARLY - k * dt, dt)
        moved, gain = thrown(way, time, OMEGA, REACTION)
        assert abs(moved + gain * end - summed) < 1e-3 * max(abs(summed), 0.1)


def test_a_foot_that_lands_soon_reaches_less_and_throws_less():
    way = Course(0.0 - 0.24j)
    soon, late = landings(way, CORNERS, (0.2, 0.35), OMEGA, REACTION, inf)
    assert soon.high.real < late.high.real < CORNERS[1].real
    assert next(iter(landings(way, CORNERS, (EARLY,), OMEGA, 0.0, inf))).high == way.x  # there is no time left
    left = 0.2 - EARLY
    assert soon.high.real == pytest.approx(ACCELERATION * left * left / PEAK)
    assert REACTION < soon.gain < late.gain  # the capture point has less time to run on
    assert abs(soon.thrown + soon.gain * way.x) < 1e-9  # where it is: at rest it throws nothing
    assert next(iter(landings(way, CORNERS, (0.2,), OMEGA, 0.0, inf))).gain == 0.0


def test_a_foot_on_its_way_reaches_what_it_can_still_brake_for():
    ahead = next(iter(landings(Course(0.1 - 0.24j, 1.0 + 0j), CORNERS, (0.15,), OMEGA, REACTION, inf)))
    back = next(iter(landings(Course(0.1 - 0.24j, -1.0 + 0j), CORNERS, (0.15,), OMEGA, REACTION, inf)))
    assert ahead.high.real - back.high.real == pytest.approx(0.15 - EARLY)
    assert CORNERS[0].imag <= ahead.low.imag <= ahead.high.imag <= CORNERS[1].imag


def test_a_later_landing_reaches_no_further_than_the_last_one_of_a_walk():
    last, later = landings(Course(0.0 - 0.24j), CORNERS, (0.2, 0.3), OMEGA, 0.0, 0.2)
    assert (last.low, last.high) == (later.low, later.high)
