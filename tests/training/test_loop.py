"""Strategy: the real loop, as small as it goes, in its own process; then once more, where everything is there."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np

from training.measure import done

ROOT = Path(__file__).parents[2]
SMALL = ["--episodes", "2", "--seconds", "1", "--steps", "2", "--batch", "2", "--tries", "1"]


def looped(folder):
    """What a loop says."""
    words = [sys.executable, "-m", "training.loop", "--out", str(folder), *SMALL]
    done = subprocess.run(words, capture_output=True, text=True, check=False, cwd=ROOT)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_a_loop_ends_with_a_table_and_one_that_is_done_is_not_done_again(tmp_path):
    said = looped(tmp_path)
    rows = json.loads((tmp_path / "loop.json").read_text())["rows"]
    assert rows.keys() == {"expert", "replay", "policy", "policy, gate"}
    assert all(row["falls"] == 0 for row in rows.values())
    assert [rows[name]["episodes"] for name in rows] == [1, 1, 1, 1]
    for name, row in rows.items():
        assert f"| {name} | {row['success']:.0f} %" in said
    config = json.loads((tmp_path / "policy/checkpoints/last/pretrained_model/config.json").read_text())
    assert config["input_features"].keys() == {"observation.state", "observation.environment_state"}
    again = looped(tmp_path)
    assert "its words are in" not in again
    assert "| policy, gate |" in again


def test_a_reach_is_done_where_both_palms_are_at_their_goals():
    names = [f"to_goal_{side}_{axis}.pos" for side in ("left", "right") for axis in "xyz"]
    states = np.array([[off, 0.0, 0.0, 0.0, -0.01, 0.0] for off in (0.1, 0.029)])
    assert done(states, names, "reach")
    assert not done(states[::-1], names, "reach")


def test_a_thing_is_done_where_it_was_moved_far_enough():
    names = [f"object_{axis}.pos" for axis in "xyz"]
    assert done(np.array([[0.4, 0.1, 0.83], [0.4, 0.1, 0.90]]), names, "pick")
    assert not done(np.array([[0.4, 0.1, 0.83], [0.5, 0.1, 0.88]]), names, "pick")
