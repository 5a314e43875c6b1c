"""`wholebody spec`, and what users name as checkpoints: training runs, hub ids, policies of other robots.

Strategy: a tiny real ACT with LeRobot's own 100 steps a chunk, saved as training saves it, in the folders of a run.
"""

import dataclasses
import json
import shutil

import pytest
from lerobot.configs import FeatureType, PolicyFeature
from typer.testing import CliRunner

from policy.action_spec.builtin import builtin
from policy.errors import PolicyError
from policy.findings import CheckpointError
from policy.lerobot.features import check_features
from policy.lerobot.fit import fit_layouts
from policy.lerobot.folder import checkpoint_folder
from policy.lerobot.policy import LeRobotPolicy
from policy.lerobot.spec import ACTION_SPEC_FILE, write_specs
from policy.lerobot.stats import ACTION, STATE
from tests.support import tiny_policies as tiny
from wholebody.cli.main import app
from wholebody.cli.sources import is_checkpoint, open_source

WBC32 = builtin("wbc32-v1")


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    """A training run's folder, in which nothing says what the numbers are."""
    run = tmp_path_factory.mktemp("train") / "run"
    folder = run / "checkpoints" / "000100" / "pretrained_model"
    tiny.write_checkpoint("act", folder, with_spec=False, chunk_size=100, n_action_steps=100)
    (run / "checkpoints" / "last").symlink_to("000100")
    return run


@pytest.fixture
def run(trained, tmp_path):
    return shutil.copytree(trained, tmp_path / "run", symlinks=True)


def dataset(folder, *, fps=15, names=None, spec=None):
    """What a dataset says of itself."""
    names = list(WBC32.feature_names) if names is None else names
    features = {key: {"dtype": "float32", "shape": [len(names)], "names": names} for key in (ACTION, STATE)}
    (folder / "meta").mkdir(parents=True)
    (folder / "meta" / "info.json").write_text(json.dumps({"fps": fps, "features": features}))
    if spec is not None:
        write_specs(folder / "meta", spec)
    return folder


def wholebody(*arguments):
    return CliRunner().invoke(app, [str(argument) for argument in arguments], catch_exceptions=False)


def test_a_layout_of_50_steps_beside_an_act_of_100_is_refused_with_the_command_that_writes_its_own(run):
    """The documented way ended in a file whose hash nobody could compute."""
    folder = checkpoint_folder(run)
    write_specs(folder, WBC32)
    with pytest.raises(CheckpointError, match=r"have 100 steps; 'wbc32' says 50; wholebody spec CHECKPOINT --layout"):
        LeRobotPolicy.from_pretrained(run)
    file = folder / ACTION_SPEC_FILE
    file.write_text(json.dumps(json.loads(file.read_text()) | {"horizon": 100}))
    with pytest.raises(CheckpointError, match="it was edited"):
        LeRobotPolicy.from_pretrained(run)


def test_c3_spec_writes_layouts_with_the_checkpoints_own_steps_and_its_datasets_rate(run, tmp_path):
    done = wholebody("spec", run, "--layout", "wbc32-v1", "--from", dataset(tmp_path / "data"))
    folder = run / "checkpoints" / "last" / "pretrained_model"
    assert f"wrote {folder / ACTION_SPEC_FILE}: wbc32-v1-" in done.stdout
    assert "100 steps of 32 numbers at 15 Hz" in done.stdout
    assert done.stderr == ""
    policy = LeRobotPolicy.from_pretrained(run)
    assert policy.spec == dataclasses.replace(WBC32, horizon=100, fps=15.0)
    assert policy.infer(tiny.observation()).fps == 15.0
    assert wholebody("doctor", run).exit_code == 0


def test_without_a_dataset_the_rate_is_the_layouts_and_said_to_be(run):
    done = wholebody("spec", run, "--layout", "wbc32-v1")
    assert "30 Hz is taken from 'wbc32'" in done.stderr
    assert wholebody("spec", run, "--layout", "wbc32-v1", "--fps", "10").stderr == ""
    assert LeRobotPolicy.from_pretrained(run, spec=dataclasses.replace(WBC32, fps=10.0)).spec.horizon == 100


def test_a_converted_dataset_says_the_layout_itself(run, tmp_path):
    mine = dataclasses.replace(WBC32, name="mine", fps=15.0)
    wholebody("spec", run, "--from", dataset(tmp_path / "data", spec=mine))
    assert LeRobotPolicy.from_pretrained(run).spec == dataclasses.replace(mine, horizon=100)
    with pytest.raises(PolicyError, match=r"action_spec\.json is missing"):
        fit_layouts(run, dataset=dataset(tmp_path / "bare"))
    with pytest.raises(PolicyError, match="name their layout"):
        fit_layouts(run)


def test_what_does_not_fit_is_refused_and_nothing_is_written(run, tmp_path):
    with pytest.raises(CheckpointError, match="action has 32 numbers; layout 'joint28' has 28"):
        fit_layouts(run, builtin("joint28"))
    with pytest.raises(CheckpointError, match=r"observation\.state has 32 numbers; layout 'joint28' has 28"):
        fit_layouts(run, WBC32, state=builtin("joint28"))
    swapped = list(WBC32.feature_names)
    swapped[0], swapped[9] = swapped[9], swapped[0]
    with pytest.raises(CheckpointError, match="the order differs"):
        fit_layouts(run, WBC32, dataset=dataset(tmp_path / "data", names=swapped))
    assert not (checkpoint_folder(run) / ACTION_SPEC_FILE).exists()


@pytest.mark.parametrize("below", ["", "checkpoints", "checkpoints/last", "checkpoints/000100/pretrained_model"])
def test_c4_the_last_checkpoint_of_a_training_run_is_found(run, below):
    assert is_checkpoint(str(run / below))
    wholebody("spec", run / below, "--layout", "wbc32-v1")
    assert open_source(str(run / below), 60.0, None).spec.horizon == 100


@pytest.mark.parametrize("command", ["run", "check", "doctor", "spec"])
def test_c4_a_hub_id_gets_the_command_that_downloads_it(command, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    options = {"run": ("--duration", "1"), "check": ("--duration", "1"), "spec": ("--layout", "wbc32-v1")}.get(
        command, ()
    )
    try:
        done = wholebody(command, "lerobot/pi05_base", *options)
        said = done.stdout + done.stderr
    except PolicyError as error:
        said = str(error)
    assert "hf download lerobot/pi05_base --local-dir FOLDER" in said


def test_c4_a_policy_of_another_robot_gets_the_sentence_that_helps():
    config = tiny.config("act")
    config.output_features[ACTION] = PolicyFeature(FeatureType.ACTION, (6,))
    config.action_feature_names = ["shoulder_pan.pos", "shoulder_lift.pos", "elbow_flex.pos", "wrist_flex.pos"]
    found = check_features(config, {ACTION: WBC32})
    said = next(finding.sentence for finding in found if "action has 6 numbers" in finding.text)
    assert "no layout of the G1 has 6 (shoulder_pan.pos, shoulder_lift.pos, elbow_flex.pos, ...)" in said
    assert "wholebody convert DATASET --to wbc32" in said
    config.output_features[ACTION] = PolicyFeature(FeatureType.ACTION, (28,))
    said = next(f.sentence for f in check_features(config, {ACTION: WBC32}) if "28 numbers" in f.text)
    assert "of 28 numbers: joint28" in said
