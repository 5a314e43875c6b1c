"""Rotations and rigid transforms.

Strategy: every form goes to a matrix and back (property, with samples at the identity and at pi), and is compared with
scipy, which the package itself does not use. What is no rotation is refused, naming which.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp

from policy.errors import RotationError
from policy.geometry.rotations import (
    angle_between,
    matrix_to_quaternion,
    matrix_to_rot6d,
    matrix_to_rotvec,
    matrix_to_rpy,
    quaternion_to_matrix,
    rot6d_to_matrix,
    rotation_residual,
    rotvec_to_matrix,
    rpy_to_matrix,
)
from policy.geometry.se3 import interpolate, inverse, make_transform, translated, yaw_frame
from tests.support.policy_cases import rotation_vectors

MANY = Rotation.random(300, rng=np.random.default_rng(7))


@given(rotation_vectors())
def test_the_exponential_map_is_scipys(rotvec):
    assert np.allclose(rotvec_to_matrix(rotvec), Rotation.from_rotvec(rotvec).as_matrix(), atol=1e-12)


@given(rotation_vectors())
def test_rotvec_comes_back(rotvec):
    R = rotvec_to_matrix(rotvec)
    again = matrix_to_rotvec(R)
    assert np.allclose(rotvec_to_matrix(again), R, atol=1e-12)
    assert np.linalg.norm(again) <= np.pi + 1e-12


@given(rotation_vectors(), st.sampled_from(["rows", "cols"]))
def test_rot6d_comes_back_in_both_layouts(rotvec, layout):
    R = rotvec_to_matrix(rotvec)
    assert np.allclose(rot6d_to_matrix(matrix_to_rot6d(R, layout), layout), R, atol=1e-12)


@given(rotation_vectors(), st.sampled_from(["xyzw", "wxyz"]))
def test_quaternions_come_back_in_both_orders(rotvec, order):
    R = rotvec_to_matrix(rotvec)
    quat = matrix_to_quaternion(R, order)
    assert quat[3 if order == "xyzw" else 0] >= 0.0
    assert np.allclose(quaternion_to_matrix(quat, order), R, atol=1e-12)


@given(rotation_vectors())
def test_rpy_comes_back(rotvec):
    R = rotvec_to_matrix(rotvec)
    assert np.allclose(rpy_to_matrix(matrix_to_rpy(R)), R, atol=1e-6)


@pytest.mark.parametrize("pitch", [np.pi / 2, -np.pi / 2])
def test_rpy_comes_back_where_roll_and_yaw_are_one(pitch):
    R = rpy_to_matrix(np.array([0.3, pitch, -0.4]))
    assert np.allclose(rpy_to_matrix(matrix_to_rpy(R)), R, atol=1e-8)


def test_all_forms_agree_with_scipy_on_many_rotations_at_once():
    R = MANY.as_matrix()
    assert np.allclose(quaternion_to_matrix(MANY.as_quat(), "xyzw"), R)
    assert np.allclose(quaternion_to_matrix(np.roll(MANY.as_quat(), 1, axis=-1), "wxyz"), R)
    assert np.allclose(matrix_to_quaternion(R, "xyzw"), MANY.as_quat(canonical=True))
    assert np.allclose(matrix_to_rotvec(R), MANY.as_rotvec())
    assert np.allclose(matrix_to_rpy(R), MANY.as_euler("xyz"))
    assert np.allclose(matrix_to_rot6d(R, "cols"), np.concatenate([R[:, :, 0], R[:, :, 1]], axis=1))
    assert np.allclose(matrix_to_rot6d(R, "rows"), np.concatenate([R[:, 0], R[:, 1]], axis=1))


def test_reading_rows_as_columns_turns_by_twice_the_angle_and_says_nothing():
    R = MANY.as_matrix()
    misread = rot6d_to_matrix(matrix_to_rot6d(R, "rows"), "cols")
    assert np.allclose(misread, np.swapaxes(R, -1, -2))
    assert np.rad2deg(angle_between(R, misread)).mean() > 80.0


@pytest.mark.parametrize(
    ("numbers", "complaint"),
    [
        ([1, 0, 0, 0, 0.01, 0], "norm 0.01"),
        ([1, 0, 0, 1, 0.05, 0], "near-parallel"),
        ([1, 0, 0, np.nan, 1, 0], "not finite"),
    ],
)
def test_a_degenerate_rot6d_is_refused_with_its_index(numbers, complaint):
    good = [1.0, 0, 0, 0, 1, 0]
    with pytest.raises(RotationError, match=complaint) as refusal:
        rot6d_to_matrix(np.array([good, good, numbers]), "cols")
    assert refusal.value.index == 2


@pytest.mark.parametrize("quat", [[0, 0, 0, 2.0], [0.5, 0.5, 0.5, 0.4], [0, 0, 0, 0], [0, 0, 0, np.inf]])
def test_a_quaternion_off_the_unit_sphere_is_refused(quat):
    with pytest.raises(RotationError):
        quaternion_to_matrix(np.array(quat, dtype=float), "xyzw")


@pytest.mark.parametrize(
    "call",
    [
        lambda: rot6d_to_matrix(np.eye(6)[0], "columns"),
        lambda: matrix_to_rot6d(np.eye(3), ""),
        lambda: quaternion_to_matrix(np.array([0, 0, 0, 1.0]), "xyz"),
        lambda: matrix_to_quaternion(np.eye(3), None),
    ],
)
def test_a_convention_is_never_guessed(call):
    with pytest.raises(RotationError, match="it is '"):
        call()


def test_a_wrong_width_is_refused():
    with pytest.raises(RotationError, match="last axis must be 3"):
        rotvec_to_matrix(np.zeros((2, 4)))


def test_the_residual_sees_mirrors_scales_and_nan():
    assert rotation_residual(np.eye(3)) == 0.0
    assert rotation_residual(np.diag([1.0, 1.0, -1.0])) == 2.0
    assert rotation_residual(1.001 * np.eye(3)) > 1e-3
    assert not rotation_residual(np.full((3, 3), np.nan)) <= 1.0


def test_interpolation_is_the_geodesic_and_exact_at_the_knots():
    rng = np.random.default_rng(3)
    times = np.cumsum(rng.uniform(0.1, 0.4, 12))
    T = make_transform(MANY[:12].as_matrix(), rng.normal(size=(12, 3)))
    at = np.linspace(times[0], times[-1], 50)
    found = interpolate(T, times, at)
    assert np.allclose(found[:, :3, :3], Slerp(times, MANY[:12])(at).as_matrix(), atol=1e-10)
    assert np.allclose(interpolate(T, times, times), T, atol=1e-12)


def test_interpolation_holds_the_ends():
    T = make_transform(MANY[:2].as_matrix(), np.zeros((2, 3)))
    assert np.allclose(interpolate(T, np.array([0.0, 1.0]), np.array([-5.0, 7.0])), T)
    assert np.allclose(interpolate(T[:1], np.array([0.0]), np.array([-5.0, 7.0])), T[[0, 0]])


def test_inverse_and_translation_are_those_of_matrices():
    T = make_transform(MANY.as_matrix(), np.random.default_rng(1).normal(size=(300, 3)))
    assert np.allclose(inverse(T) @ T, np.eye(4), atol=1e-12)
    offset = np.array([0.1, -0.2, 0.3])
    assert np.allclose(translated(T, offset), T @ make_transform(np.eye(3), offset))


def test_the_yaw_frame_is_upright_and_keeps_heading_and_origin():
    T = make_transform(rpy_to_matrix(np.array([0.3, -0.4, 1.1])), np.array([1.0, 2.0, 3.0]))
    upright = yaw_frame(T)
    assert np.allclose(upright[:3, 3], T[:3, 3])
    assert np.allclose(matrix_to_rpy(upright[:3, :3]), [0.0, 0.0, 1.1])
