"""Strategy: whatever acceleration inside the bounds is applied, the joint never leaves its limits."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wholebody.limits.base import braking_bound
from wholebody.limits.joint import JointLimits, viable_acceleration_bounds

DT = 0.002
LIMITS = JointLimits(*np.array([[-1.0], [1.0], [10.0], [200.0], [50.0]]))


def bounds(q, dq, dt=DT):
    return viable_acceleration_bounds(np.array([q]), np.array([dq]), LIMITS, dt)


@given(start=st.floats(-0.9, 0.9), choices=st.lists(st.floats(0.0, 1.0), min_size=5, max_size=5))
def test_a_joint_that_keeps_to_the_bounds_never_leaves_its_limits(start, choices):
    q, dq = start, 0.0
    for share in choices:
        for _ in range(40):
            low, high = bounds(q, dq)
            ddq = float(low[0] + share * (high[0] - low[0]))
            q, dq = q + DT * dq + 0.5 * DT**2 * ddq, dq + DT * ddq
            assert -1.0 - 1e-9 <= q <= 1.0 + 1e-9
            assert abs(dq) <= 10.0 + 1e-9


@given(q=st.floats(-1.5, 1.5), dq=st.floats(-20.0, 20.0))
def test_bounds_are_finite_and_ordered_everywhere(q, dq):
    low, high = bounds(q, dq)
    assert np.isfinite([low, high]).all()
    assert (low <= high).all()
    assert (np.abs([low, high]) <= 200.0).all()


def test_a_joint_past_its_bound_is_told_to_come_back():
    _, high = bounds(1.01, 0.0)
    assert high[0] <= 0.0


@given(margin=st.floats(-0.1, 1.0), rate=st.floats(-5.0, 5.0))
def test_the_braking_bound_is_finite_and_grows_with_the_margin(margin, rate):
    near = braking_bound(np.array([margin]), np.array([rate]), 10.0)
    far = braking_bound(np.array([margin + 0.01]), np.array([rate]), 10.0)
    assert np.isfinite(near).all()
    assert far[0] >= near[0]


def test_the_braking_bound_stops_a_mass_at_the_bound_within_a_centimetre():
    x, v, dt = 0.0, 0.0, 0.002
    for _ in range(3000):
        a = min(20.0, float(braking_bound(np.array([0.3 - x]), np.array([v]), 10.0)[0]))
        x, v = x + dt * v, v + dt * a
        assert x <= 0.3 + 0.01
    assert abs(x - 0.3) < 1e-3


@pytest.mark.parametrize("start", [0.05, 0.3, 1.0])
def test_a_motion_that_kept_to_the_braking_bound_from_afar_brakes_little_harder_than_that(start):
    x, v, dt, hardest = start, 0.0, 0.0005, 0.0
    for _ in range(6000):
        a = min(20.0, float(braking_bound(np.array([x]), np.array([v]), 10.0)[0]))
        x, v, hardest = x - dt * v - 0.5 * dt**2 * a, v + dt * a, min(hardest, a)
    assert -21.5 < hardest < -9.0


def test_the_braking_bound_of_a_motion_that_is_too_fast_is_the_excess_of_speed_per_time_constant():
    bound = braking_bound(np.array([1e-3]), np.array([1.0]), 10.0)
    assert bound[0] == pytest.approx((1e-3 / 0.02 - 1.0) / 0.02)  # -47.5: nearly five times the brake
