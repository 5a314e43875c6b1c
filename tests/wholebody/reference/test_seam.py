"""Seam: zero for one motion cut in two, the jump for two motions, measured at the stitching instant."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.support.reference_motions import chunk, lissajous_rows
from wholebody.reference import HandMotion, HandPath, path_seam, rest_row, seam


def test_one_smooth_motion_has_no_seam():
    a, b = HandMotion(lissajous_rows(1.0)[0]), HandMotion(lissajous_rows(1.002)[0])
    measured = seam(a, b, since=0.0013, until=0.0007)
    assert measured.distance < 1e-7  # 194 m/s^4 and 32 m/s^3 over 2 ms
    assert measured.velocity < 1e-3
    assert measured.angle < 1e-7
    assert measured.angular_velocity < 1e-3
    assert measured.finger < 1e-7


def test_a_jump_is_measured_as_it_is():
    before, after = rest_row(np.eye(4)), rest_row(np.eye(4))
    after[:3], after[3:6], after[6:9] = [0.003, 0.0, 0.004], [0.0, 0.1, 0.0], [0.0, 0.0, 2.0]
    after[9:13] = -Rotation.from_rotvec([0.0, 0.02, 0.0]).as_quat()
    after[13:16], after[19] = [0.0, 0.0, 0.3], -0.05
    measured = seam(HandMotion(before), HandMotion(after))
    assert measured.distance == pytest.approx(0.005)
    assert measured.angle == pytest.approx(0.02)
    assert measured.velocity == pytest.approx(0.1)
    assert measured.angular_velocity == pytest.approx(0.3)
    assert measured.acceleration == pytest.approx(2.0)
    assert measured.finger == pytest.approx(0.05)


def test_both_sides_are_extrapolated_to_the_instant():
    before, after = rest_row(np.eye(4)), rest_row(np.eye(4))
    before[3], before[13] = 1.0, 2.0
    after[0], after[3], after[13] = 0.002, 1.0, 2.0
    after[9:13] = Rotation.from_rotvec([0.004, 0.0, 0.0]).as_quat()
    measured = seam(HandMotion(before), HandMotion(after), since=0.0005, until=0.0015)
    assert measured.distance == pytest.approx(0.0, abs=1e-12)
    assert measured.angle == pytest.approx(0.0, abs=1e-12)


def test_a_joined_path_has_no_seam_and_an_unjoined_one_shows_it():
    old = HandPath.from_knots(*chunk(0.0))
    times, T, q = chunk(0.5)
    T[:, :3, 3] += [0.03, 0.0, 0.04]
    new = HandPath.from_knots(times, T, q)
    assert path_seam(old, new, 0.8).distance == pytest.approx(0.05, abs=1e-4)
    joined = path_seam(old, new.joined(old.sample(0.8), 0.8), 0.8)
    assert joined.distance < 1e-12
    assert joined.velocity < 1e-12
    assert joined.acceleration < 1e-10
    assert joined.angle < 1e-7
    assert joined.angular_velocity < 1e-12
