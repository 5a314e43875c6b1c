"""Datasets of joints to datasets of wrists: written by LeRobot, converted, and read back by LeRobot."""

import json
import shutil

import numpy as np
import pandas
import pytest
import torch
from lerobot.configs import FeatureType, NormalizationMode, PolicyFeature
from lerobot.datasets import LeRobotDataset
from lerobot.lerobot_types import TransitionKey
from lerobot.processor import NormalizerProcessorStep
from lerobot.processor.converters import create_transition
from lerobot.utils.feature_utils import dataset_to_policy_features

from policy.action_spec.builtin import builtin
from policy.action_spec.spec import ActionSpec
from policy.dataset.conversion import DatasetSettings, convert_dataset
from policy.dataset.joint_conversion import JointConversion
from policy.dataset.open import episode_numbers, open_dataset
from policy.dataset.stats import statistics
from policy.errors import DatasetError, SpecError
from tests.support.dataset_cases import IMAGE, LENGTHS, TASKS, VIDEO, image, joints_of, write_v21, write_v30
from tests.support.joint_cases import DEX1, DEX3

WBC32 = builtin("wbc32")
MM, HUNDREDTH_DEGREE = 1e-3, np.deg2rad(0.01)


@pytest.fixture(scope="module")
def v30(tmp_path_factory):
    return write_v30(tmp_path_factory.mktemp("v30") / "joints")


@pytest.fixture(scope="module")
def v21(tmp_path_factory, v30):
    return write_v21(tmp_path_factory.mktemp("v21") / "joints", v30)


@pytest.fixture(scope="module")
def converted(tmp_path_factory, v30):
    folder = tmp_path_factory.mktemp("out") / "wrists"
    return convert_dataset(v30, folder)


def loaded(folder, **settings):
    return LeRobotDataset("tests/wrists", root=folder, **settings)


def stats_of(folder):
    return json.loads((folder / "meta" / "stats.json").read_text())


def wrists_of(episode, which=0, **settings):
    return JointConversion(DEX3, WBC32, **settings).forward(joints_of(episode=episode)[which]).astype(np.float32)


def test_lerobot_reads_the_result_frame_by_frame(converted):
    dataset = loaded(converted.folder)
    assert (dataset.num_episodes, dataset.num_frames, dataset.fps) == (3, sum(LENGTHS), 30)
    at = 0
    for episode, length in enumerate(LENGTHS):
        action, state = wrists_of(episode), wrists_of(episode, 1)
        for i in (0, length - 1):
            item = dataset[at + i]
            assert np.array_equal(item["action"].numpy(), action[i])
            assert np.array_equal(item["observation.state"].numpy(), state[i])
            assert item["observation.velocity"].tolist() == [episode, i]
            assert item["task"] == TASKS[episode]
            assert item["index"].item() == at + i
            assert item["episode_index"].item() == episode
            assert abs(255.0 * item[VIDEO].mean().item() - image(episode, i).mean()) < 3.0
            assert abs(255.0 * item[IMAGE].mean().item() - image(episode, i).mean()) < 0.5
        at += length


def test_columns_are_named_as_the_layout_says(converted):
    features = loaded(converted.folder).features
    assert tuple(features["action"]["names"]) == WBC32.feature_names
    assert features["action"]["shape"] == (32,)
    assert features["action"]["info"]["provenance"] == "commanded"
    assert features["observation.state"]["info"]["provenance"] == "measured"
    assert features["action"]["info"]["hash"] == WBC32.hash


def test_chunks_of_the_result_are_chunks_of_wrists(converted):
    dataset = loaded(converted.folder, delta_timestamps={"action": [i / 30 for i in range(5)]})
    assert torch.equal(dataset[2]["action"], torch.from_numpy(wrists_of(0)[2:7]))


def test_videos_are_carried_over_byte_for_byte(converted, v30):
    for i in range(3):
        name = f"videos/{VIDEO}/chunk-000/file-{i:03d}.mp4"
        assert (converted.folder / name).read_bytes() == (v30 / name).read_bytes()


