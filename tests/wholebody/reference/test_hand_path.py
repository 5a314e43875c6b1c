"""Hand paths. Derivatives by central differences; C2 at knots, joins, start and stop; accuracy on the lissajous."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from tests.support.reference_motions import angle_between, chunk, knots_of, lissajous_rows, row_at, wild_knots
from wholebody.errors import InputError
from wholebody.reference import HandMotion, HandPath, rest_row
from wholebody.reference.hand_path import CELL_WIDTH
from wholebody.reference.join import PATIENCE
from wholebody.reference.kernels.path import path_row

H = 1e-5
GRID = np.linspace(-0.4, 2.2, 2601) + 0.3e-3


def lissajous_path(t_start=0.0):
    return HandPath.from_knots(*chunk(t_start))


def wild_path(seed=0):
    return HandPath.from_knots(*wild_knots(np.random.default_rng(seed)))


def joined_path():
    return lissajous_path(0.5).joined(HandMotion(lissajous_rows(0.3)[0]), 0.9)


def jump(path, s):
    """Largest jump of value, velocity and acceleration across ``s``, by extrapolating both sides to it."""
    a, b = path.sample(s - 1e-9), path.sample(s + 1e-9)
    return (
        np.abs(a.p - b.p + 2e-9 * a.v).max(),
        np.abs(np.concatenate([a.v - b.v, a.w - b.w, a.dq_finger - b.dq_finger])).max(),
        np.abs(np.concatenate([a.a - b.a, a.alpha - b.alpha, a.ddq_finger - b.ddq_finger])).max(),
    )


@pytest.mark.parametrize("path", [lissajous_path(), joined_path(), wild_path()], ids=["smooth", "joined", "wild"])
def test_every_derivative_is_that_of_the_motion(path):
    a, m, b = path.sample(GRID - H), path.sample(GRID), path.sample(GRID + H)
    # Central differences are off by h^2/6 of the third derivative, and by h/4 of a jump in it.
    scale = max(1.0, max(np.abs(m.a).max(), np.abs(m.alpha).max()) / 50.0)
    np.testing.assert_allclose((b.p - a.p) / (2 * H), m.v, atol=1e-6 * scale)
    np.testing.assert_allclose((b.v - a.v) / (2 * H), m.a, atol=5e-3 * scale**2)
    turn = Rotation.from_quat(b.quat) * Rotation.from_quat(a.quat).inv()
    np.testing.assert_allclose(turn.as_rotvec() / (2 * H), m.w, atol=1e-6 * scale)
    np.testing.assert_allclose((b.w - a.w) / (2 * H), m.alpha, atol=5e-3 * scale**2)
    np.testing.assert_allclose((b.q_finger - a.q_finger) / (2 * H), m.dq_finger, atol=1e-6 * scale)
    np.testing.assert_allclose((b.dq_finger - a.dq_finger) / (2 * H), m.ddq_finger, atol=5e-3 * scale**2)


@pytest.mark.parametrize("path", [lissajous_path(), joined_path()], ids=["smooth", "joined"])
def test_position_velocity_and_acceleration_are_continuous_at_every_break(path):
    for s in path.curve.breaks:
        p, v, a = jump(path, s)
        assert p < 1e-9
        assert v < 1e-6
        assert a < 1e-4


def test_wild_knots_keep_the_path_twice_differentiable():
    path = wild_path()
    for s in path.curve.breaks:
        _, v, a = jump(path, s)
        assert v < 1e-4  # 2e-9 s at 6000 m/s^2, 20000 rad/s^2
        assert a < 1e-2


def test_knots_are_met_exactly():
    times, T, q = chunk(0.7)
    motion = HandPath.from_knots(times, T, q).sample(times)
    np.testing.assert_allclose(motion.T_world_hand, T, atol=1e-12)
    np.testing.assert_allclose(motion.q_finger, q, atol=1e-12)


@pytest.mark.parametrize("t_start", [0.0, 0.37, 1.1])
def test_lissajous_is_reproduced_between_its_knots(t_start):
    path = lissajous_path(t_start)
    s = np.linspace(path.start, path.end, 3000)
    motion, truth = path.sample(s), HandMotion(lissajous_rows(s))
    assert np.linalg.norm(motion.p - truth.p, axis=1).max() < 1e-5
    assert angle_between(motion.quat, truth.quat).max() < 1e-5
    assert np.abs(motion.q_finger - truth.q_finger).max() < 1e-5
    inner = slice(200, -200)
    assert np.linalg.norm(motion.v - truth.v, axis=1)[inner].max() < 1e-3
    assert np.linalg.norm(motion.a - truth.a, axis=1)[inner].max() < 0.05


def test_hand_starts_from_rest_and_brakes_to_rest_within_the_limits():
    path = lissajous_path()
    first, last = path.span
    assert path.start - first < 0.3
    assert last - path.end < 0.3
    rest = path.sample(np.array([first - 1.0, first, last, last + 1.0]))
    assert max(np.abs(rest.v).max(), np.abs(rest.w).max()) < 1e-9
    assert np.abs(rest.dq_finger).max() < 1e-9
    stop = path.sample(np.linspace(path.end, last, 200))
    limits = path.limits.position
    assert np.linalg.norm(stop.a, axis=1).max() <= limits.acceleration
    assert np.linalg.norm(np.diff(stop.a, axis=0), axis=1).max() / (last - path.end) * 199 <= limits.jerk
    assert np.linalg.norm(stop.p[-1] - stop.p[0]) < 0.15  # v T / 2


def test_a_hand_that_leaves_the_chunk_too_fast_stops_within_a_stride():
    times, T, q = chunk(0.0)
    T[:, 0, 3] = 4.0 * times  # above the cap, not wild
    path = HandPath.from_knots(times, T, q)
    assert path.outliers == ()
    assert path.sample(path.span[1]).p[0] - T[-1, 0, 3] < 0.55  # 2.5 m/s over 0.375 s, and the acceleration's share
    assert T[0, 0, 3] - path.sample(path.span[0]).p[0] < 0.55


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_short_chunks_make_paths(count):
    times, T, q = chunk(0.2, steps=count)
    motion = HandPath.from_knots(times, T, q).sample(np.append(times, 99.0))
    np.testing.assert_allclose(motion.p[:-1], T[:, :3, 3], atol=1e-12)
    assert np.isfinite(motion.rows).all()


@settings(max_examples=30)
@given(st.integers(0, 10**6))
def test_wild_knots_do_not_overshoot(seed):
    times, T, q = wild_knots(np.random.default_rng(seed))
    path = HandPath.from_knots(times, T, q)
    assert len(path.outliers) > 40
    motion = path.sample(np.linspace(-1.0, 3.0, 4001))
    assert np.isfinite(motion.rows).all()
    assert np.all(motion.p <= T[:, :3, 3].max(axis=0) + 0.01)
    assert np.all(motion.p >= T[:, :3, 3].min(axis=0) - 0.01)
    assert np.all(np.abs(motion.q_finger) <= np.abs(q).max() + 0.01)
    assert np.linalg.norm(motion.w, axis=1).max() < 500.0


def test_one_outlier_disturbs_only_its_neighbours():
    times, T, q = chunk(0.0)
    T[25, :3, 3] += [0.0, 1.0, 0.0]
    path = HandPath.from_knots(times, T, q)
    assert path.outliers == (24, 25, 26)
    s = np.concatenate([np.linspace(0.0, times[22], 500), np.linspace(times[28], times[-1], 500)])
    assert np.linalg.norm(path.sample(s).p - lissajous_rows(s)[:, :3], axis=1).max() < 1e-3
    assert path.sample(np.linspace(0, 1.6, 2000)).p[:, 1].max() < T[25, 1, 3] + 1e-6


def test_a_turn_by_180_degrees_between_two_knots_stays_finite():
    T = np.tile(np.eye(4), (4, 1, 1))
    T[2:, :3, :3] = np.diag([1.0, -1.0, -1.0])
    motion = HandPath.from_knots(np.arange(4) / 30.0, T, np.zeros((4, 7))).sample(np.linspace(-1, 1, 2001))
    assert np.isfinite(motion.rows).all()
    np.testing.assert_allclose(np.linalg.norm(motion.quat, axis=1), 1.0, atol=1e-12)
    assert np.linalg.norm(motion.w, axis=1).max() < 300.0


def test_a_smooth_motion_in_replaced_chunks_loses_nothing():
    rng = np.random.default_rng(1)
    path, s = lissajous_path(0.0), 0.0
    for seq in range(1, 8):
        until = seq * 25 / 30 + rng.uniform(0.0, 0.3)
        grid = np.linspace(s, until, 400)
        assert np.linalg.norm(path.sample(grid).p - lissajous_rows(grid)[:, :3], axis=1).max() < 1e-5
        assert angle_between(path.sample(grid).quat, lissajous_rows(grid)[:, 9:13]).max() < 1e-5
        path = lissajous_path(seq * 25 / 30).joined(path.sample(until), until)
        assert path.join.distance < 1e-5
        assert path.join.duration == pytest.approx(0.1)
        s = until


@settings(max_examples=25)
@given(st.integers(0, 10**6), st.floats(-1.0, 3.0))
def test_a_join_begins_with_the_commanded_motion_and_ends_on_the_path(seed, s):
    rng = np.random.default_rng(seed)
    own = lissajous_path(0.0)
    row = lissajous_rows(rng.uniform(0.0, 9.0), turn=2.5, fingers=1.0)[0]
    row[9:13] *= rng.choice([-1.0, 1.0])
    path = own.joined(HandMotion(row), s)
    begin = path.sample(s)
    assert angle_between(begin.quat[None], row[None, 9:13])[0] < 1e-7
    without_quat = np.r_[0:9, 13:40]
    np.testing.assert_allclose(begin.rows[without_quat], row[without_quat], atol=1e-9)
    after = np.linspace(s + path.join.duration, s + path.join.duration + 1.0, 50)
    got, expected = path.sample(after), own.sample(after)
    np.testing.assert_allclose(got.rows[:, without_quat], expected.rows[:, without_quat], atol=1e-7)
    assert angle_between(got.quat, expected.quat).max() < 1e-7


def test_the_sign_of_the_commanded_quaternion_changes_nothing():
    own = lissajous_path(0.0)
    row = own.sample(0.6).rows
    flipped = row.copy()
    flipped[9:13] *= -1.0
    s = np.linspace(0.6, 1.6, 200)
    a, b = (own.joined(HandMotion(r), 0.6).sample(s) for r in (row, flipped))
    np.testing.assert_allclose(a.w, b.w, atol=1e-9)
    assert angle_between(b.quat, own.sample(s).quat).max() < 1e-6


def test_a_join_from_rest_keeps_to_its_share_of_the_limits():
    times, T, q = chunk(0.0)
    T[:, :3, 3] = T[0, :3, 3]
    path = HandPath.from_knots(times, T, q).joined(HandMotion(rest_row(np.eye(4))), 0.1)
    motion = path.sample(np.linspace(0.1, 2.0, 2000))
    limits = path.limits.position
    assert np.linalg.norm(motion.v, axis=1).max() <= 0.26 * limits.speed
    assert np.linalg.norm(motion.a, axis=1).max() <= 0.26 * limits.acceleration
    assert path.join.distance == pytest.approx(np.linalg.norm(T[0, :3, 3]))
    assert path.join.duration < 3.3


def test_a_join_across_180_degrees_stays_finite_and_unit():
    row = lissajous_rows(0.0)[0]
    row[9:13] = [1.0, 0.0, 0.0, 0.0]
    path = HandPath.from_knots(*chunk(0.0)).joined(HandMotion(row), 0.0)
    motion = path.sample(np.linspace(0.0, 1.5, 1500))
    assert np.linalg.norm(motion.w, axis=1).max() < 12.0
    assert path.join.angle == pytest.approx(np.pi, abs=1e-6)


@pytest.mark.parametrize("path", [lissajous_path(), joined_path(), wild_path()], ids=["smooth", "joined", "wild"])
def test_look_up_is_the_sample(path):
    first, last = path.span
    points = np.concatenate([np.linspace(first - 0.5, last + 0.5, 400), path.curve.breaks])
    expected, row = path.sample(points).rows, np.empty(40)
    for s, truth in zip(points, expected, strict=True):
        scale = np.maximum(1.0, np.abs(truth))
        found = row_at(path, s)
        assert np.max(np.abs(found - truth) / scale) < 1e-9
        path_row(path.flat, s, row)
        assert np.max(np.abs(found - row) / scale) < 1e-12


def test_look_up_passes_few_breaks():
    path = joined_path()
    cells = path.flat[5 : 5 + int(path.flat[4])].astype(int)
    assert len(cells) == int(np.ceil((path.span[1] - path.span[0]) / CELL_WIDTH))
    assert np.all(np.diff(cells) >= 0)


def test_broken_knots_are_refused_with_their_index():
    times, T, q = chunk(0.0)
    with pytest.raises(InputError, match=r"q_hand has shape \(49, 7\); \(50, 7\)"):
        HandPath.from_knots(times, T, q[:-1])
    with pytest.raises(InputError, match=r"times\[3\]"):
        HandPath.from_knots(np.r_[times[:3], times[2], times[4:]], T, q)
    broken = T.copy()
    broken[7, 0, 3] = np.nan
    with pytest.raises(InputError, match="not finite at knot 7"):
        HandPath.from_knots(times, broken, q)
    mirrored = T.copy()
    mirrored[4, :3, 0] *= -1.0
    with pytest.raises(InputError, match=r"T_world_hand\[4\] has no rotation"):
        HandPath.from_knots(times, mirrored, q)
    with pytest.raises(InputError, match="times has shape"):
        HandPath.from_knots(times[:0], T[:0], q[:0])
    with pytest.raises(InputError, match="finite row"):
        HandPath.from_knots(times, T, q).joined(HandMotion(np.full(40, np.nan)), 0.0)


def test_poses_come_back_as_matrices():
    rows = lissajous_rows(np.linspace(0, 1, 5))
    T, q = knots_of(rows)
    np.testing.assert_allclose(HandMotion(rows).T_world_hand, T, atol=1e-12)
    np.testing.assert_allclose(rest_row(T[1], q[1])[:3], rows[1, :3])


def test_a_moved_path_goes_through_the_poses_and_keeps_what_happens_between_them():
    path = joined_path()
    steps = np.linspace(0.9, 2.0, 12)
    here = path.sample(steps)
    T = np.stack([motion.T_world_hand for motion in map(HandMotion, here.rows)])
    T[:, :3, 3] += np.linspace(0.0, 0.05, 12)[:, None] * [1.0, 0.0, -0.5]
    T[:, :3, :3] = Rotation.from_rotvec(np.linspace(0.0, 0.2, 12)[:, None] * [0.0, 1.0, 0.0]).as_matrix() @ T[:, :3, :3]
    moved = path.moved(steps, T)
    np.testing.assert_allclose(moved.sample(steps).T_world_hand, T, atol=1e-9)
    start, own = moved.sample(np.array([0.9])), path.sample(np.array([0.9]))
    np.testing.assert_allclose(start.rows, own.rows, atol=1e-9)
    between = np.linspace(1.2, 1.9, 500)
    change = moved.sample(between).p - path.sample(between).p
    np.testing.assert_allclose(change[:, 0], 0.05 * (between - 0.9) / 1.1, atol=1e-3)
    for s in moved.curve.breaks:
        assert max(jump(moved, s)[:2]) < 1e-6


def test_a_path_moved_nowhere_is_itself():
    path = wild_path()
    steps = np.linspace(0.0, 1.5, 9)
    moved = path.moved(steps, path.sample(steps).T_world_hand)
    between = np.linspace(0.0, 1.5, 300)
    np.testing.assert_allclose(moved.sample(between).rows[:, :3], path.sample(between).rows[:, :3], atol=1e-9)


@pytest.mark.parametrize("distance", [0.2, 0.4, 0.6, 0.8, 1.2])
def test_a_gentle_join_takes_longer_but_not_past_patience_unless_any_join_does(distance):
    T = np.tile(np.eye(4), (50, 1, 1))
    T[:, 2, 3] = distance
    path = HandPath.from_knots(np.arange(50) / 30.0, T, np.zeros((50, 7)))
    here = HandMotion(rest_row(np.eye(4)))
    usual, gentle = (path.joined(here, 0.0, limits=path.limits.scaled(x)).join.duration for x in (1.0, 0.6))
    assert usual <= gentle <= max(PATIENCE, usual)
    assert gentle > usual or usual >= PATIENCE


@pytest.mark.parametrize("share", [1.0, 0.6])
@pytest.mark.parametrize("way", [[0.25, 0.0, 0.3375], [0.1, 0.0, 0.15], [0.5, 0.5, 0.5]])
@pytest.mark.parametrize("every", [1.0 / 30.0, 0.1, 0.25, 0.5])
def test_a_way_that_begins_anew_again_and_again_takes_hardly_longer_than_one_that_does_not(way, every, share):
    times, T = np.arange(150) / 30.0, np.tile(np.eye(4), (150, 1, 1))
    T[:, :3, 3] = way
    path = HandPath.from_knots(times, T, np.zeros((150, 7)))
    limits = path.limits.scaled(share)
    once = path.joined(HandMotion(rest_row(np.eye(4))), 0.0, limits=limits)
    s, again, left = 0.0, once, np.linalg.norm(way)
    while left > 5e-3 and s < 4.9:
        s += every
        here = HandMotion(again.sample(np.array([s])).rows[0])
        again, left = path.joined(here, s, limits=limits), np.linalg.norm(here.p - way)
    alone = np.linalg.norm(once.sample(times).p - way, axis=1)
    assert s <= 1.1 * times[alone <= 5e-3][0] + every


def test_a_motion_away_from_a_path_is_given_up_at_once():
    """One correction of place and velocity together would lead it on in the wrong direction for longer."""
    times, T = np.arange(90) / 30.0, np.tile(np.eye(4), (90, 1, 1))
    T[:, 0, 3] = 0.3
    row = rest_row(np.eye(4))
    row[3] = -1.0
    path = HandPath.from_knots(times, T, np.zeros((90, 7))).joined(HandMotion(row), 0.0)
    assert path.sample(np.linspace(0.0, 3.0, 301)).p[:, 0].min() > -0.15
