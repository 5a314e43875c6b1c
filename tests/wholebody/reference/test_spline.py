"""Spline: equal to scipy's where that is defined, C2 where slopes are limited, monotone between wild knots."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline

from wholebody.reference.spline import PiecewiseQuintic, knot_derivatives, quintic, shift


def through(times, y, limited=None):
    limited = np.zeros(len(times), dtype=bool) if limited is None else limited
    jets = np.stack([y, *knot_derivatives(times, y, limited)])
    return PiecewiseQuintic(times, quintic(np.diff(times), jets[:, :-1], jets[:, 1:]))


@pytest.mark.parametrize("count", [2, 3, 4, 5, 50])
def test_spline_is_scipys_not_a_knot_cubic(count):
    rng = np.random.default_rng(count)
    times, y = np.cumsum(rng.uniform(0.02, 0.06, count)), rng.normal(size=(count, 4))
    s = np.linspace(times[0], times[-1], 301)
    expected = CubicSpline(times, y)
    for order, value in enumerate(through(times, y)(s)):
        np.testing.assert_allclose(value, expected(s, order), atol=1e-9 * 100**order)


@given(st.integers(0, 10**6))
def test_any_limited_knots_leave_the_curve_twice_differentiable(seed):
    rng = np.random.default_rng(seed)
    times, y = np.cumsum(rng.uniform(0.5, 1.5, 9)), rng.normal(size=(9, 2))
    curve = through(times, y, rng.random(9) < 0.4)
    before, after = curve(times[1:-1] - 1e-9), curve(times[1:-1])
    for order in range(3):
        np.testing.assert_allclose(before[order], after[order], atol=1e-6)
    np.testing.assert_allclose(after[0], y[1:-1], atol=1e-12)


@given(st.integers(0, 10**6))
def test_between_limited_knots_the_curve_is_monotone(seed):
    rng = np.random.default_rng(seed)
    times, y = np.arange(8.0), rng.normal(size=(8, 3)) * 10.0 ** rng.uniform(-2, 2, (8, 1))
    curve = through(times, y, np.ones(8, dtype=bool))
    for i in range(7):
        value = curve(np.linspace(i, i + 1, 41))[0]
        low, high = np.minimum(y[i], y[i + 1]), np.maximum(y[i], y[i + 1])
        room = 1e-9 * np.abs(y).max()
        assert np.all(value >= low - room)
        assert np.all(value <= high + room)


def test_a_wild_neighbour_does_not_bend_a_smooth_stretch():
    times, y = np.arange(12.0), np.zeros((12, 1))
    y[8:] = 1000.0
    limited = np.zeros(12, dtype=bool)
    limited[7:9] = True
    assert np.abs(through(times, y, limited)(np.linspace(0.0, 7.0, 200))[0]).max() < 1e-12


def test_shift_and_split_describe_the_same_curve():
    rng = np.random.default_rng(3)
    curve = PiecewiseQuintic(np.array([0.0, 1.0, 2.5]), rng.normal(size=(2, 6, 3)))
    s = np.linspace(0.0, 2.5, 40, endpoint=False)
    parts = curve.split(np.array([-1.0, 0.4, 1.0, 2.0, 4.0]))
    for value, expected in zip(parts(s), curve(s), strict=True):
        np.testing.assert_allclose(value, expected, atol=1e-10)
    np.testing.assert_allclose(parts(np.array([-1.0, 3.0]))[0], curve(np.array([-1.0, 3.0]))[0], atol=1e-12)
    moved = shift(curve.coefficients[:1], np.array([0.25]))
    np.testing.assert_allclose(moved[0, 0], curve(np.array([0.25]))[0][0], atol=1e-12)


def test_before_and_after_the_curve_its_ends_are_held():
    curve = through(np.arange(4.0), np.arange(4.0)[:, None] ** 2)
    np.testing.assert_allclose(curve(np.array([-5.0, 9.0]))[0][:, 0], [0.0, 9.0], atol=1e-12)