def test_the_way_back_is_within_the_bars(converted):
    for trip in converted.trips.values():
        assert trip.frames == sum(LENGTHS)
        assert trip.unreached == 0
        assert trip.position <= 0.1 * MM
        assert trip.rotation <= HUNDREDTH_DEGREE
        assert trip.fingers == 0.0


def test_provenance_and_assumptions_are_written_down(converted):
    said = json.loads((converted.folder / "meta" / "conversion.json").read_text())
    assert said["features"]["action"]["provenance"] == "commanded"
    assert said["features"]["observation.state"]["provenance"] == "measured"
    assert said["features"]["action"]["joints"] == list(DEX3.names)
    assert said["assumptions"]["waist_pitch_joint [rad]"] == 0.0
    assert "stand still" in said["assumptions"]["pelvis"]
    assert said["round_trip"]["action"]["within_bars"] is True
    assert str(converted.folder.parent) not in json.dumps(said)
    for file in ("action_spec.json", "state_spec.json"):
        assert ActionSpec.from_json((converted.folder / "meta" / file).read_text()).hash == WBC32.hash


def by_lerobot(stats, actions):
    """Actions as a policy that normalises by quantiles sees them in training."""
    step = NormalizerProcessorStep(
        features={"action": PolicyFeature(type=FeatureType.ACTION, shape=(actions.shape[1],))},
        norm_map={FeatureType.ACTION: NormalizationMode.QUANTILES},
        stats={"action": stats["action"]},
    )
    return step(create_transition(action=actions))[TransitionKey.ACTION]


def test_quantiles_are_those_of_all_frames_and_lerobots_are_not(tmp_path, v30):
    """LeRobot 0.6.1 averages the quantiles of episodes: where episodes differ, its q01 and q99 are too narrow."""

    def spread(action, state, episode):
        action, state = action.copy(), state.copy()
        action[:, 3] = state[:, 3] = 0.2 + 0.4 * episode + 0.01 * np.arange(len(action)) / len(action)
        return action, state

    source = write_v30(tmp_path / "joints", cameras=False, change=spread)
    elbow = np.concatenate([spread(*joints_of(episode=e), e)[0][:, 3] for e in range(3)])
    stored = stats_of(source)["action"]
    true = np.quantile(elbow.astype(float), [0.01, 0.99])
    assert stored["q99"][3] < true[1] - 0.2
    assert stored["q01"][3] > true[0] + 0.2
    converted = convert_dataset(source, tmp_path / "wrists", DatasetSettings(keep_joints=True, check=False))
    kept = stats_of(converted.folder)["source.action"]
    assert np.allclose([kept["q01"][3], kept["q99"][3]], true, atol=1e-6)
    dataset = loaded(converted.folder)
    action = np.stack([dataset[i]["action"].numpy() for i in range(sum(LENGTHS))])
    found = stats_of(converted.folder)["action"]
    for name, value in statistics(action).items():
        assert np.allclose(found[name], value, atol=1e-7)
    normalised = by_lerobot(dataset.meta.stats, torch.from_numpy(action))
    # 1 % of 35 frames is less than one frame: at each end of each number, one is outside.
    assert ((normalised.abs() > 1.0 + 1e-5).sum(dim=0) <= 2).all()
    joints = np.concatenate([spread(*joints_of(episode=e), e)[0] for e in range(3)])
    before = by_lerobot({"action": {name: np.array(x) for name, x in stored.items()}}, torch.from_numpy(joints))
    assert (before[:, 3].abs() > 1.5).float().mean() > 0.5


def test_statistics_of_cameras_are_carried_over_and_numbering_is_counted_anew(converted, v30):
    before, after = stats_of(v30), stats_of(converted.folder)
    for key in (VIDEO, IMAGE):
        assert after[key] == before[key]
    assert after["index"]["max"] == [sum(LENGTHS) - 1]
    assert after["episode_index"]["max"] == [2]
    assert set(after) == set(before)


