"""Strategy: the closed form of a landing against a QP solver, at random, and what it does against a pendulum.

With nothing wrong the step stays as planned. A push moves the place towards it and, where the place is at its bound,
the time; what comes out always solves the pendulum's equation, also with a double support and with a foot that throws
the body, which the source leaves out. Of all landings the cheapest is made.
"""

from math import exp

import numpy as np
import pytest

from wholebody.walking.adjustment import OFFSET, PLACE, TIME, Landing, Step, adjust
from wholebody.walking.dcm import Piece, bounded

OMEGA, DOUBLE = 3.85, 0.15
LOW, HIGH = -0.3 - 0.42j, 0.3 - 0.15j
SOONEST, LATEST = 0.2, 0.7


def landings(*first):
    """Landings at some times first [s], then at many others."""
    return [Landing(time, LOW, HIGH) for time in (*first, *np.linspace(SOONEST, LATEST, 251))]


def planned(time=0.4, place=0.1 - 0.24j):
    """A step of a steady walk with the DCM now that leads to it."""
    steps = [place, 2 * place.real + 0j, 3 * place.real - 0.24j]
    pieces = [Piece(time, 0j, 0j)]
    before = 0j
    for point in steps:
        pieces += [Piece(DOUBLE, before, point), Piece(0.55, point, point)]
        before = point
    offset = bounded(pieces[2:], OMEGA) - place
    return Step(place, time, offset), bounded(pieces, OMEGA)


def residual(dcm, step, double, landing=None):
    gone = exp(-OMEGA * double)
    share = (1.0 - gone) / (OMEGA * double) if double > 0.0 else 1.0
    thrown = 0.0 if landing is None else landing.thrown + landing.gain * step.place
    return abs(dcm * exp(OMEGA * step.time) + thrown - share * step.place - gone * step.offset)


def by_solver(dcm, step, landing, double):
    """The four numbers by daqp, place and offset, and their cost without that of the time."""
    import daqp

    gone, tau = exp(-OMEGA * double), exp(OMEGA * landing.time)
    share = (1.0 - gone) / (OMEGA * double) if double > 0.0 else 1.0
    weights = np.array([PLACE, PLACE, OFFSET, OFFSET])
    wanted = np.array([step.place.real, step.place.imag, step.offset.real, step.offset.imag])
    A, there = np.kron([landing.gain - share, -gone], np.eye(2)), -(dcm * tau + landing.thrown)
    low = np.array([landing.low.real, landing.low.imag, -1e9, -1e9, there.real, there.imag])
    high = np.array([landing.high.real, landing.high.imag, 1e9, 1e9, there.real, there.imag])
    x, *_ = daqp.solve(np.diag(weights), -weights * wanted, A, high, low, np.array([0] * 4 + [5, 5], dtype=np.int32))
    return x, float(weights @ (x - wanted) ** 2)


@pytest.mark.parametrize("double", [0.15, 0.0])
def test_the_answer_is_that_of_a_solver(double):
    rng = np.random.default_rng(3)
    for _ in range(200):
        step = Step(complex(*rng.normal(0, 0.2, 2)), rng.uniform(0.2, 0.6), complex(*rng.normal(0, 0.1, 2)))
        dcm = complex(*rng.normal(0.0, 0.1, 2))
        tried = [
            Landing(time, LOW - 0.1 * time, HIGH + 0.1 * time, complex(*rng.normal(0, 0.05, 2)), rng.uniform(0.0, 0.3))
            for time in rng.uniform(SOONEST, LATEST, 3)
        ]
        answer, costs = adjust(dcm, step, tried, OMEGA, double), []
        for landing in tried:
            x, cost = by_solver(dcm, step, landing, double)
            costs.append(cost + TIME * (exp(OMEGA * (landing.time - step.time)) - 1.0) ** 2)
            if landing.time == answer.time:
                assert abs(answer.place - complex(x[0], x[1])) < 1e-5
                assert abs(answer.offset - complex(x[2], x[3])) < 1e-5
                assert residual(dcm, answer, double, landing) < 1e-9
        assert answer.time == tried[int(np.argmin(costs))].time


def test_a_step_stays_as_planned_where_nothing_happened():
    step, dcm = planned()
    answer = adjust(dcm, step, landings(step.time), OMEGA, DOUBLE)
    assert abs(answer.place - step.place) < 1e-9
    assert answer.time == pytest.approx(step.time, abs=1e-9)


def test_the_foot_goes_where_it_is_pushed():
    step, dcm = planned()
    for push in (0.02, -0.02, 0.02j, -0.02j):
        moved = adjust(dcm + push, step, landings(step.time), OMEGA, DOUBLE).place - step.place
        way = (moved * complex(push).conjugate()).real / abs(push)
        assert way > 0.02 or abs(push.imag) > 0.0  # to the side the box is near
        assert way >= -1e-9


def test_a_place_at_its_bound_costs_time():
    step, dcm = planned()
    answer = adjust(dcm + 0.12, step, landings(step.time), OMEGA, DOUBLE)
    assert answer.place.real == pytest.approx(HIGH.real)
    assert SOONEST <= answer.time < step.time
    far = adjust(dcm + 1.0, step, landings(step.time), OMEGA, DOUBLE)
    assert far.time == pytest.approx(SOONEST)
    assert residual(dcm + 1.0, far, DOUBLE) < 1e-9
