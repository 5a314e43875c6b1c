"""Episodes of a dataset as inputs of ``check`` and ``run``: the same wrists from joints as from what was converted."""

import json
import sys

import numpy as np
import pytest

from policy.action_spec.anchor import Anchor
from policy.action_spec.builtin import builtin
from policy.dataset.conversion import DatasetSettings, convert_dataset
from policy.dataset.joint_conversion import JointConversion
from policy.dataset.joint_layout import joint_layout
from policy.errors import DatasetError
from policy.recorded.dataset_replay import open_episode
from tests.support.dataset_cases import LENGTHS, joints_of, write_v30
from tests.support.policy_cases import observation
from wholebody.cli import main as cli
from wholebody.cli.sources import expanded, open_source


@pytest.fixture(scope="module")
def joints(tmp_path_factory):
    return write_v30(tmp_path_factory.mktemp("replay") / "joints", cameras=False)


@pytest.fixture(scope="module")
def wrists(joints):
    return convert_dataset(joints, joints.with_name("wrists"), DatasetSettings(check=False)).folder


def test_an_episode_plays_its_commanded_wrists_from_the_stance(joints, wrists):
    layout = joint_layout(json.loads((joints / "meta/info.json").read_text())["features"]["action"]["names"], 28)
    T = JointConversion(layout, builtin("wbc32")).wrists(joints_of(episode=1)[0])
    for folder, tolerance in ((joints, 1e-12), (wrists, 1e-6)):
        policy = open_episode(folder, 1)
        assert np.isclose(policy.duration, (LENGTHS[1] - 1) / 30)
        chunk = policy.infer(observation(4.0))
        wanted = Anchor.nominal().T_world_base @ T["lhand"]
        assert np.allclose(chunk.T_world_lhand[: LENGTHS[1]], wanted, atol=tolerance)
        assert np.allclose(chunk.q_lhand[3], joints_of(episode=1)[0][3, 14:21])


def test_the_layout_is_what_the_dataset_says(joints, wrists):
    assert open_episode(wrists, 0).spec.hash == builtin("wbc32").hash
    assert open_episode(joints, 0).spec.name == "joint28"


def test_a_user_may_vouch_for_the_layout(wrists, tmp_path):
    assert open_episode(wrists, 0, assume=builtin("wbc32")).spec.name == "wbc32"
    with pytest.raises(DatasetError, match="has 32 numbers; 'wbc27' has 27"):
        open_episode(wrists, 0, assume=builtin("wbc27"))


def test_an_episode_that_is_not_there_is_refused(joints):
    with pytest.raises(DatasetError, match="no episode 3; it has 0 to 2"):
        open_episode(joints, 3)


def test_an_edited_layout_is_refused(wrists):
    file = wrists / "meta" / "action_spec.json"
    text = file.read_text()
    try:
        file.write_text(text.replace('"cols"', '"rows"', 1))
        with pytest.raises(DatasetError, match="it was edited"):
            open_episode(wrists, 0)
    finally:
        file.write_text(text)


def test_a_folder_is_as_many_inputs_as_it_has_episodes(joints):
    assert expanded(str(joints), "") == [f"{joints}#{i}" for i in range(3)]
    assert expanded(str(joints), "0,2") == [f"{joints}#0", f"{joints}#2"]
    assert expanded("reach", "0") == ["reach"]


def test_an_episode_is_a_source_of_its_own(joints):
    assert open_source(f"{joints}#2", 60.0, None).name == "joints#2"


def test_an_episode_that_is_not_there_is_misuse(joints, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["wholebody", "check", str(joints), "--episodes", "7", "--json", "-"])
    with pytest.raises(SystemExit) as end:
        cli.main()
    said = capsys.readouterr()
    assert end.value.code == 2
    assert "no episode 7; it has 0 to 2" in said.err
    assert json.loads(said.out) == []


def test_a_picture_needs_one_episode(joints, monkeypatch, capsys, tmp_path):
    monkeypatch.setattr(sys, "argv", ["wholebody", "run", str(joints), "--sheet", str(tmp_path / "a.png")])
    with pytest.raises(SystemExit) as end:
        cli.main()
    assert end.value.code == 2
    assert "say --episodes 0" in capsys.readouterr().err
