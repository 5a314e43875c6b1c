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


@pytest.mark.parametrize("suffix", ["pkl", "npz"])
def test_the_line_that_is_named_makes_a_motion_that_is_read(tmp_path, monkeypatch, suffix):
    monkeypatch.chdir(tmp_path)
    if suffix == "pkl":
        (tmp_path / "a.pkl").write_bytes(pickle.dumps(MOTION))
    else:
        np.savez(tmp_path / "a.npz", **MOTION)
    with pytest.raises(PolicyError) as refused:
        open_source(f"a.{suffix}", 60.0, None)
    program = re.search(r'python -c "(.*)"', str(refused.value))[1]
    subprocess.run([sys.executable, "-c", program], check=True, cwd=tmp_path)
    assert open_recording(tmp_path / "motion.csv").episode.notes == ()


def test_other_exports_name_what_writes_a_dataset(tmp_path):
    (tmp_path / "a.hdf5").write_bytes(b"\x89HDF")
    assert "porting scripts" in advice(tmp_path / "a.hdf5")
    (tmp_path / "episode_0000").mkdir()
    (tmp_path / "episode_0000" / "data.json").write_text("{}")
    assert "convert_unitree_json_to_lerobot" in advice(tmp_path)
    assert "convert_unitree_json_to_lerobot" in advice(tmp_path / "episode_0000")
    assert advice(tmp_path / "a.bvh") == ""
