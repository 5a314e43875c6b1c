"""Headers of public G1 datasets, and others of their kinds: every column is what its name and place say.

Strategy: `tests.support.public_headers` writes each header as a folder, its columns filled from joint angles by
name; what each column is comes from the header's source, written out here. What is read must put the wrists where a
forward kinematics of the tests' own does. What cannot be read names one thing to add to the command, which then works.
"""

import json
import re

import numpy as np
import pytest

from policy import builtin
from policy.dataset.checks import column_layout
from policy.dataset.conversion import DatasetSettings, convert_dataset
from policy.dataset.naming.meaning import meaning
from policy.dataset.naming.sources import find_source
from policy.dataset.open import open_dataset
from policy.errors import DatasetError, PolicyError
from policy.recorded.dataset_replay import open_episode
from tests.support.public_headers import ANCHOR, HEADERS, NEUTRAL, STANCE, WAIST, written
from tests.support.urdf_chain import link_pose, sole_middle
from tests.support.written_datasets import write_dataset


@pytest.mark.parametrize("header", HEADERS)
def test_wrists_are_where_the_names_put_them(tmp_path, header):
    folder, postures = written(tmp_path / "set", header)
    policy = open_episode(folder, 1)
    chunk = policy.episode
    assert policy.spec.fps == open_dataset(folder).fps == chunk.fps
    for k, posture in enumerate(postures):
        pelvis = ANCHOR.T_world_base @ sole_middle(STANCE) @ np.linalg.inv(sole_middle(posture))
        for side, T in (("left", chunk.T_world_lhand), ("right", chunk.T_world_rhand)):
            waist = posture if chunk.q_waist is not None else posture | {name: STANCE[name] for name in WAIST}
            np.testing.assert_allclose(T[k], pelvis @ link_pose(f"{side}_wrist_yaw_link", waist), atol=2e-6)


@pytest.mark.parametrize("header", HEADERS)
def test_each_column_is_its_joint_or_left_out_aloud(tmp_path, header):
    folder, _ = written(tmp_path / "set", header)
    dataset = open_dataset(folder)
    for key in ("action", "observation.state"):
        source = find_source(dataset, key)
        layout = column_layout(dataset, source)
        used = {name for name in layout.names if name}
        expected = {name for columns, _ in HEADERS[header][0].values() for name in columns if name}
        assert used == expected
        assert all(bool(name) != bool(reason) for name, reason in zip(layout.names, layout.reasons, strict=True))
        assert len(source.features) > 1 or source.features[0] in dataset.features


def test_what_is_left_out_is_said_in_the_answer(tmp_path):
    notes = open_episode(written(tmp_path / "a", "all split, names twice")[0], 0).episode.notes
    assert any("'kLeftEEX', 'kLeftEEY'" in note and "a pose of the hand" in note for note in notes)
    assert any("'action.body.kLeftShoulderPitch'" in note and "another feature has too" in note for note in notes)
    notes = open_episode(written(tmp_path / "b", "43 without names, modality.json")[0], 0).episode.notes
    assert any("modality.json says which columns are which part" in note for note in notes)
    assert any("index, middle, thumb" in note for note in notes)
    assert "there are no hands in it: fingers stay as they are" in open_episode(
        written(tmp_path / "c", "23 joints")[0], 0).episode.notes  # fmt: skip


@pytest.mark.parametrize(
    ("episode", "names", "assume"),
    [
        (
            {"actions": np.zeros((5, 34)), "state": np.zeros((5, 34))},
            {"actions": ["actions"], "state": ["state"]},
            "openhlm34",
        ),
        ({"action": np.zeros((5, 43)), "action.eef": np.zeros((5, 14))}, {}, "decoupled_wbc43"),
        ({f"action_{i}": np.zeros((5, 1)) for i in range(28)}, {}, "joint28"),
        ({"action": np.zeros((5, 26))}, {"action": [f"motor_{i}" for i in range(26)]}, "inspire26"),
    ],
)
def test_numbers_without_names_name_the_option_that_reads_them(tmp_path, episode, names, assume):
    folder = write_dataset(tmp_path / "set", [episode], names)
    with pytest.raises(DatasetError, match="without names") as refused:
        open_episode(folder, 0)
    named = re.search(r"--assume-spec (\w+)", str(refused.value))[1]
    assert named == assume
    assert len(open_episode(folder, 0, assume=builtin(named)).episode) == 5


