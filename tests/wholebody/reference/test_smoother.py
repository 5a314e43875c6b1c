"""Smoother. Strategy: the compiled and the interpreted arithmetic are the same function; limits are checked on every
tick of long runs with anything as target; tracking is checked against motions whose derivatives are known.
"""

import subprocess
import sys
from dataclasses import astuple

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.support.reference_motions import angle_between, chunk, lissajous_rows, row_at, step, wild_knots
from wholebody.errors import InputError
from wholebody.reference import HandLimits, HandMotion, HandPath, MotionLimits, ReferenceSmoother, rest_row, time_scaled
from wholebody.reference.kernels.path_clock import advanced
from wholebody.reference.kernels.smoother import smoother_step
from wholebody.reference.layout import ALPHA, DDQ_FINGER, DQ_FINGER, Q_FINGER, QUAT, ROW, A, P, V, W

DT = 0.002
RANGE = HandLimits(finger_lower=(-1.5,) * 7, finger_upper=(1.5,) * 7)
REST = rest_row(np.eye(4))


def run(smoother, targets, dt=DT):
    """Commanded rows (ticks + 1, hands, 40), the start included."""
    rows = [smoother.motion.rows.copy()]
    for target in targets:
        rows.append(step(smoother, np.atleast_2d(target), dt).rows.copy())
    return np.array(rows)


def excess(rows, limits, dt=DT):
    """Largest ratio to its limit of speed, acceleration and jerk of position, orientation and fingers."""
    worst = 0.0
    for first, second, limit in (
        (V, A, limits.position),
        (W, ALPHA, limits.orientation),
        (DQ_FINGER, DDQ_FINGER, limits.finger),
    ):
        changes = (rows[..., first], rows[..., second], np.diff(rows[..., second], axis=0) / dt)
        for change, bound in zip(changes, astuple(limit), strict=True):
            size = np.abs(change) if limit is limits.finger else np.linalg.norm(change, axis=-1)
            worst = max(worst, size.max() / bound)
    return worst


def assert_consistent(rows, dt=DT):
    """Every tick is one of constant jerk: position and velocity follow from the accelerations."""
    before, after = rows[:-1], rows[1:]
    for x, v, a in ((P, V, A), (Q_FINGER, DQ_FINGER, DDQ_FINGER)):
        jerk = (after[..., a] - before[..., a]) / dt
        speed = before[..., v] + dt * before[..., a] + 0.5 * dt**2 * jerk
        place = before[..., x] + dt * before[..., v] + 0.5 * dt**2 * before[..., a] + dt**3 / 6 * jerk
        np.testing.assert_allclose(after[..., v], speed, atol=1e-10)
        np.testing.assert_allclose(after[..., x], place, atol=1e-10)
    w, alpha = before[..., W], before[..., ALPHA]
    mean = 0.5 * (w + after[..., W]) - dt / 12 * (after[..., ALPHA] - alpha) + dt**2 / 12 * np.cross(alpha, w)
    old, new = (Rotation.from_quat(rows[..., QUAT].reshape(-1, 4)) for rows in (before, after))
    np.testing.assert_allclose((new * old.inv()).as_rotvec() / dt, mean.reshape(-1, 3), atol=1e-5)


def wild_targets(rng, ticks, hands, hold):
    """Targets that jump with probability ``1 / hold`` a tick: some consistent, some absurd, some not finite."""
    jumps = rng.random(ticks) < 1.0 / hold
    count = int(jumps.sum())

    def scaled(width, *scales):
        return rng.normal(size=(count, hands, width)) * rng.choice(scales, (count, 1, 1))

    new = np.zeros((count, hands, ROW))
    new[..., P] = scaled(3, 0.01, 0.3, 1.0, 10.0)
    new[..., V.start : A.stop] = scaled(6, 0.0, 1.0, 30.0)
    new[..., QUAT] = Rotation.random(count * hands, random_state=rng).as_quat().reshape(count, hands, 4)
    new[..., QUAT] *= rng.choice([-1.0, 1.0], (count, hands, 1))
    new[..., W.start : ALPHA.stop] = scaled(6, 0.0, 10.0, 300.0)
    new[..., Q_FINGER] = scaled(7, 0.5, 5.0)
    new[..., DQ_FINGER.start :] = scaled(14, 0.0, 3.0, 100.0)
    broken = np.flatnonzero(rng.random(count) < 0.1)
    spoilt = rng.choice([np.nan, np.inf, -np.inf], len(broken))
    new[broken, rng.integers(hands, size=len(broken)), rng.integers(ROW, size=len(broken))] = spoilt
    return np.concatenate([np.tile(REST, (1, hands, 1)), new])[np.cumsum(jumps)]


