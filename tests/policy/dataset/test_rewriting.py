"""Repaired actions go back to the columns that their joints have, however a dataset splits and orders them.

Strategy: sets written with pyarrow alone get new actions in the order of a layout, which is another one than theirs;
each joint is looked for under its own name again.
"""

import json

import numpy as np
import pytest

from policy import builtin
from policy.dataset.checks import column_layout
from policy.dataset.naming.sources import find_source
from policy.dataset.open import open_dataset
from policy.dataset.rewriting import rewrite_dataset
from policy.recorded.dataset_replay import open_episode
from tests.support.other_forms import ANCHOR, JOINT28, ROBOT, rows
from tests.support.written_datasets import write_dataset

FRAMES = 8
NEW = rows(JOINT28, 2 * FRAMES) + 0.05 * np.cos(0.1 * np.arange(2 * FRAMES))[:, None]
ORDERS = {"as the layout": JOINT28, "backwards": JOINT28[::-1], "right first": [*JOINT28[14:], *JOINT28[:14]]}


def one(parts):
    return {f"{key}{part}": rows(names, FRAMES) for key in ("action", "observation.state")
            for part, names in parts.items()}  # fmt: skip


def named(parts):
    return {f"{key}{part}": names for key in ("action", "observation.state") for part, names in parts.items()}


def joints_of(folder, episode):
    """Columns of an episode's actions by joint, doubled ones too."""
    dataset = open_dataset(folder)
    source = find_source(dataset, "action")
    layout = column_layout(dataset, source)
    values = source.of(dataset.table(dataset.episodes[episode], list(source.features)), dataset.episodes[episode])
    return dict(zip(layout.given, values.T, strict=True))


@pytest.mark.parametrize("order", ORDERS)
def test_each_joint_keeps_its_column(tmp_path, order):
    parts = {"": ORDERS[order]}
    folder = write_dataset(tmp_path / "set", [one(parts)] * 2, named(parts), precision="float64")
    rewrite_dataset(folder, tmp_path / "out", {0: None, 1: NEW[:FRAMES]}, facts={}, spec=builtin("joint28"))
    found = joints_of(tmp_path / "out", 1)
    for i, name in enumerate(JOINT28):
        np.testing.assert_array_equal(found[name], NEW[:FRAMES, i])
    before = joints_of(folder, 0)
    for name, values in joints_of(tmp_path / "out", 0).items():
        np.testing.assert_array_equal(values, before[name])


def test_a_split_set_stays_split_and_a_joint_that_is_there_twice_is_changed_twice(tmp_path):
    parts = {".right_arm": JOINT28[7:14], ".left_arm": JOINT28[:7], ".left_hand": JOINT28[14:21],
             ".right_hand": JOINT28[21:], ".body": list(ROBOT.body_joints), ".left_ee": ["x", "y", "z"]}  # fmt: skip
    sound = {key: names for key, names in parts.items() if key != ".left_ee"}
    episode = one(sound) | {f"{key}.left_ee": np.ones((FRAMES, 3)) for key in ("action", "observation.state")}
    folder = write_dataset(tmp_path / "set", [episode] * 2, named(parts))
    rewrite_dataset(folder, tmp_path / "out", {1: NEW}, facts={"source": "set"}, spec=builtin("joint28"))
    out = open_dataset(tmp_path / "out")
    assert [key for key in out.features if key.startswith("action")] == [f"action{part}" for part in parts]
    (episode,) = out.episodes
    assert episode.length == 2 * FRAMES
    for part in (".left_arm", ".body"):
        values = np.stack(out.table(episode, [f"action{part}"]).column(f"action{part}").to_numpy())
        elbow = parts[part].index("left_elbow_joint")
        np.testing.assert_allclose(values[:, elbow], NEW[:, JOINT28.index("left_elbow_joint")], atol=1e-6)
    said = json.loads((tmp_path / "out/meta/repair.json").read_text())
    assert {"x", "y", "z", "left_knee_joint"} <= set(said["kept_as_recorded"])
    chunk = open_episode(tmp_path / "out", 0).episode
    assert np.abs(chunk.T_world_lhand - (ANCHOR.T_world_base @ ANCHOR.poses["lhand"])).max() > 0.01
