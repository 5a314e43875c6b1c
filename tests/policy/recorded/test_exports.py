"""Exports of other tools: not opened, and the line that makes an input of each is run where it can be."""

import pickle
import re
import subprocess
import sys

import numpy as np
import pytest

from policy import Anchor
from policy.errors import PolicyError
from policy.geometry.rotations import matrix_to_quaternion
from policy.recorded.exports import advice
from policy.recorded.replay import open_recording
from wholebody.cli.sources import open_source

ANCHOR = Anchor.nominal()
MOTION = {
    "root_pos": np.tile(ANCHOR.T_world_base[:3, 3], (60, 1)),
    "root_rot": np.tile(matrix_to_quaternion(ANCHOR.T_world_base[:3, :3], "xyzw"), (60, 1)),
    "dof_pos": np.tile(ANCHOR.q_body, (60, 1)),
}


class Bomb:
    """Leaves a trace if it is ever unpickled."""

    def __reduce__(self):
        return open, ("canary", "w")


def test_a_pickle_is_not_opened(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "motion.pkl").write_bytes(pickle.dumps(Bomb()))
    with pytest.raises(PolicyError, match="a pickle runs whatever is in it"):
        open_source(str(tmp_path / "motion.pkl"), 60.0, None)
    assert not (tmp_path / "canary").exists()


def test_the_line_that_is_named_makes_a_motion_that_is_read(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.pkl").write_bytes(pickle.dumps(MOTION))
    with pytest.raises(PolicyError) as refused:
        open_source("a.pkl", 60.0, None)
    program = re.search(r'python -c "(.*)"', str(refused.value))[1]
    subprocess.run([sys.executable, "-c", program], check=True, cwd=tmp_path)
    assert open_recording(tmp_path / "motion.csv", fps=60.0).episode.notes == ()


def test_an_episode_of_json_is_named_by_its_folder(tmp_path):
    (tmp_path / "data.json").write_text("{}")
    assert str(tmp_path) in advice(tmp_path / "data.json")
    assert advice(tmp_path / "a.bvh") == ""