@pytest.mark.parametrize(("seed", "hold"), [(0, 1), (1, 1), (2, 20), (3, 20), (4, 300)])
def test_caps_hold_at_every_one_of_20000_ticks_with_wild_targets(seed, hold):
    smoother = ReferenceSmoother(np.tile(REST, (2, 1)), RANGE)
    rows = run(smoother, wild_targets(np.random.default_rng(seed), 20_000, 2, hold))
    assert np.isfinite(rows).all()
    assert excess(rows, RANGE) <= 1.0 + 1e-9
    assert np.abs(rows[..., Q_FINGER]).max() <= 1.5 + 1e-9
    assert_consistent(rows)


@pytest.mark.parametrize("dt", [0.0005, 0.001, 0.004, 0.01, 0.02])
def test_caps_hold_at_other_rates(dt):
    smoother = ReferenceSmoother(np.tile(REST, (2, 1)), RANGE)
    rows = run(smoother, wild_targets(np.random.default_rng(7), 2000, 2, 10), dt)
    assert np.isfinite(rows).all()
    assert excess(rows, RANGE, dt) <= 1.0 + 1e-9
    assert np.abs(rows[..., Q_FINGER]).max() <= 1.5 + 1e-9


def test_caps_hold_for_unusual_caps():
    limits = HandLimits(
        position=MotionLimits(0.2, 0.5, 2.0),
        orientation=MotionLimits(30.0, 20.0, 5000.0),
        finger=MotionLimits(1.0, 100.0, 50.0),
    )
    smoother = ReferenceSmoother(np.tile(REST, (2, 1)), limits)
    rows = run(smoother, wild_targets(np.random.default_rng(8), 5000, 2, 100))
    assert excess(rows, limits) <= 1.0 + 1e-9


def test_after_any_wildness_a_constant_target_is_reached():
    smoother = ReferenceSmoother(np.tile(REST, (2, 1)), RANGE)
    rng = np.random.default_rng(9)
    for _ in range(10):
        run(smoother, wild_targets(rng, 500, 2, 5))
        goal = np.tile(REST, (2, 1))
        goal[:, P] = rng.uniform(-1.0, 1.0, (2, 3))
        goal[:, QUAT] = Rotation.random(2, random_state=rng).as_quat()
        goal[:, Q_FINGER] = rng.uniform(-1.5, 1.5, (2, 7))
        rows = run(smoother, [goal] * 2500)
        np.testing.assert_allclose(rows[-1][:, P], goal[:, P], atol=1e-9)
        assert angle_between(rows[-1][:, QUAT], goal[:, QUAT]).max() < 1e-7
        np.testing.assert_allclose(rows[-1][:, Q_FINGER], goal[:, Q_FINGER], atol=1e-9)


@pytest.mark.parametrize("step", [1e-4, 1e-3, 0.01, 0.1, 0.3, 1.0, 3.0])
def test_a_step_overshoots_by_less_than_two_percent(step):
    goal = REST.copy()
    direction = np.array([1.0, -2.0, 2.0]) / 3.0
    goal[P] = step * direction
    rows = run(ReferenceSmoother(REST[None]), [goal] * 2500)[:, 0]
    along = rows[:, P] @ direction
    assert along.max() <= 1.02 * step
    assert np.abs(rows[:, P] - np.outer(along, direction)).max() < 1e-9
    assert along[-1] == pytest.approx(step, rel=1e-9)
    assert excess(rows, HandLimits()) <= 1.0


def test_a_step_of_one_metre_settles_within_seven_tenths_of_a_second():
    goal = REST.copy()
    goal[0] = 1.0
    rows = run(ReferenceSmoother(REST[None]), [goal] * 500)[:, 0]
    assert np.flatnonzero(np.abs(rows[:, 0] - 1.0) > 0.01)[-1] * DT < 0.7
    assert rows[:, 0].max() < 1.001


def test_a_target_far_away_is_approached_near_the_speed_cap():
    goal = REST.copy()
    goal[0] = 10.0
    rows = run(ReferenceSmoother(REST[None]), [goal] * 2600)[:, 0]
    assert np.all(rows[250:1700, 3] > 0.85 * 2.5)
    assert np.flatnonzero(np.abs(rows[:, 0] - 10.0) > 0.01)[-1] * DT < 5.0
    assert rows[:, 0].max() < 10.01


