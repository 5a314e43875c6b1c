"""Replay and conversion of recordings, and the contract that every policy keeps."""

import numpy as np
import pytest

from policy import (
    LAYOUTS,
    SCRIPTS,
    Anchor,
    ChunkError,
    ChunkFile,
    FileFormatError,
    ObservationError,
    Policy,
    ReplayPolicy,
    builtin,
    convert,
    encode,
    motion_chunk,
    open_recording,
    read_chunk_file,
    read_motion_csv,
    require_same,
    scripted_policy,
    write_chunk_file,
    write_motion_csv,
)
from policy.recorded.replay import needed_until
from tests.support.policy_cases import made_up_motion, observation, wandering_chunk


@pytest.fixture(scope="module")
def motion_file(tmp_path_factory):
    path = tmp_path_factory.mktemp("motion") / "swing.csv"
    write_motion_csv(path, made_up_motion(241))
    return path


@pytest.fixture(params=[*SCRIPTS, "csv", "npz"])
def policy(request, motion_file, tmp_path):
    if request.param == "csv":
        return open_recording(motion_file)
    if request.param == "npz":
        convert(motion_file, tmp_path / "swing.npz")
        return open_recording(tmp_path / "swing.npz")
    return scripted_policy(request.param)


class TestEveryPolicy:
    """The contract; a new policy joins by the fixture above."""

    def test_it_is_a_policy_that_does_not_see_the_robot(self, policy):
        assert isinstance(policy, Policy)
        assert policy.sees_robot is False
        assert policy.spec.dim == 32

    def test_chunks_are_valid_numbered_and_start_at_the_observation(self, policy):
        policy.reset("anything")
        before = None
        for i in range(5):
            time = 2.0 + i * 25 / 30.0
            chunk = policy.infer(observation(time))
            chunk.validate(after=before)
            left = 50 if not hasattr(policy, "episode") else len(policy.episode) - 25 * i
            assert (chunk.seq, len(chunk)) == (i, left if 25 <= left < 50 else 50)
            assert time - 1.0 / chunk.fps < chunk.t_obs <= time + 1e-9
            before = chunk

    def test_successive_chunks_agree_where_they_overlap(self, policy):
        policy.reset()
        first, second = (policy.infer(observation(3.0 + t)) for t in (0.0, 25 / 30.0))
        assert np.abs(first.times[25:] - second.times[:25]).max() < 1e-9
        assert np.abs(first.T_world_lhand[25:] - second.T_world_lhand[:25]).max() < 1e-9
        assert np.abs(first.q_rhand[25:] - second.q_rhand[:25]).max() < 1e-9

    def test_the_target_does_not_move_when_the_robot_leans_towards_it(self, policy):
        policy.reset()
        upright = [policy.infer(observation(i * 25 / 30.0)) for i in range(20)]
        policy.reset()
        leaning = [policy.infer(observation(i * 25 / 30.0, lean=0.02 * i)) for i in range(20)]
        for a, b in zip(upright, leaning, strict=True):
            assert np.abs(a.T_world_lhand - b.T_world_lhand).max() <= 1e-4

    def test_reset_begins_again(self, policy):
        policy.reset()
        first = policy.infer(observation(1.0))
        policy.infer(observation(2.0))
        policy.reset()
        again = policy.infer(observation(9.0))
        assert again.seq == 0
        assert np.abs(first.T_world_rhand - again.T_world_rhand).max() < 1e-12

    def test_time_that_goes_back_is_refused(self, policy):
        policy.reset()
        policy.infer(observation(2.0))
        with pytest.raises(ObservationError, match="call reset"):
            policy.infer(observation(1.0))

    def test_time_that_is_no_number_is_refused(self, policy):
        policy.reset()
        with pytest.raises(ObservationError, match="finite"):
            policy.infer(observation(float("nan")))

    def test_the_end_is_held(self, policy):
        policy.reset()
        policy.infer(observation(0.0))
        chunk = policy.infer(observation(policy.duration + 10.0))
        assert np.abs(chunk.T_world_lhand - chunk.T_world_lhand[0]).max() < 1e-9


def test_no_window_asks_for_a_stop_that_is_no_part_of_the_recording():
    """Hands that were told to stop at once at the last row of a motion left its plan, which was feasible."""
    episode = wandering_chunk(Anchor.nominal(), steps=90)
    policy = ReplayPolicy(episode)
    windows = [policy.infer(observation(i * 25 / episode.fps)) for i in range(4)]
    assert [len(window) for window in windows] == [50, 50, 40, 50]
    assert (windows[2].T_world_lhand == episode.T_world_lhand[50:]).all()
    assert (windows[3].T_world_lhand[14:] == episode.T_world_lhand[-1]).all()  # of those who go on, hands are held
    assert len(ReplayPolicy(wandering_chunk(Anchor.nominal(), steps=7)).infer(observation(0.0))) == 50  # over too soon


def test_nothing_is_needed_after_the_end_of_a_recording_but_by_those_who_go_on():
    policy = ReplayPolicy(wandering_chunk(Anchor.nominal(), steps=90))
    assert needed_until(policy, policy.duration) == policy.duration
    assert needed_until(policy, 1.0) == 1.0
    assert needed_until(policy, policy.duration + 1.0) == np.inf
    assert needed_until(scripted_policy("wave"), 1.0) == np.inf


