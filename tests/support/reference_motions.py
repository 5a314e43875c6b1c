"""Motions with known derivatives, as rows and as knots, for the tests of `wholebody.reference`."""

import numpy as np
from scipy.spatial.transform import Rotation

from wholebody.jit.entry import Entry
from wholebody.reference.kernels.path import path_row
from wholebody.reference.kernels.smoother import smoother_step
from wholebody.reference.layout import ALPHA, DDQ_FINGER, DQ_FINGER, Q_FINGER, QUAT, ROW, A, P, V, W

_look_up, _step = Entry(path_row), Entry(smoother_step)

CENTRE = np.array([0.24, 0.21, 0.86])  # the lissajous of the benchmarks
RATES = 2.0 * np.array([1.0, 2.0, 3.0])
AXIS = np.array([1.0, 2.0, -2.0]) / 3.0


def row_at(path, s):
    """Row of a path at one parameter, as the control tick looks it up."""
    row = np.empty(ROW)
    _look_up(path.flat, float(s), row)
    return row


def step(smoother, target, dt):
    """Advance a smoother by one tick towards a target (hands, 40), as the control tick does; what is commanded then."""
    _step(smoother.state, np.ascontiguousarray(target, dtype=float), smoother.limits, float(dt))
    return smoother.motion


def lissajous_rows(t, *, turn=0.8, fingers=0.4):
    """Rows (n, 40) of the 1.1 m/s lissajous, turning ``turn`` rad about a fixed axis, fingers moving in phase."""
    t = np.atleast_1d(np.asarray(t, dtype=float))
    rows = np.zeros((len(t), ROW))
    angle = np.outer(t, RATES)
    rows[:, P] = CENTRE + 0.15 * np.sin(angle)
    rows[:, V] = 0.15 * RATES * np.cos(angle)
    rows[:, A] = -0.15 * RATES**2 * np.sin(angle)
    rows[:, QUAT] = Rotation.from_rotvec(np.outer(turn * np.sin(3 * t), AXIS)).as_quat()
    rows[:, W] = np.outer(3 * turn * np.cos(3 * t), AXIS)
    rows[:, ALPHA] = np.outer(-9 * turn * np.sin(3 * t), AXIS)
    rows[:, Q_FINGER] = fingers * np.sin(4 * t)[:, None]
    rows[:, DQ_FINGER] = 4 * fingers * np.cos(4 * t)[:, None]
    rows[:, DDQ_FINGER] = -16 * fingers * np.sin(4 * t)[:, None]
    return rows


def knots_of(rows):
    """Poses (H, 4, 4) and finger joints (H, 7) of rows (H, 40)."""
    T = np.tile(np.eye(4), (len(rows), 1, 1))
    T[:, :3, 3], T[:, :3, :3] = rows[:, P], Rotation.from_quat(rows[:, QUAT]).as_matrix()
    return T, rows[:, Q_FINGER].copy()


def chunk(t_start, *, steps=50, fps=30.0, motion=lissajous_rows):
    """Knots (times, T, q) of one chunk of a motion."""
    times = t_start + np.arange(steps) / fps
    return times, *knots_of(motion(times))


def wild_knots(rng, steps=50, fps=30.0):
    """Knots anywhere in a metre, turned anyhow: 30 m/s and 50 rad/s between neighbours."""
    T = np.tile(np.eye(4), (steps, 1, 1))
    T[:, :3, 3] = rng.uniform(-0.5, 0.5, (steps, 3))
    T[:, :3, :3] = Rotation.random(steps, random_state=rng).as_matrix()
    return np.arange(steps) / fps, T, rng.uniform(-1.5, 1.5, (steps, 7))


def angle_between(quat_a, quat_b):
    """Angle [rad] between rotations given as quaternions (n, 4)."""
    return (Rotation.from_quat(quat_a).inv() * Rotation.from_quat(quat_b)).magnitude()