def test_legs_that_step_are_refused_and_the_option_judges_the_hands(tmp_path):
    features, settings = HEADERS["43 in Pinocchio's order"]
    columns, names = features["action"]
    values = np.array([[NEUTRAL.get(name, STANCE.get(name, 0.0)) for name in columns]] * 20)
    values[10:, columns.index("left_hip_pitch_joint")] -= 0.4
    folder = write_dataset(tmp_path / "set", [{"action": values}], {"action": names}, **settings)
    with pytest.raises(PolicyError, match=r"ask for a step: at step 10.*--read-as hands_only"):
        open_episode(folder, 0)
    chunk = open_episode(folder, 0, read_as=["hands_only"]).episode
    assert "left_leg is ignored: hands alone are judged, as --read-as says" in chunk.notes
    np.testing.assert_allclose(chunk.T_world_lhand[-1], chunk.T_world_lhand[0], atol=1e-9)


ARMS = [f"{side}_{joint}_joint" for side in ("left", "right") for joint in (
    "shoulder_pitch", "shoulder_roll", "shoulder_yaw", "elbow", "wrist_roll", "wrist_pitch", "wrist_yaw")]  # fmt: skip


@pytest.mark.parametrize(
    ("features", "names"),
    [
        ([f"action.{name.removesuffix('_joint')}.pos" for name in ARMS], None),
        (["action"], [f"{side}_arm_{i}" for side in ("left", "right") for i in range(7)]),
        (["action"], {str(i): name for i, name in enumerate(ARMS)}),
        (["action"], [f"main_{name.removesuffix('_joint')}_target" for name in ARMS]),
    ],
)
def test_a_joint_is_known_as_a_feature_by_its_number_and_among_other_words(tmp_path, features, names):
    values = np.array([[STANCE[name] + 0.1 * i for i, name in enumerate(ARMS)]] * 5)
    episode = dict(zip(features, np.split(values, len(features), axis=1), strict=True))
    folder = write_dataset(tmp_path / "set", [episode], {} if names is None else {"action": names})
    layout = column_layout(open_dataset(folder), find_source(open_dataset(folder), "action"))
    assert list(layout.names) == ARMS
    notes = open_episode(folder, 0, read_as=["as_named"]).episode.notes
    numbered = any(
        "'left_arm', 'right_arm' are numbered, not named: joints are taken in motor order" in n for n in notes
    )
    assert numbered == (names is not None and "left_arm_0" in names)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda i: i.pop("data_path"), "does not say where files are: data_path"),
        (lambda i: i.pop("codebase_version"), "codebase_version None; v3.0, v2.1, v2.0 are read: write the one"),
        (lambda i: i.update(codebase_version="v1.6"), "LeRobot's own converters"),
        (lambda i: i["features"]["action"].pop("shape"), "the feature 'action' without dtype or shape"),
        (lambda i: i["features"]["action"].update(shape=[1, 14]), r"shape \[1, 14\]; a vector is expected"),
        (lambda i: i["features"]["action"].update(dtype="int32"), "has the dtype int32; float16 or float32"),
        (lambda i: i["features"]["action"].update(names=[*ARMS[:-1], "left_hand_open"]),
         "'left_hand_open'.*correct it in meta/info.json.*--assume-spec .*layouts with 14 numbers: .*joint14"),
        (lambda i: i["features"]["action"].update(names=[f"{s}_ee_{c}" for s in ("left", "right") for c in "abcdefg"]),
         "has no joints .*a pose of the hand.*--assume-spec decoupled_wbc_eef14"),
        (lambda i: i["features"]["action"].update(names=[*ARMS[:-1], ARMS[0]]), "two columns for.*correct the names"),
    ],
)  # fmt: skip
def test_a_header_that_is_not_read_is_answered_with_what_mends_it(tmp_path, change, said):
    folder = write_dataset(tmp_path / "set", [{"action": np.zeros((5, 14))}], {"action": ARMS})
    info = json.loads((folder / "meta/info.json").read_text())
    change(info)
    (folder / "meta/info.json").write_text(json.dumps(info))
    with pytest.raises(DatasetError, match=said):
        open_episode(folder, 0)


def test_parts_that_overlap_or_leave_a_number_out_are_refused(tmp_path):
    said = {"action": {"left_arm": {"start": 0, "end": 7}, "right_arm": {"start": 6, "end": 13}}}
    folder = write_dataset(tmp_path / "a", [{"action": np.zeros((3, 14))}], files={"modality.json": json.dumps(said)})
    with pytest.raises(DatasetError, match="another part is already"):
        open_episode(folder, 0)
    folder = write_dataset(tmp_path / "b", [{f"action_{i}": np.zeros((3, 1)) for i in (0, 2)}])
    with pytest.raises(DatasetError, match="none with 1"):
        open_episode(folder, 0)


