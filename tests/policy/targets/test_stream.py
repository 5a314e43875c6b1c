"""Strategy: targets of a known motion go in, chunks are compared with it; what is wrong is refused by name."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from policy.action_spec.anchor import Anchor
from policy.action_spec.builtin import builtin
from policy.action_spec.codec import encode
from policy.clock import SimulatedClock
from policy.errors import ChunkError
from policy.prefix import Prefix, PrefixPolicy
from policy.targets.stream import FPS, HORIZON, TargetStream
from policy.targets.tracks import FREE, LATE, STOP, WRIST

HERE = Anchor.nominal()


def pose(x, turn=0.0):
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = Rotation.from_rotvec([0.0, 0.0, turn]).as_matrix(), [0.3 + x, 0.2, 0.9]
    return T


def followed(motion, until, rate=30.0, stream=None):
    """A stream that was told the left wrist of a motion (x, turn) at its times, and its last chunk."""
    stream, times = stream or TargetStream(), np.arange(0.0, until + 1e-9, 1.0 / rate)
    for time in times:
        stream.put(time, lhand=pose(*motion(time)))
    return stream, stream.infer(HERE.observation(times[-1]))


def test_it_is_a_policy_that_continues_what_is_executed():
    assert isinstance(TargetStream(), PrefixPolicy)


@pytest.mark.parametrize(("rate", "within"), [(10.0, 8e-3), (30.0, 5e-3), (100.0, 5e-3)])
def test_a_motion_that_bends_is_foretold_as_far_as_it_is_followed(rate, within):
    """Standing still is 65 mm off by then, and going straight on 4."""

    def motion(t):
        return 0.4 * t - 0.1 * t * t, 0.5 * t + 0.3 * t * t

    _, chunk = followed(motion, 1.0, rate)
    np.testing.assert_allclose(chunk.T_world_lhand[0], pose(*motion(1.0)), atol=3e-4)
    want = pose(*motion(chunk.times[int(FREE * FPS)]))
    assert np.abs(chunk.T_world_lhand[int(FREE * FPS)] - want)[0, 3] < within


def test_a_chunk_is_valid_and_comes_to_rest_within_it():
    _, chunk = followed(lambda t: (0.8 * t, 2.0 * t), 0.5)
    chunk.validate()
    assert len(chunk) == HORIZON
    assert HORIZON / FPS > FREE + STOP
    np.testing.assert_allclose(chunk.T_world_lhand[-1], chunk.T_world_lhand[-2], atol=1e-4)


def test_no_target_goes_on_further_than_said():
    _, chunk = followed(lambda t: (2.4 * t, 11.0 * t), 0.5)
    far, turned = WRIST[0][1], WRIST[1][1]
    assert chunk.T_world_lhand[-1, 0, 3] - 0.3 - 0.5 * 2.4 == pytest.approx(far, rel=1e-6)
    last = Rotation.from_matrix(chunk.T_world_lhand[0, :3, :3]).inv() * Rotation.from_matrix(
        chunk.T_world_lhand[-1, :3, :3]
    )
    assert last.magnitude() == pytest.approx(turned, rel=1e-3)


def test_targets_that_end_are_braked_where_they_were_going_and_held():
    stream, _ = followed(lambda t: (1.0 * t, 0.0), 1.0)
    late = LATE / 30.0
    at = [stream.infer(HERE.observation(1.0 + h)).T_world_lhand[0, 0, 3] - 0.3 for h in np.arange(0.0, 3.0, 0.01)]
    steps = np.diff(at)
    assert steps.min() > -1e-9
    assert steps.max() < 0.0105
    assert 0.5 * late < at[-1] - 1.0 < late + STOP / 2.0
    assert at[-1] == at[-100]


def test_a_target_that_is_repeated_for_a_minute_does_not_move():
    stream, _ = followed(lambda t: (0.1, 0.3), 60.0)
    chunk = stream.infer(HERE.observation(60.0))
    np.testing.assert_allclose(chunk.T_world_lhand, np.tile(pose(0.1, 0.3), (HORIZON, 1, 1)), atol=1e-12)


def test_a_target_that_jumps_is_no_motion():
    stream, _ = followed(lambda t: (0.4 if t > 0.49 else 0.0, 0.0), 0.5)
    chunk = stream.infer(HERE.observation(0.51))
    np.testing.assert_allclose(chunk.T_world_lhand[:, 0, 3], 0.7, atol=1e-12)


def test_what_is_not_said_stays_where_it_was_or_where_the_robot_had_it():
    stream = TargetStream()
    first = stream.infer(HERE.observation(0.0))
    np.testing.assert_allclose(first.T_world_rhand[0], HERE.T_world_base @ HERE.poses["rhand"], atol=1e-9)
    fingers = np.linspace(0.0, 0.3, 7)
    stream.put(0.02, q_rhand=fingers)
    stream.put(0.03, lhand=pose(0.1))
    moved = Anchor.nominal(pose(5.0))
    chunk = stream.infer(moved.observation(0.04))
    np.testing.assert_allclose(chunk.T_world_rhand, first.T_world_rhand, atol=1e-12)
    np.testing.assert_allclose(chunk.q_rhand[-1], fingers)
    np.testing.assert_allclose(chunk.T_world_lhand[-1], pose(0.1), atol=1e-12)


def test_actions_of_the_layout_say_the_same():
    stream = TargetStream()
    first = stream.infer(HERE.observation(0.0))
    action = encode(stream.spec, first, HERE)[0]
    stream.put_action(action, 0.1)
    np.testing.assert_allclose(
        stream.infer(HERE.observation(0.1)).T_world_lhand, first.T_world_lhand, atol=1e-6, err_msg="wrist"
    )


def test_stamps_of_another_clock_are_dated_by_the_least_delay():
    clock, rng = SimulatedClock(), np.random.default_rng(0)
    stream = TargetStream(clock=clock)
    for k in range(60):
        time = k / 30.0
        clock.set(time + (0.0 if k % 7 == 0 else rng.uniform(0.0, 0.02)))
        stream.put(1000.0 + time, lhand=pose(0.5 * time))
    chunk = stream.infer(HERE.observation(2.0))
    assert chunk.T_world_lhand[0, 0, 3] == pytest.approx(0.3 + 0.5 * 2.0, abs=1e-3)


@pytest.mark.parametrize(
    ("target", "said"),
    [
        ({"lhand": np.full((4, 4), np.nan)}, "lhand is nan"),
        ({"q_rhand": np.full(7, np.inf)}, "q_rhand is inf"),
        ({"rhand": 2.0 * np.eye(4)}, "rhand has no rotation"),
        ({"rhand": np.eye(3)}, "rhand has shape"),
        ({"f_lpalm": np.full(3, np.nan)}, "f_lpalm is nan"),
        ({"left": np.eye(4)}, "no 'left'; it may say lhand, rhand"),
        ({}, "says nothing"),
    ],
)
def test_what_is_wrong_is_refused_by_name_and_changes_nothing(target, said):
    stream, before = followed(lambda t: (0.2 * t, 0.0), 0.5)
    with pytest.raises(ChunkError, match=said):
        stream.put(0.6, **target)
    after = stream.infer(HERE.observation(before.t_obs))
    np.testing.assert_array_equal(after.T_world_lhand, before.T_world_lhand)


@pytest.mark.parametrize("stamp", [0.5, 0.1, np.nan, np.inf])
def test_a_stamp_that_is_late_repeated_or_none_is_refused(stamp):
    stream, _ = followed(lambda t: (0.2 * t, 0.0), 0.5)
    with pytest.raises(ChunkError, match="stamp"):
        stream.put(stamp, lhand=pose(0.0))
    stream.put(0.6, lhand=pose(0.12))


def test_a_force_stays_as_it_was_told_until_it_is_told_otherwise():
    stream, forces = TargetStream(), np.array([[0.0, 30.0, -5.0], [0.0, -30.0, -5.0]])
    stream.put(0.0, lhand=pose(0.0))
    assert stream.infer(HERE.observation(0.0)).f_world_lpalm is None
    stream.put(0.03, f_lpalm=forces[0])
    assert stream.news
    chunk = stream.infer(HERE.observation(5.0))
    np.testing.assert_array_equal(chunk.f_world_lpalm, np.tile(forces[0], (HORIZON, 1)))
    assert chunk.f_world_rpalm is None
    chunk.validate()
    stream.put(0.06, f_lpalm=forces[0] + 0.3, f_rpalm=np.zeros(3))
    assert not stream.news
    stream.put(0.09, f_lpalm=np.zeros(3), f_rpalm=forces[1])
    assert stream.news
    assert stream.infer(HERE.observation(5.1)).pushes == (False, True)
    stream.reset()
    assert stream.infer(HERE.observation(0.0)).pushes == (False, False)


def test_actions_of_a_layout_with_forces_tell_them():
    stream, told = TargetStream(builtin("wbc32_forces")), np.arange(6.0)
    first = stream.infer(HERE.observation(0.0))
    action = encode(stream.spec, first, HERE)[0]
    assert not action[32:].any()
    action[32:] = told
    stream.put_action(action, 0.1)
    chunk = stream.infer(HERE.observation(0.1))
    R = HERE.T_world_stance[:3, :3]
    np.testing.assert_allclose(chunk.f_world_lpalm[0], R @ told[:3], atol=1e-9)
    np.testing.assert_allclose(chunk.f_world_rpalm[-1], R @ told[3:], atol=1e-9)


def test_a_prefix_is_repeated_for_the_delay_and_left_by_its_horizon():
    stream, own = followed(lambda t: (0.5 * t, 0.5 * t), 0.5)
    other = TargetStream()
    other.put(0.5, lhand=pose(0.0, 1.0))
    executed = other.infer(HERE.observation(0.5))
    stream.put(0.51, f_lpalm=np.ones(3))
    chunk = stream.infer_after(HERE.observation(0.5), Prefix(executed, HORIZON, 3, 8))
    chunk.validate()
    np.testing.assert_allclose(chunk.T_world_lhand[:3], executed.T_world_lhand[:3], atol=1e-12)
    np.testing.assert_array_equal(chunk.f_world_lpalm, np.ones((HORIZON, 3)))
    np.testing.assert_allclose(chunk.T_world_lhand[8:], own.T_world_lhand[8:], atol=1e-9)


def test_a_reset_forgets_everything():
    stream, _ = followed(lambda t: (0.2 * t, 0.0), 0.5)
    stream.reset()
    stream.put(0.0, lhand=pose(0.3))
    assert stream.infer(HERE.observation(0.0)).seq == 0


def test_a_target_is_news_where_the_last_chunk_has_it_elsewhere():
    stream = TargetStream()
    assert stream.news
    for time in np.arange(0.0, 1.0, 1.0 / FPS):
        stream.put(time, lhand=pose(0.2 * time), q_rhand=np.full(7, 0.1))
    assert stream.infer(HERE.observation(1.0)) is not None
    stream.put(1.02, lhand=pose(0.204))
    assert not stream.news  # it goes on as it was going
    stream.put(1.05, lhand=pose(0.21 + 2e-3))
    assert stream.news
    stream.infer(HERE.observation(1.06))
    stream.put(1.07, lhand=pose(0.21 + 2e-3 + 0.004, turn=0.02))
    assert stream.news
    stream.infer(HERE.observation(1.08))
    assert not stream.news
    stream.put(1.09, q_rhand=np.full(7, 0.15))
    assert stream.news
    stream.reset()
    assert stream.news


def test_a_target_that_is_repeated_is_no_news_however_long():
    stream, _ = followed(lambda t: (0.0, 0.3), 0.2)
    for time in 0.3 + np.arange(60) / FPS:
        stream.put(time, lhand=pose(0.0, 0.3))
        assert not stream.news
