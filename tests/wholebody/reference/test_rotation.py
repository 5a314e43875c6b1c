"""Quaternion curves: rates against finite differences and against each other, over all angles and lengths."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from wholebody.reference.rotation import angular_rates, continuous_quaternions, quaternion_rates, rotation_angle

H = 1e-5


def curve(t):
    """A curve in R^4 that is not of unit length, with its first two derivatives."""
    y = np.array([np.sin(2 * t), 0.3 + 0.2 * t**2, np.cos(3 * t), 1.5 + 0.1 * t])
    dy = np.array([2 * np.cos(2 * t), 0.4 * t, -3 * np.sin(3 * t), 0.1])
    ddy = np.array([-4 * np.sin(2 * t), 0.4, -9 * np.cos(3 * t), 0.0])
    return y, dy, ddy


def test_angular_velocity_is_the_derivative_of_the_rotation():
    for t in np.linspace(-2.0, 2.0, 21):
        w, _ = angular_rates(*curve(t))
        turn = Rotation.from_quat(curve(t + H)[0]) * Rotation.from_quat(curve(t - H)[0]).inv()
        np.testing.assert_allclose(turn.as_rotvec() / (2 * H), w, atol=1e-8)


def test_angular_acceleration_is_the_derivative_of_the_angular_velocity():
    for t in np.linspace(-2.0, 2.0, 21):
        _, alpha = angular_rates(*curve(t))
        difference = (angular_rates(*curve(t + H))[0] - angular_rates(*curve(t - H))[0]) / (2 * H)
        np.testing.assert_allclose(difference, alpha, atol=1e-7)


@given(st.integers(0, 10**6))
def test_quaternion_rates_invert_angular_rates(seed):
    rng = np.random.default_rng(seed)
    quat = Rotation.random(random_state=rng).as_quat()
    w, alpha = 10 * rng.normal(size=(2, 3))
    w_back, alpha_back = angular_rates(quat, *quaternion_rates(quat, w, alpha))
    np.testing.assert_allclose(w_back, w, atol=1e-12)
    np.testing.assert_allclose(alpha_back, alpha, atol=1e-11)


def test_quaternions_have_no_sign_jumps_over_several_turns():
    R = Rotation.from_rotvec(np.outer(np.linspace(0.0, 20.0, 200), [0.0, 0.6, 0.8])).as_matrix()
    quat = continuous_quaternions(R)
    assert np.linalg.norm(np.diff(quat, axis=0), axis=1).max() < 0.06
    np.testing.assert_allclose(Rotation.from_quat(quat).as_matrix(), R, atol=1e-12)


@given(st.sampled_from([0.0, 1e-12, 1e-8, 1e-3, 1.0, 3.0, np.pi]), st.booleans())
def test_rotation_angle_is_exact_from_zero_to_pi_and_blind_to_sign(angle, flip):
    a = Rotation.from_rotvec([0.3, -0.2, 0.9])
    b = Rotation.from_rotvec(angle * np.array([0.0, 0.6, 0.8])) * a
    quat = -b.as_quat() if flip else b.as_quat()
    assert abs(rotation_angle(a.as_quat(), quat) - angle) < (1e-7 if angle > 3.1 else 1e-14)