def test_counts_of_a_foreign_hand_are_no_closing_numbers(tmp_path):
    features, _ = HEADERS["inspire, hands last"]
    columns, names = features["action"]
    values = np.array([[STANCE.get(name, 700.0) for name in columns]] * 3)
    with pytest.raises(PolicyError, match=r"left_hand_pinky.pos\) goes from 700 to 700; fingers of Inspire"):
        open_episode(write_dataset(tmp_path / "set", [{"action": values}], {"action": names}), 0)


@pytest.mark.parametrize("header", ["all split, names twice", "inspire, by side", "dex1, split, no side, yaw first"])
def test_split_and_foreign_sets_become_wrists_with_what_was_left_out_on_record(tmp_path, header):
    folder, _ = written(tmp_path / "set", header)
    done = convert_dataset(
        folder, tmp_path / "wrists", DatasetSettings(to="wbc32", synergy="dex3_open_close", keep_joints=True)
    )
    again = open_dataset(tmp_path / "wrists")
    assert set(again.features) >= {"action", "observation.state", *(f"source.{key}" for key in HEADERS[header][0])}
    assert not [key for key in again.features if key.startswith(("action.", "observation.state."))]
    said = json.loads((tmp_path / "wrists/meta/conversion.json").read_text())["features"]["action"]
    assert said["features"] == list(HEADERS[header][0])
    assert bool(said["left_out"]) == ("twice" in header)
    before, after = open_episode(folder, 0).episode, open_episode(tmp_path / "wrists", 0).episode
    assert done.trips["action"].position < 1e-4
    # Legs say where the pelvis is, which a dataset of wrists in the pelvis cannot.
    np.testing.assert_allclose(after.T_world_lhand[:, :3, 3], before.T_world_lhand[:, :3, 3], atol=1e-5)


@pytest.mark.parametrize(
    ("name", "part", "expected"),
    [
        ("dof_vel.left_knee_joint", "", "a velocity"), ("left_elbow_joint.tau", "", "a torque"),
        ("base_height", "", "of the base"), ("left_hand_3", "left_hand", "of a hand that is not named"),
        ("shoulder_pitch", "left_arm", "left_shoulder_pitch_joint"), ("L_Elbow", "", "left_elbow_joint"),
        ("arms/left/shoulder_pitch_joint", "", "left_shoulder_pitch_joint"), ("elbow_right", "", "right_elbow_joint"),
        ("left_arm_elbow_cmd", "", "left_elbow_joint"), ("left_elbow_joint (rad)", "", "left_elbow_joint"),
        ("robot0:left_hand_thumb_0", "", "left_hand_thumb_0_joint"), ("left_elbow_error", "", ""),
        ("left_elbow_deg", "", ""), ("left_right_elbow", "", ""), ("left_leg_knee_vel", "", "a velocity"),
        ("elbow", "", ""), ("torso_height", "", "of the base"), ("kWaistYaw", "", "waist_yaw_joint"),
    ],
)  # fmt: skip
def test_a_name_means_a_joint_or_a_reason_or_nothing(name, part, expected):
    found = meaning(name, part)
    assert (found.name or found.reason).startswith(expected)
    assert bool(found.name or found.reason) == bool(expected)


def test_actions_can_be_what_the_robot_did(tmp_path):
    folder, postures = written(tmp_path / "set", "lerobot's own", frames=6)
    convert_dataset(folder, tmp_path / "did", DatasetSettings(to="wbc32", action="executed"))
    convert_dataset(folder, tmp_path / "asked", DatasetSettings(to="wbc32"))
    did, asked = (open_dataset(tmp_path / name) for name in ("did", "asked"))
    values = {name: next(iter(did.numbers(name))) for name in ("action", "observation.state", "source.requested")}
    np.testing.assert_array_equal(values["action"][:-1], values["observation.state"][1:])
    np.testing.assert_array_equal(values["action"][-1], values["observation.state"][-1])
    np.testing.assert_array_equal(values["source.requested"], next(iter(asked.numbers("action"))))
    assert did.features["action"]["info"]["provenance"] == "measured, a row later"
    assert did.features["source.requested"]["info"]["provenance"] == "commanded"
    assert len(postures) == 6
    with pytest.raises(DatasetError, match="possible: requested, executed"):
        convert_dataset(folder, tmp_path / "x", DatasetSettings(action="neither"))
