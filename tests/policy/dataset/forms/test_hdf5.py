"""HDF5 of robomimic, Isaac Lab and ALOHA: read as datasets, by a process that may die of a file without harm.

Strategy: `tests.support.other_forms` writes the files from joint angles by name. The command that a refusal names is
run, and what it mends is read.
"""

import json
import re
import subprocess
import sys

import h5py
import numpy as np
import pytest

from policy import builtin
from policy.dataset.forms import hdf5_contents
from policy.dataset.forms.hdf5 import PROGRAM
from policy.dataset.open import open_dataset
from policy.errors import DatasetError
from policy.recorded.dataset_replay import open_episode
from tests.support.other_forms import ANCHOR, JOINT28, posture, rows, write_aloha, write_robomimic
from tests.support.urdf_chain import link_pose


def require_wrists(chunk):
    for k in range(len(chunk)):
        expected = ANCHOR.T_world_base @ link_pose("left_wrist_yaw_link", posture(k))
        np.testing.assert_allclose(chunk.T_world_lhand[k], expected, atol=1e-7)


def test_demonstrations_are_episodes_by_their_names(tmp_path):
    file = write_robomimic(tmp_path / "demo.hdf5", demonstrations=11)
    dataset = open_dataset(file)
    assert (dataset.fps, len(dataset.episodes)) == (20.0, 11)
    for number in (0, 10):
        require_wrists(open_episode(file, number).episode)


def test_isaac_labs_steps_say_the_rate(tmp_path):
    env = {"env_name": "x", "sim_args": {"dt": 0.005, "decimation": 4}}
    assert open_dataset(write_robomimic(tmp_path / "demo.h5", env=env)).fps == pytest.approx(50.0)


def test_a_rate_that_is_not_said_is_asked_for_and_the_command_mends_it(tmp_path):
    folder = write_aloha(tmp_path / "aloha")
    with pytest.raises(DatasetError, match="does not say its rate") as refused:
        open_dataset(folder)
    program = re.search(r'python -c "(.*)"', str(refused.value))[1]
    subprocess.run([sys.executable, "-c", program], check=True)
    with pytest.raises(DatasetError, match="--assume-spec joint28"):
        open_episode(folder, 1)
    policy = open_episode(folder, 1, assume=builtin("joint28"))
    require_wrists(policy.episode)
    assert policy.episode.fps == 50.0


def test_split_actions_are_parts(tmp_path):
    with h5py.File(tmp_path / "a.hdf5", "w") as out:
        out.attrs["fps"] = 30
        out["action/left_arm"], out["action/right_arm"] = rows(JOINT28[:7], 8), rows(JOINT28[7:14], 8)
    require_wrists(open_episode(tmp_path / "a.hdf5", 0).episode)


def test_a_broken_file_of_a_folder_is_named_and_the_others_are_read(tmp_path):
    folder = write_aloha(tmp_path / "aloha", episodes=3, fps=50)
    (folder / "episode_1.hdf5").write_bytes((folder / "episode_1.hdf5").read_bytes()[:900])
    with pytest.raises(DatasetError, match=r"episode_1.hdf5.*cannot be read as HDF5"):
        open_episode(folder, 1, assume=builtin("joint28"))
    for number in (0, 2):
        require_wrists(open_episode(folder, number, assume=builtin("joint28")).episode)


def test_links_other_files_and_objects_are_not_followed(tmp_path):
    write_aloha(tmp_path / "other", episodes=1)
    with h5py.File(tmp_path / "a.hdf5", "w") as out:
        out.attrs["fps"] = 30
        out["action"] = h5py.ExternalLink(str(tmp_path / "other/episode_0.hdf5"), "action")
        out["observations/qpos"] = h5py.SoftLink("/elsewhere")
        out.create_dataset("state", (8, 3), "f8", external=[(str(tmp_path / "raw.bin"), 0, 8 * 3 * 8)])
        out.create_dataset("names", data=["a", "b"])
    with pytest.raises(DatasetError, match="it has no numbers"):
        open_dataset(tmp_path / "a.hdf5")


def test_what_claims_too_much_is_refused_before_it_is_allocated(tmp_path):
    with h5py.File(tmp_path / "a.hdf5", "w") as out:
        out.create_dataset("action", (10**9, 28), "f8", chunks=(1000, 28), compression="gzip")
    with pytest.raises(DatasetError, match="more than 268435456 bytes"):
        open_dataset(tmp_path / "a.hdf5")
    with h5py.File(tmp_path / "b.hdf5", "w") as out:
        out.create_dataset("action", (10**6, 28), "f8", chunks=(10**6, 28), compression="gzip")
    with pytest.raises(DatasetError, match="in pieces of more than"):
        open_dataset(tmp_path / "b.hdf5")


def test_a_reader_that_dies_is_a_refusal(tmp_path, monkeypatch):
    folder = write_aloha(tmp_path / "aloha", fps=50)
    program = tmp_path / "dies.py"
    program.write_text("import os, signal\nos.kill(os.getpid(), signal.SIGSEGV)\n")
    monkeypatch.setattr("policy.dataset.forms.hdf5.PROGRAM", program)
    with pytest.raises(DatasetError, match="the HDF5 library fails on it"):
        open_dataset(folder)


def test_a_loop_without_an_end_ends_after_what_was_read_is_worth_and_is_met_once(tmp_path, monkeypatch):
    """A spliced file took eight seconds, each time that it was opened."""
    folder = write_aloha(tmp_path / "aloha", fps=50)
    program = tmp_path / "loops.py"
    program.write_text(
        f"import pathlib, sys\nsys.path.insert(0, {str(PROGRAM.parent)!r})\nimport hdf5_contents\n"
        f"with open({str(tmp_path / 'begun')!r}, 'a') as log: log.write('x')\n"
        "allow = hdf5_contents._bound_time()\nallow(0.5)\nwhile True: pass\n"
    )
    monkeypatch.setattr("policy.dataset.forms.hdf5.PROGRAM", program)
    for _ in range(2):
        with pytest.raises(DatasetError, match="the HDF5 library fails on it"):
            open_dataset(folder / "episode_0.hdf5")
    assert (tmp_path / "begun").read_text() == "x"


def test_time_is_allowed_by_what_a_file_holds(tmp_path):
    told = []
    hdf5_contents.contents(str(write_robomimic(tmp_path / "a.h5", demonstrations=2)), told.append)
    assert told == sorted(told)
    assert told[0] == hdf5_contents.CPU_FIRST
    assert hdf5_contents.CPU_FIRST < told[-1] < hdf5_contents.CPU_FIRST + 0.1


def test_what_is_read_is_numbers_with_their_attributes(tmp_path):
    listed, arrays = hdf5_contents.contents(str(write_robomimic(tmp_path / "a.h5", demonstrations=1)))
    found = {path: (shape, attributes) for path, shape, attributes in listed}
    assert found["data/demo_0/actions"] == ([8, 28], {"joint_names": JOINT28})
    assert "data/demo_0/obs/table_cam" not in found
    assert json.loads(found["data"][1]["env_args"])["env_kwargs"] == {"control_freq": 20}
    assert len(listed) == len(arrays)
