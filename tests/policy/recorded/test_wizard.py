"""Which layouts fit: the right one does, others of its width do not, and what a source cannot show is said."""

import json

import numpy as np
import pytest

from policy import builtin, write_chunk_file
from policy.errors import PolicyError
from policy.recorded.example import example_file
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
    with pytest.raises(PolicyError, match="no dataset"):
        numbers_of(tmp_path / "nothing")
    np.savez(tmp_path / "x.npz", actions=np.full((2, 3), np.nan))
    with pytest.raises(PolicyError, match="not finite"):
        numbers_of(tmp_path / "x.npz")
