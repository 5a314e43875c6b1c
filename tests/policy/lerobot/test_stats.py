"""Statistics: what LeRobot does without them, with wrong ones and with narrow ones, and what we say.

Strategy: real pipelines of LeRobot, saved with damaged statistics. Each trap is shown on the pipeline itself first.
"""

import json

import numpy as np
import pytest
import torch
from lerobot.policies.factory import make_pre_post_processors
from safetensors.torch import load_file, save_file

from policy.action_spec.builtin import builtin
from policy.dataset.stats import WIDTH_MIN
from policy.findings import CheckpointError
from policy.lerobot.policy import LeRobotPolicy
from policy.lerobot.stats import bounds, mode_of, normaliser
from policy.observation import Observation
from tests.support import tiny_policies as tiny

UNNORMALISER = "policy_postprocessor_step_0_unnormalizer_processor.safetensors"
NORMALISER = "policy_preprocessor_step_3_normalizer_processor.safetensors"


def processors(folder):
    """LeRobot's own way to load them."""
    return make_pre_post_processors(
        tiny.config("act"), pretrained_path=str(folder), preprocessor_overrides={}, postprocessor_overrides={}
    )


def altered(folder, change, files=(UNNORMALISER, NORMALISER)):
    for file in files:
        tensors = load_file(folder / file)
        change(tensors)
        save_file(tensors, folder / file)
    return folder


def refusal(folder, **options):
    with pytest.raises(CheckpointError) as caught:
        LeRobotPolicy.from_pretrained(folder, **options)
    assert {finding.check for finding in caught.value.findings} == {"statistics"}
    return str(caught.value)


@pytest.fixture
def act(tmp_path, tmp_path_factory):
    return tiny.copied("act", tmp_path_factory, tmp_path)


def test_without_statistics_lerobot_sends_normalised_numbers_as_metres(act):
    """Trap 3: a checkpoint saved with no statistics loads; 0.3 standard deviations become 0.3 m."""
    altered(act, lambda tensors: [tensors.pop(name) for name in list(tensors) if name.startswith("action.")])
    _, post = processors(act)
    assert torch.equal(post(torch.full((1, 32), 0.3)), torch.full((1, 32), 0.3))

    said = refusal(act)
    assert "the post-processor has no statistics for 'action', so LeRobot would not normalise it" in said


def test_misspelt_statistics_are_no_statistics(act):
    def misspell(tensors):
        for name in [name for name in tensors if name.startswith("action.")]:
            tensors[name.replace("action.", "actions.")] = tensors.pop(name)

    altered(act, misspell)
    _, post = processors(act)
    assert torch.equal(post(torch.full((1, 32), 0.3)), torch.full((1, 32), 0.3))

    assert "did you mean 'actions'? " in refusal(act)


def test_lerobot_broadcasts_statistics_of_one_number(act):
    """Trap 4: one number for all 32."""

    def shrink(tensors):
        tensors["action.mean"], tensors["action.std"] = torch.tensor([7.0]), torch.tensor([1.0])

    altered(act, shrink)
    _, post = processors(act)
    assert torch.equal(post(torch.zeros(1, 32)), torch.full((1, 32), 7.0))

    assert "action.mean of the post-processor has 1 numbers; 'wbc32' has 32" in refusal(act)


def test_lerobot_divides_by_ranges_of_nothing(act):
    """Trap 10: a rotation entry that never moved has a width of 4e-14, and noise of a microradian becomes millions."""

    def pinch(tensors):
        tensors["observation.state.std"][5] = 4e-14

    altered(act, pinch, files=[NORMALISER])
    pre, _ = processors(act)
    images = {f"observation.images.{name}": torch.zeros(3, 64, 64) for name in tiny.CAMERAS}
    state = torch.from_numpy(tiny.stats()["observation.state"]["mean"].copy())
    state[5] += 1e-6
    # Only LeRobot's epsilon of 1e-8 is left in the denominator.
    assert pre({"observation.state": state, "task": "", **images})["observation.state"][0, 5] > 50.0

    said = refusal(act)
    assert "observation.state left_wrist_r6_2.pos has a range of 1.86e-13; 0.001 is the least that is sound" in said
    policy = LeRobotPolicy.from_pretrained(act, allow_narrow=True)
    assert [warning.check for warning in policy.warnings] == ["statistics"]


def test_lerobot_takes_statistics_that_are_not_finite(act):
    altered(act, lambda tensors: tensors["action.std"].__setitem__(3, float("nan")))
    _, post = processors(act)
    assert torch.isnan(post(torch.zeros(1, 32))[0, 3])

    assert "action.std of the post-processor is nan for left_wrist_r6_0.pos" in refusal(act)


def test_pre_and_post_processor_of_different_runs_are_refused(act):
    altered(act, lambda tensors: tensors["action.mean"].__iadd__(0.001), files=[UNNORMALISER])
    assert "action.mean differs between pre- and post-processor" in refusal(act)


def test_positions_in_another_unit_are_refused(act):
    def centimetres(tensors):
        for name in ("action.mean", "action.std"):
            tensors[name][:3] *= 100.0

    altered(act, centimetres)
    assert "the data are in another unit or frame than the layout says" in refusal(act)


def test_rotations_of_another_kind_are_refused(tmp_path):
    """Degrees of roll, pitch and yaw in the place of a rotation matrix: same count, other meaning."""
    statistics = tiny.stats()
    for name in ("q01", "q99"):
        statistics["action"][name][3:9] *= 90.0
    with tiny.tiny_backbones():
        folder = tiny.write_checkpoint("pi05", tmp_path / "pi05", statistics=statistics)
        said = refusal(folder)
    assert "action left_wrist_rotation reaches" in said
    assert "an entry of a rotation matrix is at most 1" in said


