"""Numbers in world where a layout has them in the pelvis: said, and said of nothing else."""

import dataclasses
import re

import numpy as np
import pytest

from policy import Anchor, FileFormatError, ReplayPolicy, builtin, decode, encode, scripted_policy
from policy.action_spec.describe import stance_numbers
from tests.support.policy_cases import anchor_somewhere, observation, wandering_chunk

STANCE, WBC32 = builtin("wbc32"), builtin("wbc32-v1")


def in_frame(frame):
    slots = (dataclasses.replace(s, frame=frame) if "wrist" in s.name else s for s in WBC32.slots)
    return dataclasses.replace(WBC32, name=f"in_{frame}", slots=tuple(slots))


def in_world(chunk, anchor):
    """The numbers of someone who overlooked that wbc32 is in the pelvis."""
    return encode(in_frame("world"), chunk, anchor)


@pytest.mark.parametrize("frame", ["pelvis", "pelvis_yaw", "torso"])
def test_numbers_that_look_like_world_positions_are_said_to_be(frame):
    policy, anchor = scripted_policy("reach"), Anchor.nominal()
    actions = in_world(policy.infer(observation()), anchor)
    (note,) = decode(in_frame(frame), actions, anchor).notes
    assert "these look like positions in world: left_wrist_position begins at (" in note
    assert f"out of reach in the {frame}" in note


@pytest.mark.parametrize("name", ["reach", "wave", "lissajous", "two_hand_lift", "pick_low", "pick_high"])
def test_what_is_in_the_pelvis_is_not_guessed_to_be_in_world(name):
    policy, anchor = scripted_policy(name), Anchor.nominal()
    for k in range(8):
        chunk = policy.infer(observation(0.8 * k))
        assert decode(WBC32, encode(WBC32, chunk, anchor), anchor).notes == ()
        assert decode(in_frame("world"), in_world(chunk, anchor), anchor).notes == ()


def test_a_pelvis_anywhere_is_no_reason_to_guess():
    for seed in range(20):
        anchor = anchor_somewhere(seed)
        chunk = wandering_chunk(anchor, seed=seed)
        assert decode(WBC32, encode(WBC32, chunk, anchor), anchor).notes == ()


def test_a_chunk_file_in_world_says_so_in_every_chunk_it_plays_and_so_in_its_verdict(tmp_path):
    actions = np.tile(stance_numbers(WBC32), (10, 1))
    np.savez(tmp_path / "right.npz", actions=actions, fps=30.0, spec="wbc32-v1")
    assert ReplayPolicy.from_npz(tmp_path / "right.npz").infer(observation()).notes == ()
    actions[:, [2, 11]] += Anchor.nominal().T_world_base[2, 3]
    np.savez(tmp_path / "wrong.npz", actions=actions, fps=30.0, spec="wbc32-v1")
    (note,) = ReplayPolicy.from_npz(tmp_path / "wrong.npz").infer(observation()).notes
    assert "look like positions in world" in note


def test_numbers_of_version_1_are_not_carried_out_as_version_2(tmp_path):
    actions = encode(WBC32, scripted_policy("reach").infer(observation()), Anchor.nominal())
    (note,) = decode(STANCE, actions, Anchor.nominal()).notes
    assert (
        "these look like positions in the pelvis, as version 1 of wbc32 has them: --assume-spec wbc32-v1 reads" in note
    )
    np.savez(tmp_path / "old.npz", actions=actions, fps=30.0, spec="wbc32")
    with pytest.raises(
        FileFormatError, match=r"--assume-spec wbc32-v1 reads them so; .*'wbc32' is wbc32-v2-ed4f53491c16"
    ):
        ReplayPolicy.from_npz(tmp_path / "old.npz")
    ReplayPolicy.from_npz(tmp_path / "old.npz", assume=WBC32)
    np.savez(tmp_path / "meant.npz", actions=actions, fps=30.0, spec="wbc32-v2")
    assert ReplayPolicy.from_npz(tmp_path / "meant.npz").infer(observation()).notes == (note,)


@pytest.mark.parametrize("name", ["reach", "wave", "lissajous", "two_hand_lift", "pick_low", "pick_high"])
def test_what_is_in_the_stance_is_not_guessed_to_be_elsewhere(name):
    policy, anchor = scripted_policy(name), Anchor.nominal()
    for k in range(8):
        chunk = policy.infer(observation(0.8 * k))
        assert decode(STANCE, encode(STANCE, chunk, anchor), anchor).notes == ()


def test_numbers_in_millimetres_are_told_that_positions_are_in_metres():
    actions = np.tile(stance_numbers(WBC32), (10, 1))
    assert decode(WBC32, actions, Anchor.nominal()).notes == ()
    actions[:, [0, 1, 2, 9, 10, 11]] *= 1e3
    (note,) = decode(WBC32, actions, Anchor.nominal()).notes
    assert re.fullmatch(
        r"the (left|right) wrist is asked to be \d+ m from the pelvis: positions are in metres; .*--from.*", note
    )