def test_a_far_target_that_moves_across_is_met_without_overshoot():
    t = DT * np.arange(1, 1600)
    targets = np.tile(REST, (len(t), 1))
    targets[:, 0], targets[:, 1], targets[:, 4] = 3.0, 1.5 * t, 1.5
    rows = run(ReferenceSmoother(REST[None]), targets)[1:, 0]
    assert rows[:, 0].max() < 3.001
    assert np.linalg.norm(rows[:, P] - targets[:, P], axis=1)[1050:].max() < 0.01


def test_noise_as_target_does_not_drive_the_hand_away():
    rng = np.random.default_rng(14)
    targets = np.tile(REST, (10_000, 1))
    targets[:, P] = rng.normal(size=(10_000, 3)) * 0.3
    targets[:, V.start : A.stop] = rng.normal(size=(10_000, 6)) * 30.0
    targets[:, Q_FINGER] = rng.normal(size=(10_000, 7)) * 0.3
    targets[:, DQ_FINGER.start :] = rng.normal(size=(10_000, 14)) * 100.0
    rows = run(ReferenceSmoother(REST[None]), targets)
    assert np.abs(rows[..., P]).max() < 1.0
    assert np.abs(rows[..., Q_FINGER]).max() < 3.0


def test_a_fast_turn_that_changes_its_axis_at_once_is_caught_up_with():
    """From the largest acceleration on the smoother took 0.65 s to go, and 0.4 s to come within 2 degrees again."""
    w = np.array([0.0, 0.0, -8.0])
    alpha = np.zeros((250, 3))
    alpha[50:54] = [375.0, 0.0, 0.0]  # 3 rad/s more within 8 ms; the limit is 400 rad/s^2
    targets, R = np.tile(REST, (250, 1)), Rotation.identity()
    for row, change in zip(targets, alpha, strict=True):
        R = Rotation.from_rotvec(DT * w + 0.5 * DT**2 * change) * R
        w = w + DT * change
        row[QUAT], row[W], row[ALPHA] = R.as_quat(), w, change
    rows = run(ReferenceSmoother(targets[:1], HandLimits().outer), targets[1:])[1:, 0]
    lag = np.degrees((Rotation.from_quat(rows[:, QUAT]) * Rotation.from_quat(targets[1:, QUAT]).inv()).magnitude())
    assert lag.max() < 4.0
    assert lag[80:].max() < 1.0  # 60 ms later


@pytest.mark.parametrize("angle", [1e-3, 0.1, 1.0, 3.0, np.pi])
def test_a_turn_overshoots_by_less_than_two_percent(angle):
    goal = REST.copy()
    axis = np.array([2.0, 2.0, -1.0]) / 3.0
    goal[QUAT] = -Rotation.from_rotvec(angle * axis).as_quat()
    rows = run(ReferenceSmoother(REST[None]), [goal] * 1500)[:, 0]
    turned = np.unwrap(2.0 * np.arctan2(rows[:, QUAT][:, :3] @ axis, rows[:, QUAT][:, 3]))
    assert np.abs(turned).max() <= 1.02 * angle
    assert angle_between(rows[-1:, QUAT], goal[None, QUAT])[0] < 1e-7
    assert excess(rows, HandLimits()) <= 1.0


def test_a_sign_flip_of_the_quaternion_changes_nothing():
    t = DT * np.arange(1, 800)
    targets = lissajous_rows(t)
    flipped = targets.copy()
    flipped[::3, QUAT] *= -1.0
    start = lissajous_rows(0.0)
    np.testing.assert_allclose(
        run(ReferenceSmoother(start), flipped), run(ReferenceSmoother(start), targets), atol=1e-12
    )


@pytest.mark.parametrize("dt", [0.001, 0.002, 0.004])
def test_the_lissajous_is_followed_without_lag(dt):
    t = dt * np.arange(1, int(4.0 / dt))
    truth = lissajous_rows(t)
    smoother = ReferenceSmoother(lissajous_rows(0.0))
    rows = run(smoother, truth, dt)[1:, 0]
    assert np.linalg.norm(rows[:, P] - truth[:, P], axis=1).max() < 1e-6
    assert np.linalg.norm(rows[:, V] - truth[:, V], axis=1).max() < 1e-4
    assert np.linalg.norm(rows[:, A] - truth[:, A], axis=1).max() < 1e-2
    assert angle_between(rows[:, QUAT], truth[:, QUAT]).max() < 1e-6
    assert np.abs(rows[:, Q_FINGER] - truth[:, Q_FINGER]).max() < 1e-6