def test_exchanged_bounds_are_refused(tmp_path):
    statistics = tiny.stats()
    one = statistics["action"]
    one["q01"], one["q99"] = one["q99"], one["q01"]
    folder = tiny.write_checkpoint("pi05", tmp_path / "pi05", statistics=statistics)
    with tiny.tiny_backbones():
        assert "upper and lower bounds are exchanged" in refusal(folder, allow_narrow=True)


def test_image_statistics_must_be_three_numbers(act):
    key = "observation.images.head"
    altered(act, lambda tensors: tensors.__delitem__(f"{key}.std"), files=[NORMALISER])
    assert f"lacks {key}.std, which MEAN_STD needs" in refusal(act)


def test_a_missing_processor_is_named(act):
    (act / "policy_postprocessor.json").unlink()
    with pytest.raises(CheckpointError, match=r"policy_postprocessor\.json is missing"):
        LeRobotPolicy.from_pretrained(act)


def test_missing_statistics_file_of_a_processor_is_named(act):
    (act / UNNORMALISER).unlink()
    with pytest.raises(CheckpointError, match="unnormalizer_processor"):
        LeRobotPolicy.from_pretrained(act)


def test_bounds_are_what_is_mapped_to_one(act):
    _, post = processors(act)
    step = normaliser(post, inverse=True)
    assert mode_of(step, "ACTION") == "MEAN_STD"
    low, high = bounds(step, "action", "ACTION")
    assert np.all(high - low >= WIDTH_MIN)
    assert bounds(step, "nothing", "ACTION") is None


def test_a_state_far_outside_training_is_refused_and_a_near_one_mentioned(tmp_path_factory):
    """Trap 5: LeRobot's bins end at 255 above and at -1 below, so the network cannot see how far off a state is."""
    with tiny.tiny_backbones():
        policy = LeRobotPolicy.from_pretrained(tiny.saved("pi05", tmp_path_factory), clamp=1.0)
    seen = tiny.observation()
    beyond = {0.2: None, 0.9: None}
    for angle in beyond:
        q_body = seen.q_body.copy()
        q_body[15] += angle
        q_body[22] += angle
        beyond[angle] = Observation(
            0.0, q_body, seen.q_lhand, seen.q_rhand, seen.T_world_base, images=seen.images, task=seen.task
        )
    pre = policy.checkpoint.preprocessor
    low = torch.from_numpy(tiny.stats()["observation.state"]["q01"])
    images = {f"observation.images.{name}": torch.zeros(3, 64, 64) for name in tiny.CAMERAS}
    prompts = [pre({"observation.state": low - off, "task": "go", **images})["task"][0] for off in (0.05, 5.0)]
    assert prompts[0] == prompts[1]
    assert prompts[0].startswith("Task: go, State: -1 -1 -1")
    nan = pre({"observation.state": low * float("nan"), "task": "go", **images})["task"][0]
    assert nan.startswith("Task: go, State: 255 255 255")

    (note, *_) = policy.infer(beyond[0.2]).notes
    assert "of the state is" in note
    with pytest.raises(ValueError, match=r"in training .* to .*: start nearer to the demonstrations"):
        policy.infer(beyond[0.9])


def test_a_layout_of_joints_is_checked_in_its_own_units(tmp_path):
    spec = builtin("joint28")
    folder = tiny.write_checkpoint("act", tmp_path / "act", spec=spec)
    policy = LeRobotPolicy.from_pretrained(folder, spec="joint28")
    assert policy.spec == spec
    assert policy.infer(tiny.observation()).q_larm is not None


def edited(folder, name, change):
    file = folder / f"{name}.json"
    data = json.loads(file.read_text())
    change(data)
    file.write_text(json.dumps(data))
    return folder


def normalise_by(mode):
    def change(data):
        for step in data["steps"]:
            if "normalizer" in step["registry_name"]:
                step["config"]["norm_map"]["ACTION"] = mode

    return change


@pytest.mark.parametrize("name", ["policy_preprocessor", "policy_postprocessor"])
def test_b6_a_normalisation_that_is_not_undone_is_refused(name, act):
    """IDENTITY on one side and MEAN_STD on the other was "the same before and after"."""
    said = refusal(edited(act, name, normalise_by("IDENTITY")))
    assert "action is normalised by MEAN_STD in config.json" in said
    assert f"IDENTITY in the {'pre' if 'pre' in name else 'post'}-processor" in said


def test_b6_processors_that_agree_with_each_other_but_not_with_the_configuration_are_refused(act):
    for name in ("policy_preprocessor", "policy_postprocessor"):
        edited(act, name, normalise_by("IDENTITY"))
    assert "MEAN_STD in config.json, IDENTITY in the pre-processor" in refusal(act)


@pytest.mark.parametrize(("name", "where"), [("policy_preprocessor", "pre"), ("policy_postprocessor", "post")])
def test_b6_a_checkpoint_without_a_normaliser_is_refused(name, where, act):
    """It was a warning, and numbers of the network went to the robot as they were."""

    def without(data):
        data["steps"] = [step for step in data["steps"] if "normalizer" not in step["registry_name"]]

    assert f"the {where}-processor of 'act' has no normalising step" in refusal(edited(act, name, without))


@pytest.mark.parametrize("content", [b"", b"x" * 8, (2**40).to_bytes(8, "little") + b"{}", b"\x02" + bytes(7) + b"{}x"])
def test_numbers_of_a_step_that_are_damaged_are_refused(content, act):
    (act / NORMALISER).write_bytes(content)
    with pytest.raises(CheckpointError, match="do not load"):
        LeRobotPolicy.from_pretrained(act)
