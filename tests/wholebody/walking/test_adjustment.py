"""Strategy: the closed form against a QP solver on the same program, at random, and what it does against a pendulum.

With nothing wrong the step stays as planned. A push moves the place towards it and, where the place is at its bound,
the time; what comes out always solves the pendulum's equation, also with a double support, which the source leaves out.
"""

from math import exp

import numpy as np
import pytest

from wholebody.walking.adjustment import OFFSET, PLACE, TIME, Room, Step, adjust
from wholebody.walking.dcm import Piece, bounded

OMEGA, DOUBLE = 3.85, 0.15
ROOM = Room(-0.3 - 0.42j, 0.3 - 0.15j, 0.2, 0.7)


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


def residual(dcm, step, double):
    gone = exp(-OMEGA * double)
    share = (1.0 - gone) / (OMEGA * double) if double > 0.0 else 1.0
    return abs(dcm * exp(OMEGA * step.time) - share * step.place - gone * step.offset)


def by_solver(dcm, step, room, double):
    """The five numbers by daqp: place, tau, offset."""
    import daqp

    gone, tau = exp(-OMEGA * double), exp(OMEGA * step.time)
    share = (1.0 - gone) / (OMEGA * double) if double > 0.0 else 1.0
    weights = np.array([PLACE, PLACE, TIME / tau**2, OFFSET, OFFSET])
    wanted = np.array([step.place.real, step.place.imag, tau, step.offset.real, step.offset.imag])
    A = np.array([[-share, 0, dcm.real, -gone, 0], [0, -share, dcm.imag, 0, -gone]])
    low = np.array([room.low.real, room.low.imag, exp(OMEGA * room.soonest), -1e9, -1e9, 0, 0])
    high = np.array([room.high.real, room.high.imag, exp(OMEGA * room.latest), 1e9, 1e9, 0, 0])
    x, *_ = daqp.solve(np.diag(weights), -weights * wanted, A, high, low, np.array([0] * 5 + [5, 5], dtype=np.int32))
    return x


@pytest.mark.parametrize("double", [0.15, 0.0])
def test_the_answer_is_that_of_a_solver(double):
    rng = np.random.default_rng(3)
    for _ in range(200):
        step = Step(complex(*rng.normal(0, 0.2, 2)), rng.uniform(0.2, 0.6), complex(*rng.normal(0, 0.1, 2)))
        dcm = complex(*rng.normal(0.0, 0.1, 2))
        answer, x = adjust(dcm, step, ROOM, OMEGA, double), by_solver(dcm, step, ROOM, double)
        assert abs(answer.place - complex(x[0], x[1])) < 1e-5
        assert exp(OMEGA * answer.time) == pytest.approx(x[2], abs=1e-4)
        assert abs(answer.offset - complex(x[3], x[4])) < 1e-5
        assert residual(dcm, answer, double) < 1e-9


def test_a_step_stays_as_planned_where_nothing_happened():
    step, dcm = planned()
    answer = adjust(dcm, step, ROOM, OMEGA, DOUBLE)
    assert abs(answer.place - step.place) < 1e-9
    assert answer.time == pytest.approx(step.time, abs=1e-9)


def test_the_foot_goes_where_it_is_pushed():
    step, dcm = planned()
    for push in (0.02, -0.02, 0.02j, -0.02j):
        moved = adjust(dcm + push, step, ROOM, OMEGA, DOUBLE).place - step.place
        way = (moved * complex(push).conjugate()).real / abs(push)
        assert way > 0.02 or abs(push.imag) > 0.0  # to the side the box is near
        assert way >= -1e-9


def test_a_place_at_its_bound_costs_time():
    step, dcm = planned()
    answer = adjust(dcm + 0.12, step, ROOM, OMEGA, DOUBLE)
    assert answer.place.real == pytest.approx(ROOM.high.real)
    assert ROOM.soonest <= answer.time < step.time
    far = adjust(dcm + 1.0, step, ROOM, OMEGA, DOUBLE)
    assert far.time == pytest.approx(ROOM.soonest)
    assert residual(dcm + 1.0, far, DOUBLE) < 1e-9