def test_v21_gives_the_same_rows_and_videos_as_v30(tmp_path, v21, converted):
    result = convert_dataset(v21, tmp_path / "wrists")
    one, other = loaded(result.folder), loaded(converted.folder)
    for i in (0, 11, 12, 20, 21, sum(LENGTHS) - 1):
        a, b = one[i], other[i]
        assert a["task"] == b["task"]
        for key in ("action", "observation.state", "timestamp", VIDEO, IMAGE):
            assert torch.equal(a[key], b[key])
    stats, same = stats_of(result.folder), stats_of(converted.folder)
    assert np.allclose(stats[VIDEO]["mean"], same[VIDEO]["mean"], atol=1e-6)
    assert stats["action"] == same["action"]
    info = json.loads((result.folder / "meta" / "info.json").read_text())
    assert info["codebase_version"] == "v3.0"
    assert not {"total_chunks", "total_videos"} & set(info)


def test_lerobots_own_converter_understands_the_v21_folder_of_these_tests(tmp_path, v21):
    from lerobot.scripts.convert_dataset_v21_to_v30 import convert_dataset as upgrade

    root = tmp_path / "joints"
    shutil.copytree(v21, root)
    upgrade("tests/joints", root=root, push_to_hub=False)
    item = LeRobotDataset("tests/joints", root=root)[13]
    assert np.array_equal(item["action"].numpy(), joints_of(episode=1)[0][1])
    assert convert_dataset(root, tmp_path / "wrists", DatasetSettings(check=False)).source.version == "v3.0"


def test_v20_with_statistics_of_the_whole_is_read_too(tmp_path, v30):
    source = write_v21(tmp_path / "joints", v30, version="v2.0")
    (source / "meta" / "episodes_stats.jsonl").unlink()
    shutil.copy(v30 / "meta" / "stats.json", source / "meta" / "stats.json")
    result = convert_dataset(source, tmp_path / "wrists", DatasetSettings(check=False))
    assert len(loaded(result.folder)) == sum(LENGTHS)


def test_chosen_episodes_are_numbered_anew_with_their_own_videos(tmp_path, v30):
    result = convert_dataset(v30, tmp_path / "wrists", DatasetSettings(episodes=(0, 2), check=False))
    dataset = loaded(result.folder)
    item = dataset[LENGTHS[0] + 3]
    assert (dataset.num_episodes, item["episode_index"].item(), item["index"].item()) == (2, 1, LENGTHS[0] + 3)
    assert np.array_equal(item["action"].numpy(), wrists_of(2)[3])
    assert abs(255.0 * item[VIDEO].mean().item() - image(2, 3).mean()) < 3.0
    assert len(list((result.folder / "videos").rglob("*.mp4"))) == 2
    assert any("all episodes of the source" in note for note in result.notes)
    assert stats_of(result.folder)["episode_index"]["max"] == [1]


def test_the_waist_that_is_stated_moves_the_wrists_and_is_recorded(tmp_path, v30):
    result = convert_dataset(v30, tmp_path / "wrists", DatasetSettings(waist=(0.3, 0.0, 0.1), check=False))
    assert result.assumptions["waist_yaw_joint [rad]"] == 0.3
    assert np.array_equal(loaded(result.folder)[0]["action"].numpy(), wrists_of(0, waist=(0.3, 0.0, 0.1))[0])


def test_kept_joints_are_no_input_or_output_of_policies(tmp_path, v30):
    result = convert_dataset(v30, tmp_path / "wrists", DatasetSettings(keep_joints=True, check=False))
    dataset = loaded(result.folder)
    assert np.array_equal(dataset[5]["source.action"].numpy(), joints_of()[0][5])
    assert np.array_equal(dataset[5]["source.observation.state"].numpy(), joints_of()[1][5])
    known = dataset_to_policy_features(dataset.features)
    assert not any(key.startswith("source.") for key in known)


def test_another_rate_is_part_of_the_layout(tmp_path):
    source = write_v30(tmp_path / "joints", fps=20, cameras=False)
    result = convert_dataset(source, tmp_path / "wrists", DatasetSettings(check=False))
    assert result.spec.fps == 20.0
    assert result.spec.hash != WBC32.hash