def test_a_circle_just_inside_the_caps_is_followed_without_lag():
    t = DT * np.arange(2000)
    rows = np.tile(REST, (2000, 1))
    for row, phase in ((0, 0.0), (1, -np.pi / 2)):
        rows[:, row] = 0.22 * np.cos(9 * t + phase)
        rows[:, 3 + row] = -0.22 * 9 * np.sin(9 * t + phase)
        rows[:, 6 + row] = -0.22 * 81 * np.cos(9 * t + phase)  # 2.0 m/s, 17.8 m/s^2, 160 m/s^3
    got = run(ReferenceSmoother(rows[:1]), rows[1:])[:, 0]
    assert np.linalg.norm(got[:, P] - rows[:, P], axis=1).max() < 1e-6


def test_a_lissajous_in_replaced_chunks_is_followed_to_a_hundredth_of_a_millimetre():
    path = HandPath.from_knots(*chunk(0.0))
    smoother = ReferenceSmoother(row_at(path, 0.1)[None])
    seq, rows, t = 1, [], 0.1 + DT
    while t < 5.0:
        if t > seq * 25 / 30 + 0.12:
            path = HandPath.from_knots(*chunk(seq * 25 / 30)).joined(path.sample(t - DT), t - DT)
            seq += 1
        step(smoother, row_at(path, t)[None], DT)
        rows.append((t, smoother.motion.rows[0].copy()))
        t += DT
    times, rows = np.array([r[0] for r in rows]), np.array([r[1] for r in rows])
    truth = lissajous_rows(times)
    assert np.linalg.norm(rows[:, P] - truth[:, P], axis=1).max() < 1e-5
    assert np.linalg.norm(rows[:, V] - truth[:, V], axis=1).max() < 2e-3
    assert angle_between(rows[:, QUAT], truth[:, QUAT]).max() < 1e-5


def test_a_path_slowed_along_itself_is_followed_without_leaving_it():
    path, (s, rate, change) = HandPath.from_knots(*chunk(0.0)), (0.2, 1.0, 0.0)
    smoother = ReferenceSmoother(row_at(path, 0.2)[None])
    for k in range(900):
        s, rate, change = advanced(s, rate, change, DT, 0.0 if 100 < k < 300 else 0.6)
        target = time_scaled(HandMotion(row_at(path, s)), rate, change)
        motion = step(smoother, target.rows[None], DT)
        assert np.linalg.norm(motion.p[0] - target.p) < 1e-5
        assert np.linalg.norm(motion.p[0] - lissajous_rows(s)[0, P]) < 3e-5


def test_wild_chunks_replaced_at_any_time_stay_inside_the_caps():
    rng = np.random.default_rng(4)
    smoother, rows = ReferenceSmoother(REST[None], RANGE), []
    for _ in range(12):
        path = HandPath.from_knots(*wild_knots(rng), limits=RANGE)
        if rng.random() < 0.5:
            path = path.joined(HandMotion(smoother.motion.rows[0].copy()), 0.0)
        s = DT * np.arange(1, rng.integers(50, 1000))
        rows.append(run(smoother, path.sample(s).rows)[1:])
    rows = np.concatenate(rows)
    assert excess(rows, RANGE) <= 1.0 + 1e-9
    assert_consistent(rows)


def test_a_target_beyond_the_caps_is_caught_when_it_slows_down():
    t = DT * np.arange(1, 1500)
    x = np.minimum(4.0 * t, 4.0)  # 4 m/s for a second, then it stands
    targets = np.tile(REST, (len(t), 1))
    targets[:, 0], targets[:, 3] = x, np.where(t < 1.0, 4.0, 0.0)
    rows = run(ReferenceSmoother(REST[None]), targets)[:, 0]
    assert excess(rows, HandLimits()) <= 1.0 + 1e-9
    assert rows[500, 0] > 1.9
    assert rows[:, 0].max() < 4.02
    assert rows[-1, 0] == pytest.approx(4.0, abs=1e-3)


def test_a_start_above_the_caps_comes_down_to_them():
    row = REST.copy()
    row[3:9] = [4.0, 0.0, 0.0, 30.0, 0.0, 0.0]
    goal = REST.copy()
    rows = run(ReferenceSmoother(row[None]), [goal] * 3000)[:, 0]
    speed = np.linalg.norm(rows[:, V], axis=1)
    assert speed.max() < 4.0 + 30.0**2 / (2 * 400.0) + 0.1
    assert np.all(speed[300:] <= 2.5)
    assert np.linalg.norm(rows[-1, P]) < 1e-6
    jerk = np.linalg.norm(np.diff(rows[:, A], axis=0), axis=1) / DT
    assert jerk.max() <= 400.0 * (1 + 1e-9)


