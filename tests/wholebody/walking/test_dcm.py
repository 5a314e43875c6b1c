"""Strategy: the closed form against the pendulum integrated step by step, and against placo's plan as an oracle.

A DCM that begins where the plan says ends at rest over the last point; one that begins a millimetre beside it does not.
placo solves a program of many steps for the same walk on its own; where a sole carries alone, and between soles, its
DCM is to be near ours. Its feet are half a step wide at the ends, so the middle of the walk is compared.
"""

from cmath import exp

import numpy as np
import pytest

from wholebody.walking.dcm import Piece, bounded, start_for

OMEGA = 3.85
PIECES = [
    Piece(0.6, 0j, 0.1j),
    Piece(0.55, 0.1j, 0.1j),
    Piece(0.15, 0.1j, 0.2 - 0.1j),
    Piece(0.55, 0.2 - 0.1j, 0.2 - 0.1j),
    Piece(0.6, 0.2 - 0.1j, 0.2 + 0j),
]


def integrated(dcm, pieces, steps=4000):
    """DCM at the end of pieces by midpoint steps of ``dxi = omega (xi - p)``."""
    for piece in pieces:
        dt = piece.duration / steps
        for k in range(steps):
            p = piece.start + (piece.end - piece.start) * (k + 0.5) / steps
            dcm = p + (dcm - p) * exp(OMEGA * dt)
    return dcm


def test_the_dcm_that_is_planned_ends_at_rest_over_the_last_point():
    first = bounded(PIECES, OMEGA)
    assert abs(integrated(first, PIECES) - PIECES[-1].end) < 1e-3
    assert abs(integrated(first + 0.001, PIECES) - PIECES[-1].end) > 1.0


def test_forwards_and_backwards_are_inverse():
    for piece in PIECES:
        assert abs(piece.after(piece.before(0.3 - 0.2j, OMEGA), OMEGA) - (0.3 - 0.2j)) < 1e-12
        assert piece.after(0.1 + 0.1j, OMEGA, 0.0) == pytest.approx(0.1 + 0.1j)


def test_what_is_left_of_a_piece_leads_to_the_same_end():
    piece = PIECES[2]
    first = piece.before(0.1j, OMEGA)
    for time in (0.0, 0.05, 0.15):
        now = piece.after(first, OMEGA, time)
        assert abs(piece.left(time).before(0.1j, OMEGA) - now) < 1e-12
    assert piece.left(1.0).before(0.1j, OMEGA) == 0.1j


def test_a_shift_begins_where_the_dcm_is():
    rest, now = PIECES[1:], 0.003 - 0.002j
    last = bounded(rest, OMEGA)
    start = start_for(now, Piece(0.6, 0j, 0.1j), last, OMEGA)
    shift = Piece(0.6, start, 0.1j)
    assert abs(shift.before(last, OMEGA) - now) < 1e-12
    assert start.imag < now.imag  # it pushes away from the foot that is to carry


def test_placo_plans_the_same_motion():
    placo = pytest.importorskip("placo")
    omega, single, double = placo.LIPM.compute_omega(0.66), 0.6, 0.15
    assert omega == pytest.approx((9.81 / 0.66) ** 0.5, rel=1e-3)
    points = [0.15 * k + (0.1j if k % 2 else -0.1j) for k in range(8)]
    pieces = []
    for k, point in enumerate(points):
        following = points[k + 1] if k + 1 < len(points) else 0.5 * (points[-2] + points[-1])
        pieces += [Piece(single, point, point), Piece(double, point, following)]
    lipm, worst = placo_lipm(placo, pieces, omega), 0.0
    for k in range(4, 10):  # the middle of the walk
        theirs = complex(*lipm.dcm(sum(piece.duration for piece in pieces[:k]), omega))
        worst = max(worst, abs(bounded(pieces[k:], omega) - theirs))
    print(f"largest difference of the DCM from placo's {1e3 * worst:.1f} mm")
    assert worst < 0.006


def placo_lipm(placo, pieces, omega):
    """Trajectory of placo's own pendulum for a zero-moment point: a jerk for each period of 20 ms, least squares."""
    problem, dt = placo.Problem(), 0.02
    ends = np.cumsum([piece.duration for piece in pieces])
    steps = round(ends[-1] / dt)
    begin, end = (np.array([point.real, point.imag]) for point in (pieces[0].start, pieces[-1].end))
    lipm = placo.LIPM(problem, dt, steps, 0.0, begin, np.zeros(2), np.zeros(2))
    for k in range(steps):
        time = (k + 1e-6) * dt
        n = int(np.searchsorted(ends, time))
        point = pieces[n].left(time - ends[n] + pieces[n].duration).start
        problem.add_constraint(lipm.zmp(k, omega**2) == np.array([point.real, point.imag])).configure("soft", 1.0)
    problem.add_constraint(lipm.dcm(steps, omega) == end).configure("soft", 1e3)
    problem.solve()
    return lipm.get_trajectory()