def test_replay_serves_the_recordings_own_steps_at_any_time(motion_file):
    policy = open_recording(motion_file)
    episode = motion_chunk(read_motion_csv(motion_file))
    policy.reset()
    policy.infer(observation(10.0))
    chunk = policy.infer(observation(10.0 + 0.834))
    assert chunk.t_obs == pytest.approx(10.0 + 25 / 30.0)
    assert (chunk.T_world_lhand[:10] == episode.T_world_lhand[25:35]).all()


def test_replay_keeps_optional_parts(tmp_path):
    spec = builtin("wbc27")
    file = ChunkFile(spec, encode(spec, wandering_chunk(Anchor.nominal(), steps=70), Anchor.nominal()), 30.0)
    write_chunk_file(tmp_path / "a.npz", file)
    policy = ReplayPolicy.from_npz(tmp_path / "a.npz", horizon=30)
    require_same(spec, policy.spec)
    chunk = policy.infer(observation(0.0))
    assert chunk.q_waist.shape == (30, 3)
    assert chunk.base_height.shape == (30,)
    assert chunk.spec_id == spec.id


def test_a_recording_of_another_kind_is_refused(tmp_path):
    with pytest.raises(FileFormatError, match=r"chunk \.npz, array \.npy and motion \.csv"):
        open_recording(tmp_path / "a.mp4")


@pytest.mark.parametrize("layout", ["wbc32", "unifolm23", "wbc27"])
def test_a_motion_becomes_a_chunk_file(motion_file, tmp_path, layout):
    convert(motion_file, tmp_path / "a.npz", to=layout)
    file = read_chunk_file(tmp_path / "a.npz")
    assert file.spec == builtin(layout)
    expected = motion_chunk(read_motion_csv(motion_file))
    assert np.abs(file.chunk().T_world_lhand - expected.T_world_lhand).max() < 1e-9


@pytest.mark.parametrize("layout", [name for name in LAYOUTS if name != "joint23"])
def test_a_chunk_file_changes_its_layout(tmp_path, layout):
    anchor = Anchor.nominal()
    chunk = wandering_chunk(anchor, steps=4)
    wbc32 = builtin("wbc32")
    write_chunk_file(tmp_path / "a.npz", ChunkFile(wbc32, encode(wbc32, chunk, anchor), 30.0, 1.0))
    convert(tmp_path / "a.npz", tmp_path / "b.npz", to=layout)
    convert(tmp_path / "b.npz", tmp_path / "c.npz")
    again = read_chunk_file(tmp_path / "c.npz").chunk()
    assert np.abs(again.T_world_lhand - chunk.T_world_lhand).max() < 1e-5
    assert again.t_obs == 1.0


def test_the_start_of_a_file_survives_conversion(tmp_path):
    wbc32 = builtin("wbc32")
    base = np.array([0.2, 0.0, 0.75, 0.0, 0.0, np.sin(0.3), np.cos(0.3)])
    file = ChunkFile(
        wbc32,
        encode(wbc32, wandering_chunk(Anchor.nominal()), Anchor.nominal()),
        30.0,
        0.0,
        base,
        {"left_elbow_joint": 0.3},
    )
    write_chunk_file(tmp_path / "a.npz", file)
    convert(tmp_path / "a.npz", tmp_path / "b.npz", to="gr00t_g1")
    again = read_chunk_file(tmp_path / "b.npz")
    assert np.allclose(again.q0_base, base)
    assert again.q0_joints["left_elbow_joint"] == 0.3
    assert np.abs(again.chunk().T_world_rhand - file.chunk().T_world_rhand).max() < 1e-5


def test_a_chunk_file_becomes_a_motion_whose_wrists_are_the_same(motion_file, tmp_path):
    convert(motion_file, tmp_path / "a.npz")
    convert(tmp_path / "a.npz", tmp_path / "b.csv")
    expected = motion_chunk(read_motion_csv(motion_file))
    again = motion_chunk(read_motion_csv(tmp_path / "b.csv"))
    assert len(again) == len(expected)
    assert np.abs(again.T_world_rhand - expected.T_world_rhand).max() < 1e-3


def test_a_motion_refuses_what_the_standing_robot_cannot_reach(tmp_path):
    wbc32 = builtin("wbc32")
    chunk = wandering_chunk(Anchor.nominal(), steps=3)
    chunk.T_world_rhand[1, 0, 3] += 1.0
    write_chunk_file(tmp_path / "a.npz", ChunkFile(wbc32, encode(wbc32, chunk, Anchor.nominal()), 60.0))
    with pytest.raises(ChunkError, match="cannot reach the wrist poses at step 1"):
        convert(tmp_path / "a.npz", tmp_path / "b.csv")


def test_conversions_that_do_not_exist_are_refused(motion_file, tmp_path):
    with pytest.raises(FileFormatError, match=r"\.csv to \.npz"):
        convert(motion_file, tmp_path / "b.csv")
