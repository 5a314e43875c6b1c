"""Path clock: the chain rule against differences in time, bounds of a change of rate, stop and go."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from tests.support.reference_motions import lissajous_rows
from wholebody.reference import HandMotion, time_scaled
from wholebody.reference.kernels.path_clock import advanced, scale

DT = 0.002


def run(rates, dt=DT, rate=1.0):
    """Parameter, rate and change of rate (ticks + 1, 3) from the start on."""
    clocks = [(0.0, rate, 0.0)]
    for wanted in rates:
        clocks.append(advanced(*clocks[-1], dt, wanted))
    return np.array(clocks)


def test_scaled_derivatives_are_those_in_time():
    def s_of(t):
        return 0.8 * t + 0.1 * np.sin(3 * t), 0.8 + 0.3 * np.cos(3 * t), -0.9 * np.sin(3 * t)

    def in_time(t):
        s, rate, change = s_of(t)
        return time_scaled(HandMotion(lissajous_rows(s)), rate, change)

    t, h = np.linspace(0.0, 3.0, 301), 1e-5
    a, m, b = in_time(t - h), in_time(t), in_time(t + h)
    np.testing.assert_allclose((b.p - a.p) / (2 * h), m.v, atol=1e-8)
    np.testing.assert_allclose((b.v - a.v) / (2 * h), m.a, atol=1e-7)
    turn = Rotation.from_quat(b.quat) * Rotation.from_quat(a.quat).inv()
    np.testing.assert_allclose(turn.as_rotvec() / (2 * h), m.w, atol=1e-8)
    np.testing.assert_allclose((b.w - a.w) / (2 * h), m.alpha, atol=1e-7)
    np.testing.assert_allclose((b.q_finger - a.q_finger) / (2 * h), m.dq_finger, atol=1e-8)
    np.testing.assert_allclose((b.dq_finger - a.dq_finger) / (2 * h), m.ddq_finger, atol=1e-7)


def test_at_its_own_speed_the_clock_is_time():
    trace = run(np.ones(1000))
    np.testing.assert_allclose(trace[:, 0], DT * np.arange(1001), atol=1e-12)
    rows = lissajous_rows(0.4)
    np.testing.assert_array_equal(time_scaled(HandMotion(rows), 1.0, 0.0).rows, rows)


@settings(max_examples=40)
@given(st.integers(0, 10**6), st.sampled_from([0.001, 0.002, 0.01]))
def test_bounds_hold_for_any_wanted_rates(seed, dt):
    rng = np.random.default_rng(seed)
    trace = run(np.repeat(rng.uniform(-0.5, 1.5, 30), rng.integers(1, 60, 30)), dt)
    assert trace[:, 1].min() >= 0.0
    assert np.abs(trace[:, 2]).max() <= 4.0 + 1e-9
    assert np.abs(np.diff(trace[:, 2])).max() <= 40.0 * dt + 0.1  # the last tick of a stop
    assert np.diff(trace[:, 0]).min() >= 0.0


def test_a_change_of_rate_does_not_overshoot():
    down = run(np.full(1000, 0.3))
    assert down[:, 1].min() > 0.3 - 1e-6
    assert down[-1, 1] == pytest.approx(0.3, abs=1e-9)
    up = run(np.ones(1000), rate=0.0)
    assert up[:, 1].max() < 1.0 + 1e-6


def test_a_stop_takes_less_than_half_a_second_and_holds():
    trace = run(np.zeros(1000))
    assert trace[250, 1] < 1e-6
    assert trace[-1, 0] - trace[250, 0] < 1e-6
    assert np.abs(np.diff(trace[:, 2])).max() <= 40.0 * DT + 1e-9


def test_the_parameter_is_the_integral_of_the_rate():
    trace = run(np.r_[np.zeros(100), np.ones(200)])
    integral = DT * np.cumsum(0.5 * (trace[1:, 1] + trace[:-1, 1]))
    np.testing.assert_allclose(trace[1:, 0], integral, atol=1e-5)


def test_a_row_is_scaled_in_place_as_many_are():
    rows = lissajous_rows(np.linspace(0.0, 1.0, 7))
    expected = time_scaled(HandMotion(rows), 0.7, -1.3).rows
    for row in rows:
        scale(row, 0.7, -1.3)
    np.testing.assert_allclose(rows, expected, rtol=1e-14)
