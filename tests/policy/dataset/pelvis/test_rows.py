"""Wrists that LeRobot recorded step by step, each in the pelvis of its own step.

Strategy: a robot whose hands stay where they are while its pelvis comes down by 0.2 m, leans and sways on planted feet.
In the stance its rows are constant, whatever was recorded; what is not so is off by what the pelvis moved.
"""

import dataclasses
import json

import numpy as np
import pytest
from lerobot.datasets import LeRobotDataset

from models import g1
from policy import Anchor, ChunkError, builtin, decode, encode
from policy.action_spec.state import state_layout
from policy.dataset.conversion import DatasetSettings, convert_dataset
from policy.dataset.open import open_dataset
from policy.dataset.pelvis.legs import recorded_legs
from policy.dataset.pelvis.rows import decode_rows, encode_rows
from policy.errors import DatasetError
from policy.geometry.rotations import rpy_to_matrix
from policy.geometry.se3 import inverse, make_transform
from policy.kinematics.forward import kinematics
from policy.kinematics.inverse import leg_joints
from policy.recorded.dataset_replay import open_episode
from tests.support.policy_cases import wandering_chunk

FIRST, STANCE = builtin("wbc32-v1"), builtin("wbc32")
ROWS = 25
NAMES = g1().joint_names


def squatting(rows=ROWS):
    """Anchors of a robot on planted feet, its stance the origin of world."""
    nominal, share = Anchor.nominal(), np.linspace(0.0, 1.0, rows)
    soles, anchors = kinematics().soles(nominal.q_body[None]), []
    for s in share:
        R = rpy_to_matrix(np.array([0.05 * s, 0.5 * s, -0.03 * s]))
        T = make_transform(R, nominal.T_world_base[:3, 3] + s * np.array([-0.05, 0.01, -0.2]))
        to_base = inverse(T) @ nominal.T_world_base
        q = leg_joints({side: to_base @ sole[0] for side, sole in soles.items()}, nominal.q_body)
        anchors.append(Anchor(T, q, nominal.q_lhand, nominal.q_rhand))
    return anchors


@pytest.fixture(scope="module")
def recorded():
    """Anchors, and a chunk that holds both hands still."""
    anchors, still = squatting(), wandering_chunk(Anchor.nominal(), steps=1)
    columns = {name: np.repeat(x, ROWS, axis=0) for name, x in vars(still).items() if isinstance(x, np.ndarray)}
    return anchors, dataclasses.replace(still, **columns)


def test_rows_are_decoded_with_the_pelvis_of_each(recorded):
    anchors, chunk = recorded
    rows = encode_rows(FIRST, chunk, anchors)
    found = decode_rows(FIRST, rows, anchors, seq=3, fps=10.0)
    assert (found.seq, found.fps, len(found)) == (3, 10.0, ROWS)
    assert np.abs(found.T_world_lhand - chunk.T_world_lhand).max() < 1e-9
    # Decoded in one pelvis they are off by what it moved.
    taken_along = decode(FIRST, rows, anchors[0]).T_world_lhand[:, :3, 3] - chunk.T_world_lhand[:, :3, 3]
    assert np.linalg.norm(taken_along, axis=1).max() > 0.15
    # In the stance there is nothing to choose.
    assert np.abs(encode_rows(STANCE, chunk, anchors) - encode(STANCE, chunk, Anchor.nominal())).max() < 1e-6


def test_legs_alone_say_where_the_pelvis_was(recorded):
    anchors, _ = recorded
    found = Anchor.standing(np.stack([anchor.q_body for anchor in anchors]))
    assert max(np.abs(a.T_world_base - b.T_world_base).max() for a, b in zip(found, anchors, strict=True)) < 1e-5
    assert max(np.abs(anchor.T_world_stance - np.eye(4)).max() for anchor in anchors) < 1e-5


def test_anchors_are_as_many_as_rows(recorded):
    anchors, chunk = recorded
    rows = encode_rows(FIRST, chunk, anchors)
    with pytest.raises(ChunkError, match="24 anchors for 25 rows"):
        decode_rows(FIRST, rows, anchors[1:])
    rows[7, 3:9] = 0.0
    with pytest.raises(ChunkError, match="row 7: left_wrist_rotation"):
        decode_rows(FIRST, rows, anchors)


