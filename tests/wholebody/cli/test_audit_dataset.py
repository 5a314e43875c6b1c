"""Strategy: a dataset as LeRobot writes it, one episode of which no robot can do, is audited; the list of episodes to
delete is given to LeRobot's own tool, and what that leaves is audited again. Datasets of wrists with episodes out of
reach and too fast are repaired, opened by LeRobot's own class and audited again."""

import json

import draccus
import numpy as np
import pyarrow.parquet
import pytest
from lerobot.datasets import LeRobotDataset
from lerobot.scripts.lerobot_edit_dataset import EditDatasetConfig, edit_dataset

from models import g1
from policy.action_spec.anchor import Anchor
from policy.action_spec.builtin import builtin
from policy.action_spec.codec import encode
from policy.chunk import ActionChunk
from policy.dataset.conversion import convert_dataset
from policy.dataset.rewriting import rewrite_dataset
from policy.errors import DatasetError
from tests.support.commands import wholebody
from tests.support.dataset_cases import LENGTHS, VIDEO, write_v30
from tests.support.joint_cases import DEX3
from wholebody.planning.judgement.chunk_judge import ChunkJudge


def shaken(action, state, episode):
    """Arms near the body; in the middle episode an elbow is elsewhere at every other frame."""
    arms = np.arange(action.shape[1]) < 14
    action = np.where(arms, 0.3 * action, action)
    if episode == 1:
        action[1::2, DEX3.given.index("kLeftElbow")] += 1.0
    return action, state


def answers(folder):
    table = pyarrow.parquet.read_table(folder / "episodes.parquet").to_pylist()
    return [(row["episode"], row["answer"]) for row in table]


def test_lerobot_deletes_what_an_audit_says(inside, tmp_path, monkeypatch):
    dataset = write_v30(tmp_path / "shaken", cameras=False, change=shaken)
    done = wholebody("audit", "shaken", "-j", "1", cwd=tmp_path)
    assert done.returncode == 1, done.stderr
    found = dict(answers(tmp_path / "audit"))
    assert found == {0: "feasible", 1: "infeasible", 2: "feasible"}
    (settings,) = (tmp_path / "audit").glob("delete_*.json")
    asked = json.loads(settings.read_text())
    assert asked["root"] == str(dataset)
    assert asked["operation"]["episode_indices"] == [1]
    edit_dataset(draccus.parse(EditDatasetConfig, settings, args=[]))
    monkeypatch.chdir(tmp_path)
    again = inside("audit", "shaken_audited", "--to", "again", "-j", "1")
    assert again.returncode == 0, again.stderr
    assert answers(tmp_path / "again") == [(0, "feasible"), (1, "feasible")]


@pytest.fixture(scope="module")
def wrists():
    """Poses of the wrists in the stance, shape (2, 4, 4)."""
    return ChunkJudge(g1()).stance().hands.T_world_hand


def ahead(wrists, by):
    """Numbers of a dataset whose left hand is so far ahead of the stance at each step, ``by`` of shape (n,) [m]."""
    T, fingers = np.tile(wrists[:, None], (1, len(by), 1, 1)), np.zeros((len(by), 7))
    T[0, :, 0, 3] += by
    spec = builtin("wbc32")
    return encode(spec, ActionChunk(spec.id, 0, 0.0, 30.0, *T, fingers, fingers), Anchor.nominal())


def test_a_hand_out_of_reach_is_led_back_and_the_pictures_stay(inside, tmp_path, wrists, monkeypatch):
    made = convert_dataset(write_v30(tmp_path / "joints"), tmp_path / "wrists").folder
    asked = {i: ahead(wrists, np.full(LENGTHS[i], by)) for i, by in enumerate((0.2, 0.48, 0.8))}
    rewrite_dataset(made, tmp_path / "asked", asked, facts={})
    monkeypatch.chdir(tmp_path)
    done = inside("audit", "asked", "--repair", "-j", "1")
    assert done.returncode == 1, done.stderr
    assert "1 of 2 that are not feasible as given are repaired" in done.stdout
    (folder,) = (path for path in (tmp_path / "audit" / "repaired").iterdir() if path.is_dir())
    said = json.loads((folder / "meta" / "repair.json").read_text())
    assert said["repaired"]["1"]["moved_m"] == pytest.approx(0.031, abs=0.005)
    assert said["left_out"] == [2]

    again = inside("audit", str(folder), "--to", "again", "-j", "1")
    assert again.returncode == 0, again.stderr
    assert answers(tmp_path / "again") == [(0, "feasible"), (1, "feasible")]
    before, after = (LeRobotDataset("tests/x", root=root) for root in (made, folder))
    assert after.num_frames == LENGTHS[0] + LENGTHS[1]
    for i in (0, LENGTHS[0] + 3):
        assert (after[i][VIDEO] == before[i][VIDEO]).all()
        assert after[i]["observation.state"].tolist() == before[i]["observation.state"].tolist()
    np.testing.assert_allclose(np.stack([after[i]["action"] for i in range(12)]), asked[0], atol=1e-6)


@pytest.mark.regression
def test_a_hand_too_fast_is_slowed_down_where_no_video_has_to_be_encoded_anew(tmp_path, wrists):
    made = convert_dataset(write_v30(tmp_path / "joints", cameras=False), tmp_path / "wrists").folder
    once = [0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, n)) for n in LENGTHS]
    fast = {0: ahead(wrists, 0.1 * once[0]), 1: ahead(wrists, 0.35 * once[1])}
    rewrite_dataset(made, tmp_path / "asked", fast, facts={})
    done = wholebody("audit", "asked", "--repair", "-j", "1", cwd=tmp_path)
    (folder,) = (path for path in (tmp_path / "audit" / "repaired").iterdir() if path.is_dir())
    slower = json.loads((folder / "meta" / "repair.json").read_text())["repaired"]["1"]["slower"]
    after = LeRobotDataset("tests/x", root=folder)
    length = int(np.ceil((LENGTHS[1] - 1) * slower - 1e-9)) + 1
    assert (slower > 1.0, after.num_frames) == (True, LENGTHS[0] + length), done.stdout
    last = after[after.num_frames - 1]
    assert last["timestamp"].item() == pytest.approx((length - 1) / 30.0, abs=1e-4)
    assert last["observation.velocity"].tolist() == [1.0, LENGTHS[1] - 1]
    again = wholebody("audit", str(folder), "--to", "again", "-j", "1", cwd=tmp_path)
    assert answers(tmp_path / "again") == [(0, "feasible"), (1, "feasible")], again.stderr


def test_a_dataset_with_videos_is_not_played_at_another_speed(tmp_path):
    made = convert_dataset(write_v30(tmp_path / "joints"), tmp_path / "wrists").folder
    with pytest.raises(DatasetError, match="encoded anew"):
        rewrite_dataset(made, tmp_path / "slow", {0: None, 1: np.zeros((18, 32))}, facts={})
    with pytest.raises(DatasetError, match="none of its 3 episodes"):
        rewrite_dataset(made, tmp_path / "none", {}, facts={})
    assert not (tmp_path / "slow").exists()
