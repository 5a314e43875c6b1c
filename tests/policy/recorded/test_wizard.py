"""Which layouts fit: the right one does, others of its width do not, and what a source cannot show is said."""

import json

import numpy as np
import pytest

from policy import Anchor, builtin, write_chunk_file
from policy.action_spec.codec import decode
from policy.action_spec.spec import ActionSpec
from policy.errors import PolicyError
from policy.geometry.rotations import matrix_to_rot6d, rotvec_to_matrix
from policy.recorded.chunk_file import ChunkFile
from policy.recorded.example import example_file
from policy.recorded.replay import open_recording
from policy.recorded.wizard import BY_NAMES, fits, label, lines, numbers_of
from tests.support.public_headers import written
from tests.support.written_datasets import write_dataset


def answers(source):
    return {label(one.spec): one for one in fits(numbers_of(source))}


@pytest.mark.parametrize(
    "name", ["wbc32-v1", "wbc32-v2", "joint28", "openhlm34", "decoupled_wbc43", "inspire26", "brainco26"]
)
def test_a_chunk_fits_its_own_layout(tmp_path, name):
    write_chunk_file(tmp_path / "a.npz", example_file(builtin(name)))
    found = answers(tmp_path / "a.npz")
    assert found[name].fits
    assert found[name].why[0] == "both wrists are within reach in 100% of the rows"
    assert found[name].spec.fps == builtin(name).fps


def test_hands_of_another_kind_do_not_fit_and_why_is_said(tmp_path):
    write_chunk_file(tmp_path / "a.npz", example_file(builtin("inspire26")))
    found = answers(tmp_path / "a.npz")
    assert found["inspire26"].fits
    assert not found["inspire26_by_side"].fits
    assert next(iter(found)) in ("inspire26", "brainco26")  # what fits comes first


def quaternions_turned(actions):
    for at in (3, 10):
        actions[:, at : at + 4] = np.roll(actions[:, at : at + 4], -1, axis=1)


def interleaved(actions):
    for at in (3, 12):
        actions[:, at : at + 6] = actions[:, at : at + 6].reshape(-1, 2, 3).swapaxes(1, 2).reshape(-1, 6)


def signs(actions):
    actions[:, 18:20] = 2.0 * np.linspace(0.0, 1.0, len(actions))[:, None] - 1.0


def millimetres(actions):
    actions[:, [0, 1, 2, 9, 10, 11]] *= 1000.0


def percent(actions):
    actions[:, 14:16] = np.linspace(0.0, 100.0, len(actions))[:, None]


@pytest.mark.parametrize(
    ("name", "change", "said", "fitting"),
    [
        ("wbc32", interleaved, "rot6d_layout", ["wbc32_interleaved"]),
        ("decoupled_wbc_eef14", quaternions_turned, "quaternion_order", ["decoupled_wbc_eef14_xyzw"]),
        ("wbc32", millimetres, "positions are in metres", ["wbc32_mm"]),
        ("joint16", percent, '"closing"', ["joint16_opens_up", "joint16_closes_up"]),
        ("wbc27", signs, '"closing"', ["wbc27_opens_up", "wbc27_closes_up"]),
    ],
)
def test_a_convention_that_no_layout_has_becomes_one_that_is_read(tmp_path, name, change, said, fitting):
    file = example_file(builtin(name))
    spec, right = file.spec, file.actions.copy()
    if change is interleaved:  # which an identity hides
        R = rotvec_to_matrix(np.array([0.0, 0.0, 0.3]))
        right[:, 3:9] = right[:, 12:18] = matrix_to_rot6d(R, "cols")
    actions = right.copy()
    change(actions)
    path = tmp_path / "x.npz"
    write_chunk_file(path, ChunkFile(spec, actions, file.fps))
    try:
        answer = " ".join(open_recording(path).episode.notes)
    except PolicyError as error:
        answer = str(error)
    assert said in answer
    assert "`wholebody layouts --from`" in answer
    found = [one.spec for one in fits(numbers_of(path)) if one.fits]
    assert [one.name for one in found][: len(fitting)] == fitting
    for one in found[: len(fitting)]:
        episode = open_recording(path, assume=ActionSpec.from_json(one.to_json())).episode
        assert not any("clipped" in note for note in episode.notes)
        if change not in (signs, percent):
            expected = decode(spec, right, Anchor.nominal())
            np.testing.assert_allclose(episode.T_world_lhand, expected.T_world_lhand, atol=1e-9)


def test_names_say_it_or_speak_against_it(tmp_path):
    folder, _ = written(tmp_path / "set", "dex1, split, no side, yaw first")
    found = answers(folder)
    assert found[BY_NAMES].fits
    assert not found["joint16"].fits
    assert "is called 'wrist_yaw'" in found["joint16"].why[0]


def test_numbers_of_no_known_width_say_so(tmp_path):
    folder = write_dataset(tmp_path / "set", [{"action": np.random.default_rng(0).normal(size=(9, 41))}])
    assert "no layout has 41 numbers" in lines(numbers_of(folder), [])[-1]
    assert fits(numbers_of(folder)) == []


def test_a_checkpoint_has_a_width_and_no_numbers(tmp_path):
    config = {"output_features": {"action": {"shape": [32]}}, "chunk_size": 25}
    (tmp_path / "config.json").write_text(json.dumps(config))
    numbers = numbers_of(tmp_path)
    first, found = fits(numbers)
    assert {label(one.spec) for one in (first, found)} == {"wbc32-v1", "wbc32-v2"}
    assert (found.spec.name, found.spec.horizon) == ("wbc32", 25)
    assert "numbers not seen" in lines(numbers, [found])[0]
    assert "a checkpoint alone does not say" in found.why[0]


@pytest.mark.parametrize("content", ["{", "{}", '{"output_features": {"action": {"shape": []}}}'])
def test_what_is_no_source_is_refused(tmp_path, content):
    (tmp_path / "config.json").write_text(content)
    with pytest.raises(PolicyError):
        numbers_of(tmp_path)
    with pytest.raises(PolicyError, match="no such file or folder"):
        numbers_of(tmp_path / "nothing")
    np.savez(tmp_path / "x.npz", actions=np.full((2, 3), np.nan))
    with pytest.raises(PolicyError, match="not finite"):
        numbers_of(tmp_path / "x.npz")
