"""JSON episodes of xr_teleoperate, read as any dataset: wrists where a forward kinematics of the tests' own puts them.

Strategy: `tests.support.other_forms` writes episodes from joint angles by name, as the tool's own writer lays them out.
What is read is compared with those angles; broken episodes are refused by name while the others are read.
"""

import json

import numpy as np
import pytest

from policy.dataset.conversion import convert_dataset
from policy.dataset.open import dataset_files, is_dataset, open_dataset
from policy.errors import DatasetError
from policy.recorded.dataset_replay import open_episode
from tests.support.other_forms import ANCHOR, posture, rows, write_xr
from tests.support.urdf_chain import link_pose


def test_wrists_are_where_the_angles_put_them(tmp_path):
    folder = write_xr(tmp_path)
    for number in (0, 1):
        chunk = open_episode(folder, number).episode
        assert chunk.fps == 30.0
        for k in range(len(chunk)):
            for side, T in (("left", chunk.T_world_lhand), ("right", chunk.T_world_rhand)):
                expected = ANCHOR.T_world_base @ link_pose(f"{side}_wrist_yaw_link", posture(k))
                np.testing.assert_allclose(T[k], expected, atol=1e-7)


def test_an_episode_alone_is_read_and_what_is_left_out_is_said(tmp_path):
    folder = write_xr(tmp_path) / "episode_0001"
    assert is_dataset(folder)
    assert [file.name for file in dataset_files(folder)] == ["data.json"]
    notes = open_episode(folder, 0).episode.notes
    assert any("'base_0'" in note and "of the base" in note for note in notes)
    assert open_dataset(folder).tasks == ("reach",)


def test_a_hand_of_six_numbers_is_left_out_aloud_and_one_number_is_a_gripper(tmp_path):
    write_xr(tmp_path / "six", hands=(np.full((8, 6), 0.5),) * 2)
    notes = open_episode(tmp_path / "six", 0).episode.notes
    assert any("of a hand that is not named" in note for note in notes)
    write_xr(tmp_path / "one", hands=(np.full((8, 1), 2.7),) * 2)
    assert open_episode(tmp_path / "one", 0).spec.slot("left_grasp").unit == "dex1 rad"


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda data: data.pop("data"), "no list of steps"),
        (lambda data: data["data"][3]["actions"]["left_arm"]["qpos"].pop(), "step 3: actions.left_arm.qpos"),
        (lambda data: data["data"][3]["actions"]["left_arm"].update(qpos=["x"] * 7), "no list of 7 numbers"),
        (lambda data: [step["actions"].clear() for step in data["data"]], "has no actions"),
        (lambda data: data["info"]["image"].update(fps=25), "25 Hz for 30 Hz"),
        (lambda data: [step["states"].pop("body") for step in data["data"]], "observation.state.body"),
    ],
)
def test_a_broken_episode_is_named_and_the_others_are_read(tmp_path, spoil, said):
    file = write_xr(tmp_path, episodes=3) / "episode_0001" / "data.json"
    data = json.loads(file.read_text())
    spoil(data)
    file.write_text(json.dumps(data))
    with pytest.raises(DatasetError, match=said) as refused:
        open_episode(tmp_path, 1)
    assert "episode_0001" in str(refused.value)
    for number in (0, 2):
        assert len(open_episode(tmp_path, number).episode) == 8


def test_text_that_would_become_too_many_values_is_refused_before_it_does(tmp_path):
    file = tmp_path / "episode_0000" / "data.json"
    file.parent.mkdir()
    file.write_text('{"data": [' + "[]," * 5_000_000 + "[]]}")
    with pytest.raises(DatasetError, match="has about 10000003 values"):
        open_dataset(tmp_path)


def test_it_converts_to_a_dataset_of_wrists(tmp_path):
    result = convert_dataset(write_xr(tmp_path / "xr"), tmp_path / "out")
    assert result.trips["action"].position < 1e-5
    chunk = open_episode(tmp_path / "out", 1).episode
    np.testing.assert_allclose(chunk.T_world_lhand, open_episode(tmp_path / "xr", 1).episode.T_world_lhand, atol=1e-6)
    assert rows(["left_elbow_joint"], 8).shape == (8, 1)
    said = json.loads((tmp_path / "out/meta/conversion.json").read_text())
    assert said["source"]["format"] == "xr_teleoperate JSON"