def dataset(folder, recorded, *, state="joints", spec=FIRST, change=lambda q: q):
    """An episode in the first wbc32 as a plugin records it: actions in each row's pelvis, states as they are called."""
    anchors, chunk = recorded
    q = np.stack([np.concatenate([a.q_body, a.q_lhand, a.q_rhand]) for a in anchors])
    rows = {"action": encode_rows(spec, chunk, anchors)}
    names = {"action": list(spec.feature_names)}
    if state == "joints":
        rows["observation.state"], names["observation.state"] = change(q), list(NAMES)
    else:
        rows["observation.state"], names["observation.state"] = rows["action"], names["action"]
    if state == "wrists and joints":
        rows["observation.joints"], names["observation.joints"] = change(q), list(NAMES)
    features = {key: {"dtype": "float32", "shape": (len(n),), "names": n} for key, n in names.items()}
    made = LeRobotDataset.create("tests/own", 30, features, root=folder)
    for k in range(ROWS):
        made.add_frame({key: x[k].astype(np.float32) for key, x in rows.items()} | {"task": "hold"})
    made.save_episode()
    made.finalize()
    (folder / "meta" / "action_spec.json").write_text(spec.to_json())
    return folder


def actions_of(folder, key="action"):
    return np.concatenate(list(open_dataset(folder).numbers(key)))


@pytest.mark.parametrize("state", ["joints", "wrists and joints"])
def test_convert_brings_rows_of_moving_pelvises_into_the_stance(tmp_path, recorded, state):
    source = dataset(tmp_path / "first", recorded, state=state)
    result = convert_dataset(source, tmp_path / "second", DatasetSettings(check=False))
    found = actions_of(result.folder)
    assert np.abs(found - encode(STANCE, recorded[1], Anchor.nominal())).max() < 1e-5
    assert "by its legs" in result.assumptions["pelvis"]
    said = json.loads((result.folder / "meta" / "conversion.json").read_text())
    assert said["layout"]["id"] == STANCE.id
    assert said["features"]["action"]["layout_in_source"] == f"{FIRST.id}, wrists in the pelvis"
    states = actions_of(result.folder, "observation.state")
    layout = state_layout(STANCE)
    assert states.shape == (ROWS, layout.dim)
    heights = [anchor.T_world_base[2, 3] for anchor in recorded[0]]
    assert np.abs(states[:, layout.slot("base_height").start] - heights).max() < 1e-5
    assert np.abs(states[:, layout.slot("base_tilt").start + 1] - np.linspace(0.0, 0.5, ROWS)).max() < 1e-5


def test_without_legs_the_pelvis_is_taken_to_stand_and_that_is_said(tmp_path, recorded):
    source = dataset(tmp_path / "first", recorded, state="wrists")
    result = convert_dataset(source, tmp_path / "second", DatasetSettings(check=False))
    assert "nothing says how it moved" in result.assumptions["pelvis"]
    rows = actions_of(source)
    expected = encode(STANCE, decode(FIRST, rows, Anchor.nominal()), Anchor.nominal())
    assert np.abs(actions_of(result.folder) - expected).max() < 1e-5
    # What nobody measured is not in the state.
    assert actions_of(result.folder, "observation.state").shape == (ROWS, 32)


def test_an_episode_is_played_where_it_was_recorded(tmp_path, recorded):
    source = dataset(tmp_path / "first", recorded)
    chunk = open_episode(source, 0).infer(Anchor.nominal().observation())
    assert np.abs(chunk.T_world_lhand[:, :3, 3] - recorded[1].T_world_lhand[0, :3, 3]).max() < 1e-5


def test_a_foot_in_the_air_does_not_say_where_the_pelvis_is(tmp_path, recorded):
    def lifted(q):
        q = q.copy()
        q[9, NAMES.index("left_knee_joint")] += 0.5
        return q

    source = dataset(tmp_path / "first", recorded, change=lifted)
    with pytest.raises(DatasetError, match=r"episode 0, frame 9: the soles are .* leave the episode out"):
        convert_dataset(source, tmp_path / "second")
    assert recorded_legs(open_dataset(source)).feature == "observation.state"