@pytest.mark.parametrize("entry", [0, 5, 9, 14, 20, 39])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_target_that_is_not_finite_is_ignored(entry, value):
    targets = np.stack([lissajous_rows(DT * np.arange(1, 600))] * 2, axis=1)
    targets[300:, 1, entry] = value
    smoother = ReferenceSmoother(np.tile(lissajous_rows(0.0), (2, 1)))
    rows = run(smoother, targets)
    assert np.isfinite(rows).all()
    held = targets[299, 1]
    np.testing.assert_allclose(rows[-1, 1, P], held[P], atol=2e-3)
    assert np.linalg.norm(rows[-1, 0, P] - targets[-1, 0, P]) < 1e-6
    assert excess(rows, HandLimits()) <= 1.0 + 1e-9


def test_a_zero_quaternion_is_ignored():
    target = REST.copy()
    target[QUAT] = 0.0
    smoother = ReferenceSmoother(REST[None])
    step(smoother, target[None], DT)
    np.testing.assert_array_equal(smoother.motion.rows[0], REST)


def test_fingers_stop_at_their_limits():
    target = REST.copy()
    target[Q_FINGER] = 9.0
    smoother = ReferenceSmoother(REST[None], RANGE)
    rows = run(smoother, [target] * 500)[:, 0]
    assert rows[:, Q_FINGER].max() <= 1.5 + 1e-9
    np.testing.assert_allclose(rows[-1, Q_FINGER], 1.5, atol=1e-5)


def test_compiled_and_interpreted_arithmetic_agree():
    rng = np.random.default_rng(11)
    fast = ReferenceSmoother(np.tile(REST, (2, 1)), RANGE)
    slow = ReferenceSmoother(np.tile(REST, (2, 1)), RANGE)
    targets = np.concatenate(
        [wild_targets(rng, 600, 2, 15), np.stack([lissajous_rows(DT * np.arange(300))] * 2, axis=1)]
    )
    for k, target in enumerate(targets):
        if k % 6 == 0:
            slow.state = fast.state.copy()
        step(fast, target, DT)
        if k % 6 == 0:
            smoother_step(slow.state, target, slow.limits, DT)
            for name in ("motion", "target_acceleration", "time_to_go", "held"):
                scale = np.maximum(1.0, np.abs(slow.state[name]))
                np.testing.assert_allclose(fast.state[name] / scale, slow.state[name] / scale, atol=1e-12, rtol=0.0)


def test_state_is_everything():
    targets = wild_targets(np.random.default_rng(12), 400, 1, 20)
    smoother = ReferenceSmoother(REST[None])
    run(smoother, targets[:200])
    kept = smoother.state.copy()
    first = run(smoother, targets[200:])
    smoother.state = kept
    np.testing.assert_array_equal(run(smoother, targets[200:]), first)


def test_reset_starts_from_the_given_motion():
    smoother = ReferenceSmoother(REST[None])
    run(smoother, wild_targets(np.random.default_rng(13), 50, 1, 10))
    smoother.reset(lissajous_rows(1.0))
    np.testing.assert_array_equal(smoother.motion.rows, lissajous_rows(1.0))
    with pytest.raises(InputError, match="2 rows; 1"):
        smoother.reset(lissajous_rows([1.0, 2.0]))


def test_misuse_is_refused():
    with pytest.raises(InputError, match=r"rows have shape \(40,\)"):
        ReferenceSmoother(REST)
    with pytest.raises(InputError, match="unit length"):
        ReferenceSmoother(np.zeros((1, ROW)))
    with pytest.raises(InputError, match="limits for 3 hands; 2"):
        ReferenceSmoother(np.tile(REST, (2, 1)), [HandLimits()] * 3)
    with pytest.raises(InputError, match="jerk limit is 0"):
        MotionLimits(1.0, 1.0, 0.0)
    with pytest.raises(InputError, match="finger joint 2: lower limit"):
        HandLimits(finger_lower=(0.0, 0.0, 5.0, 0.0, 0.0, 0.0, 0.0), finger_upper=(1.0,) * 7)
    with pytest.raises(InputError, match=r"\(3,\) and \(7,\)"):
        HandLimits(finger_lower=(0.0, 0.0, 0.0))


def test_caps_scale_without_the_range():
    limits = RANGE.scaled(0.5)
    assert astuple(limits.position) == (1.25, 10.0, 200.0)
    assert limits.finger_upper == RANGE.finger_upper


def test_importing_the_package_loads_neither_llvm_nor_scipy():
    code = "import sys, wholebody.reference; sys.exit('llvmlite' in sys.modules or 'scipy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
