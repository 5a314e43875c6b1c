"""Strategy: a dataset as LeRobot writes it, one episode of which no robot can do, is audited; the list of episodes to
delete is given to LeRobot's own tool, and what that leaves is audited again."""

import json

import draccus
import numpy as np
import pyarrow.parquet
from lerobot.scripts.lerobot_edit_dataset import EditDatasetConfig, edit_dataset

from tests.support.commands import wholebody
from tests.support.dataset_cases import write_v30
from tests.support.joint_cases import DEX3


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


def test_lerobot_deletes_what_an_audit_says(tmp_path):
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
    again = wholebody("audit", "shaken_audited", "--to", "again", "-j", "1", cwd=tmp_path)
    assert again.returncode == 0, again.stderr
    assert answers(tmp_path / "again") == [(0, "feasible"), (1, "feasible")]
