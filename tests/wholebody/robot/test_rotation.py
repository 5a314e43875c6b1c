"""Strategy: the compiled logarithm against the vectorised one of `policy.geometry.rotations` and against the axis and
angle that the rotation was made of, at random angles, at the identity, and up to half a turn.
"""

import numpy as np
import pytest

from policy.geometry.rotations import matrix_to_rotvec, rotvec_to_matrix
from wholebody.jit.entry import Entry
from wholebody.robot.kernels import rotation

LOGARITHM, BETWEEN = Entry(rotation.logarithm), Entry(rotation.rotation_between)
ANGLES = (0.0, 1e-300, 1e-13, 1e-9, 1e-6, 1e-3, 0.3, 1.5, 3.0, *(np.pi - np.array([1e-2, 1e-4, 1e-7, 1e-10])))
AXES = [*np.eye(3), *-np.eye(3), *np.random.default_rng(2).normal(size=(40, 3))]


def logarithm(R):
    w = np.zeros(3)
    LOGARITHM(R, w)
    return w


@pytest.mark.parametrize("angle", ANGLES)
def test_the_logarithm_is_axis_times_angle_and_that_of_the_vectorised_one(angle):
    for axis in AXES:
        w = angle * axis / np.linalg.norm(axis)
        R = rotvec_to_matrix(w)
        np.testing.assert_allclose(logarithm(R), w, atol=2e-15, rtol=1e-14)
        np.testing.assert_allclose(logarithm(R), matrix_to_rotvec(R), atol=2e-15, rtol=1e-14)


def test_the_logarithm_of_half_a_turn_is_one_of_both_axes():
    for axis in AXES:
        w = np.pi * axis / np.linalg.norm(axis)
        found = logarithm(rotvec_to_matrix(w))
        np.testing.assert_allclose(np.outer(found, found), np.outer(w, w), atol=1e-13)


def test_the_turn_between_two_rotations_leads_from_one_to_the_other():
    turns = np.random.default_rng(3).normal(size=(50, 2, 3))
    for R_to, R_from in rotvec_to_matrix(turns):
        w = np.zeros(3)
        BETWEEN(R_to, R_from, w)
        np.testing.assert_allclose(rotvec_to_matrix(w) @ R_from, R_to, atol=1e-14)


def test_what_is_not_a_number_has_no_logarithm():
    R = np.eye(3)
    for i in range(9):
        broken = R.copy()
        broken.flat[i] = np.nan
        assert np.isnan(logarithm(broken)).any()