def test_degrees_are_converted_when_the_unit_is_said(tmp_path, v30, converted):
    source = write_v30(tmp_path / "joints", cameras=False, change=lambda a, s, _: (np.rad2deg(a), np.rad2deg(s)))
    with pytest.raises(DatasetError, match=r"episode \d, frame \d+: .*look like degrees, say --unit deg"):
        convert_dataset(source, tmp_path / "wrists")
    result = convert_dataset(source, tmp_path / "wrists", DatasetSettings(unit="deg"))
    assert np.allclose(loaded(result.folder)[4]["action"], wrists_of(0)[4], atol=1e-6)
    assert result.trips["action"].fingers < 1e-4


def test_grippers_go_to_wbc27_and_to_wbc32_only_by_a_named_synergy(tmp_path):
    source = write_v30(tmp_path / "joints", DEX1, cameras=False)
    with pytest.raises(DatasetError, match="--synergy dex3_open_close, or keep the hands as they are with --to wbc27"):
        convert_dataset(source, tmp_path / "wrists")
    result = convert_dataset(source, tmp_path / "wbc27", DatasetSettings(to="wbc27", least_range=0.01))
    assert loaded(result.folder)[0]["action"].shape == (27,)
    assert result.trips["action"].position <= 0.1 * MM
    assert any("base_velocity_vx.vel" in note and "widened to 0.01" in note for note in result.notes)
    found = stats_of(result.folder)["action"]
    assert min(np.subtract(found["q99"], found["q01"])) >= 0.01 - 1e-12
    result = convert_dataset(source, tmp_path / "wbc32", DatasetSettings(synergy="dex3_open_close", check=False))
    assert result.assumptions["synergy"] == "dex3_open_close"


def test_numbers_that_hardly_move_are_named(tmp_path):
    def still(action, state, _):
        action = action.copy()
        action[:, 14] = 0.25
        return action, state

    source = write_v30(tmp_path / "joints", cameras=False, change=still)
    result = convert_dataset(source, tmp_path / "wrists", DatasetSettings(check=False))
    (note,) = [note for note in result.notes if "hardly move" in note]
    assert note.startswith("action: left_hand_thumb_0.pos hardly move")


def test_hard_links_save_the_space_of_videos(tmp_path, v30):
    result = convert_dataset(v30, tmp_path / "wrists", DatasetSettings(link_videos=True, check=False))
    name = f"videos/{VIDEO}/chunk-000/file-000.mp4"
    assert (result.folder / name).samefile(v30 / name)


def test_what_was_said_of_an_episode_stays(tmp_path, v30):
    source = tmp_path / "joints"
    shutil.copytree(v30, source)
    file = source / "meta/episodes/chunk-000/file-000.parquet"
    table = pandas.read_parquet(file)
    table["success"] = [True, False, True]
    table.to_parquet(file)
    result = convert_dataset(source, tmp_path / "wrists", DatasetSettings(check=False))
    assert [episode.extra["success"] for episode in open_dataset(result.folder).episodes] == [True, False, True]


def test_a_result_is_not_converted_twice(converted, tmp_path):
    with pytest.raises(DatasetError, match="is in the layout wbc32 already"):
        convert_dataset(converted.folder, tmp_path / "again")


def test_a_layout_of_joints_is_no_target(v30, tmp_path):
    with pytest.raises(SpecError, match="such as wbc32"):
        convert_dataset(v30, tmp_path / "out", DatasetSettings(to="joint28"))


@pytest.mark.parametrize(("text", "numbers"), [("3", (3,)), ("0-2,5", (0, 1, 2, 5)), (" 1 , 4-4", (1, 4))])
def test_episodes_are_numbers_and_ranges(text, numbers):
    assert episode_numbers(text) == numbers


@pytest.mark.parametrize("text", ["", "a", "3-1", "1,,2", "-1", "1-2-3"])
def test_other_texts_are_no_episodes(text):
    with pytest.raises(DatasetError, match="such as 0-3,7"):
        episode_numbers(text)
