"""Retargeted motions as ``.npz``, by whichever tool: the motion that the same numbers are as ``.csv``.

Strategy: one motion is written with the arrays of each tool, and read; orders of joints and quaternions that were not
undone would put wrists elsewhere. What is malformed is refused by the name of its array.
"""

import numpy as np
import pytest

from models import g1
from policy.errors import FileFormatError, PolicyError
from policy.recorded.convert import convert
from policy.recorded.motion_csv import read_motion_csv
from policy.recorded.motion_npz import is_motion_npz, read_motion_npz
from policy.recorded.replay import open_recording
from tests.support.other_forms import motion_arrays

ARRAYS, TABLE = motion_arrays()


def save(folder, arrays):
    np.savez(folder / "motion.npz", **arrays)
    return folder / "motion.npz"


@pytest.mark.parametrize("tool", ARRAYS)
def test_the_motion_is_the_same_from_each_tool(tmp_path, tool):
    np.savetxt(tmp_path / "motion.csv", TABLE, delimiter=",", fmt="%.12f")
    expected = read_motion_csv(tmp_path / "motion.csv", 60.0)
    motion, _ = read_motion_npz(save(tmp_path, ARRAYS[tool]), 60.0)
    assert motion.fps == 60.0
    np.testing.assert_allclose(motion.q_body, expected.q_body, atol=1e-9)
    np.testing.assert_allclose(motion.T_world_base, expected.T_world_base, atol=1e-9)


def test_it_is_played_and_converted(tmp_path):
    file = save(tmp_path, ARRAYS["beyondmimic"])
    assert open_recording(file).episode.notes == ("joints are taken in Isaac's order, as BeyondMimic writes them",)
    convert(file, tmp_path / "out.csv")
    convert(file, tmp_path / "out.npz")
    expected = open_recording(file).episode.T_world_lhand
    for name in ("out.csv", "out.npz"):
        np.testing.assert_allclose(open_recording(tmp_path / name).episode.T_world_lhand, expected, atol=2e-6)


def test_a_rate_that_is_not_said_is_told(tmp_path):
    motion, notes = read_motion_npz(save(tmp_path, ARRAYS["phc"]), 30.0)
    assert motion.fps == 30.0
    assert "its rate is taken as 30 Hz" in notes[0]


def test_23_joints_are_read_and_the_others_are_told(tmp_path):
    names = [name for name in g1().body_joints if not name.endswith(("wrist_pitch_joint", "wrist_yaw_joint"))]
    names = [name for name in names if name not in ("waist_roll_joint", "waist_pitch_joint")]
    few = ARRAYS["phc"]["dof"][:, [g1().body_joints.index(name) for name in names]]
    motion, notes = read_motion_npz(save(tmp_path, ARRAYS["phc"] | {"dof": few[:, :, None]}), 30.0)
    assert any("6 joints are not in it and are at 0" in note for note in notes)
    np.testing.assert_array_equal(motion.q_body[:, [g1().body_joints.index(name) for name in names]], few)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"dof_pos": np.zeros((20, 21))}, "has 21 joints without 'dof_names'"),
        ({"root_rot": np.zeros((20, 4))}, "norm 0"),
        ({"root_pos": np.zeros((19, 3))}, "have the shapes"),
        ({"dof_pos": np.array("x")}, "is of type"),
        ({"fps": -1.0}, "its rate is -1"),
        ({"dof_pos": np.full((20, 29), np.nan)}, "is nan"),
    ],
)
def test_what_is_malformed_is_named(tmp_path, change, said):
    with pytest.raises(FileFormatError, match=said):
        open_recording(save(tmp_path, ARRAYS["gmr"] | change))


def test_an_object_is_never_unpickled(tmp_path):
    file = save(tmp_path, ARRAYS["gmr"] | {"dof_pos": np.array([{"a": 1}], dtype=object)})
    with pytest.raises(FileFormatError, match="never unpickled"):
        open_recording(file)


def test_a_person_is_no_robot(tmp_path):
    file = save(tmp_path, {"poses": np.zeros((5, 156)), "trans": np.zeros((5, 3)), "gender": np.array("male")})
    assert not is_motion_npz(file)
    with pytest.raises(PolicyError, match=r"motion of a person .SMPL., not of a G1: retarget it first"):
        open_recording(file)
