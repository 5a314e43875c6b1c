"""Poses of hands beside joints: a point 5 cm off the wrist is told with its offset, the wrist itself is not.

Strategy: sets with joints and the poses of GR00T-WholeBodyControl's exporter or Unitree's beside them, and sets of
wrists with measured joints; the offset is put in by the tests' own arithmetic, and the layout that the answer names
is held against it.
"""

import json

import numpy as np
import pytest

from policy import builtin
from policy.action_spec.codec import encode
from policy.action_spec.spec import ActionSpec
from policy.chunk import ActionChunk
from policy.dataset.conversion import DatasetSettings, convert_dataset
from policy.geometry.rotations import matrix_to_quaternion
from policy.geometry.se3 import inverse
from policy.recorded.dataset_replay import open_episode
from policy.suspicion.tool import tool_findings
from tests.support.other_forms import ANCHOR, JOINT28, rows
from tests.support.urdf_chain import link_pose
from tests.support.written_datasets import write_dataset

FRAMES = 40
Q = rows(JOINT28, FRAMES) + 0.4 * np.sin(0.15 * np.arange(FRAMES))[:, None] * np.array([1.0] * 14 + [0.0] * 14)


def wrists(offset=(0.0, 0.0, 0.0)):
    """Poses (n, 4, 4) in the pelvis of a point of each hand, by a forward kinematics of the tests' own."""
    T = {side: np.stack([link_pose(f"{side}_wrist_yaw_link", dict(zip(JOINT28, q, strict=True)) | WAIST) for q in Q])
         for side in ("left", "right")}  # fmt: skip
    for one in T.values():
        one[:, :3, 3] += one[:, :3, :3] @ np.array(offset)
    return T


WAIST = dict.fromkeys(("waist_yaw_joint", "waist_roll_joint", "waist_pitch_joint"), 0.0)


def eef(T):
    return np.hstack([np.hstack([T[s][:, :3, 3], matrix_to_quaternion(T[s][:, :3, :3], "wxyz")]) for s in T])


def joint_set(folder, features):
    one = {"action": Q, "observation.state": np.vstack([Q[:1], Q[:-1]]), **features}
    return write_dataset(folder, [one, one], {"action": JOINT28, "observation.state": JOINT28})


def told(folder, **settings):
    return [note for note in open_episode(folder, 0, **settings).episode.notes if "wrist_position is" in note]


@pytest.mark.parametrize("offset", [(0.05, 0.0, 0.0), (0.0, -0.05, 0.0), (0.03, 0.0, 0.04)])
def test_a_tool_beside_joints_is_told_with_its_offset(tmp_path, offset):
    folder = joint_set(tmp_path / "a", {"action.eef": eef(wrists(offset))})
    notes = told(folder)
    assert len(notes) == 2
    x, y, z = offset
    assert f'"tcp_offset": [{x:.3f}, {y:.3f}, {z:.3f}]' in notes[0]
    result = convert_dataset(folder, tmp_path / "out", DatasetSettings(check=False))
    assert any("5.0 cm from the wrist" in note for note in result.notes)


def test_the_wrist_itself_is_not_told(tmp_path):
    assert told(joint_set(tmp_path / "a", {"action.eef": eef(wrists())})) == []
    assert told(joint_set(tmp_path / "b", {})) == []


def test_one_hand_and_a_base_that_is_another_are_told_as_such(tmp_path):
    T = wrists()
    T["left"][:, :3, 3] += [0.0, 0.0, 0.3]
    values = np.hstack([T["left"][:, :3, 3], np.zeros((FRAMES, 3))])
    notes = told(joint_set(tmp_path / "a", {"action.left_ee": values}))
    assert ["along the axes of the pelvis" in note for note in notes] == [True]
    assert "left_wrist_position is 30.0 cm" in notes[0]


def test_wrists_with_measured_joints_are_looked_at_and_the_named_layout_ends_it(tmp_path):
    spec = builtin("wbc32-v1")
    T = {side: ANCHOR.T_world_base @ one for side, one in wrists((0.05, 0.0, 0.0)).items()}
    hands = [np.tile(q, (FRAMES, 1)) for q in (ANCHOR.q_lhand, ANCHOR.q_rhand)]
    chunk = ActionChunk(spec.id, 0, 0.0, 30.0, T["left"], T["right"], *hands)
    one = {"action": encode(spec, chunk, ANCHOR), "observation.state": np.vstack([Q[:1], Q[:-1]])}
    said = {"action_spec.json": spec.to_json()}
    folder = write_dataset(tmp_path / "a", [one], {"observation.state": JOINT28}, files=said)
    assert len(told(folder)) == 2
    data = json.loads(spec.to_json())
    data.pop("hash", None)
    for slot in data["slots"]:
        if slot["name"].endswith("_wrist_position"):
            slot["tcp_offset"] = [0.05, 0.0, 0.0]
    assert told(folder, assume=ActionSpec.from_json(json.dumps(data))) == []


def test_a_few_rows_tell_nothing():
    T = inverse(ANCHOR.T_world_base) @ np.tile(np.eye(4), (5, 1, 1))
    assert tool_findings("left", T, T[:, :3, 3] + 0.1) == []
