"""Widths, names, steps and inputs of a checkpoint against the layouts."""

import dataclasses
import json
import resource

import numpy as np
import pytest
import torch
from lerobot.configs import FeatureType, PolicyFeature
from lerobot.policies.factory import get_policy_class, make_pre_post_processors
from lerobot.policies.pi05.modeling_pi05 import PI05Policy

from policy.action_spec.builtin import builtin
from policy.action_spec.state import state_layout
from policy.findings import CheckpointError
from policy.lerobot.checkpoint import LoadOptions, read_config
from policy.lerobot.features import camera_keys, check_features, chunk_length, compare_names
from policy.lerobot.policy import LeRobotPolicy
from policy.lerobot.spec import write_specs
from policy.lerobot.stats import ACTION, STATE
from policy.lerobot.trust import check_model_folder
from tests.support import tiny_policies as tiny


def layouts(spec=tiny.SPEC):
    return {ACTION: spec, STATE: state_layout(spec)}


def errors(config, given=None, **options):
    return [
        finding.text for finding in check_features(config, given or layouts(), **options) if finding.level == "error"
    ]


@pytest.mark.parametrize("kind", tiny.POLICIES)
def test_what_fits_is_one_line(kind, tmp_path):
    (finding,) = check_features(tiny.config(kind, folder=tmp_path), layouts())
    assert finding.level == "ok"
    assert finding.text == "32 numbers of state, head, left_wrist, right_wrist -> 50 steps of 32 at 30 Hz"


def test_lerobot_returns_32_of_36_numbers_and_we_refuse_the_layout(tmp_path):
    """Trap 8: max_action_dim is part of the weights; a wider action is cut without a word."""
    config = tiny.config("pi05")
    config.output_features[ACTION] = PolicyFeature(FeatureType.ACTION, (36,))
    with tiny.tiny_backbones():
        network = PI05Policy(config)
        batch = {f"observation.images.{name}": torch.zeros(1, 3, 56, 56) for name in tiny.CAMERAS}
        batch |= {
            "observation.language.tokens": torch.ones(1, 4, dtype=torch.long),
            "observation.language.attention_mask": torch.ones(1, 4, dtype=torch.bool),
        }
        assert network.predict_action_chunk(batch).shape == (1, 50, 32)
    said = errors(config)
    assert "action has 36 numbers; layout 'wbc32' has 32" in said
    assert "action has 36 numbers; max_action_dim, which is part of the weights, is 32" in said


def test_lerobot_takes_a_state_of_any_length_and_we_take_the_layouts(tmp_path):
    """Trap 6: max_state_dim is not enforced in π0.5."""
    config = tiny.config("pi05")
    config.input_features[STATE] = PolicyFeature(FeatureType.STATE, (40,))
    with tiny.tiny_backbones():
        PI05Policy(config)
    said = errors(config)
    assert "observation.state has 40 numbers; layout 'wbc32' has 32" in said
    assert "observation.state has 40 numbers; max_state_dim, which is part of the weights, is 32" in said


def test_chunks_of_another_length_than_the_layout_says_are_refused():
    (said,) = errors(tiny.config("act", chunk_size=100, n_action_steps=100))
    assert said == "chunks of this 'act' have 100 steps; 'wbc32' says 50"


@pytest.mark.parametrize(("kind", "length"), [("act", 50), ("pi05", 50), ("diffusion", 50)])
def test_the_length_of_a_chunk_is_what_the_network_returns(kind, length, tmp_path_factory):
    with tiny.tiny_backbones():
        policy = LeRobotPolicy.from_pretrained(tiny.saved(kind, tmp_path_factory), clamp=1.0)
    assert chunk_length(policy.checkpoint.network.config) == length
    assert policy.predict(tiny.observation()).shape == (length, 32)


def test_n_action_steps_shortens_select_action_only(tmp_path):
    """Trap 15: predict_action_chunk returns the whole chunk, and so do we."""
    folder = tiny.write_checkpoint("act", tmp_path / "act", n_action_steps=10)
    assert len(LeRobotPolicy.from_pretrained(folder).infer(tiny.observation())) == 50


def test_an_input_that_the_robot_does_not_have_is_refused():
    config = tiny.config("act")
    config.input_features["observation.tactile"] = PolicyFeature(FeatureType.STATE, (4,))
    assert "input 'observation.tactile' is neither state nor image" in errors(config)


def test_the_environment_needs_a_function(tmp_path):
    key = "observation.environment_state"
    config = tiny.config("act")
    config.input_features[key] = PolicyFeature(FeatureType.ENV, (3,))
    (said,) = errors(config)
    assert said == f"the policy wants '{key}', which no sensor of the robot gives"
    assert errors(config, environment=True) == []

    torch.manual_seed(0)
    network = get_policy_class("act")(config)
    statistics = tiny.stats() | {key: {"mean": np.zeros(3, np.float32), "std": np.ones(3, np.float32)}}
    for part in (network, *make_pre_post_processors(config, dataset_stats=statistics)):
        part.save_pretrained(tmp_path)
    write_specs(tmp_path, tiny.SPEC)
    with pytest.raises(CheckpointError, match="pass environment=FUNCTION"):
        LeRobotPolicy.from_pretrained(tmp_path)
    chunks = [
        LeRobotPolicy.from_pretrained(tmp_path, environment=lambda _, x=x: [x, 0.0, 0.0]).predict(tiny.observation())
        for x in (0.0, 1.0)
    ]
    assert not np.array_equal(*chunks)
    wrong = LeRobotPolicy.from_pretrained(tmp_path, environment=lambda _: [0.0])
    with pytest.raises(ValueError, match="3 finite numbers are expected"):
        wrong.infer(tiny.observation())


def test_names_in_another_order_are_refused_and_other_names_mentioned():
    names = list(tiny.SPEC.feature_names)
    assert list(compare_names("features", ACTION, names, tiny.SPEC, "config.json")) == []
    exchanged = [names[1], names[0], *names[2:]]
    (finding,) = compare_names("features", ACTION, exchanged, tiny.SPEC, "config.json")
    assert finding.level == "error"
    assert "number 0 of action is 'left_wrist_y.pos' in config.json, 'left_wrist_x.pos' in layout" in finding.text
    (finding,) = compare_names("features", ACTION, [f"x{i}" for i in range(32)], tiny.SPEC, "config.json")
    assert finding.level == "warning"
    (finding,) = compare_names("features", ACTION, names[:20], tiny.SPEC, "config.json")
    assert "action has 20 names in config.json" in finding.text


def test_names_that_training_saved_in_the_configuration_are_compared():
    names = list(reversed(tiny.SPEC.feature_names))
    (said,) = errors(tiny.config("pi05", action_feature_names=names))
    assert "number 0 of action is" in said


def test_empty_cameras_are_the_policys_own():
    config = tiny.config("pi05", empty_cameras=1)
    config.validate_features()
    assert "observation.images.empty_camera_0" in config.image_features
    assert list(camera_keys(config)) == list(tiny.CAMERAS)
    assert errors(config) == []


def test_an_image_under_another_prefix_is_refused():
    config = tiny.config("act", cameras=())
    config.input_features["observation.image"] = PolicyFeature(FeatureType.VISUAL, (3, 64, 64))
    (said,) = errors(config)
    assert said == "image 'observation.image' is not called observation.images.NAME"


def test_a_layout_that_the_user_vouches_for_gets_the_checkpoints_length(tmp_path):
    spec = tiny.shorter(builtin("wbc32-v1"), 20)
    folder = tiny.write_checkpoint("act", tmp_path / "act", spec=spec, with_spec=False)
    policy = LeRobotPolicy.from_pretrained(folder, assume_spec="wbc32-v1")
    assert policy.spec == dataclasses.replace(spec, name="wbc32")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"type": "pi7"}, "Policy type 'pi7'"),
        ({"chunk_size": -3}, "is no configuration of a LeRobot policy|steps"),
        ({"unheard_of": 1}, "is no configuration of a LeRobot policy"),
        ({"use_peft": True}, "is of a PEFT adapter"),
    ],
)
def test_a_configuration_that_cannot_be_is_refused(change, said, tmp_path, tmp_path_factory):
    folder = tiny.copied("act", tmp_path_factory, tmp_path)
    file = folder / "config.json"
    file.write_text(json.dumps(json.loads(file.read_text()) | change))
    with pytest.raises(CheckpointError, match=said):
        LeRobotPolicy.from_pretrained(folder)


def test_a_folder_that_is_no_checkpoint_is_named(tmp_path):
    with pytest.raises(CheckpointError, match=r"config\.json is missing; give the folder of a checkpoint"):
        LeRobotPolicy.from_pretrained(tmp_path / "nothing")
    (tmp_path / "config.json").write_text("{")
    with pytest.raises(CheckpointError, match="is no configuration"):
        LeRobotPolicy.from_pretrained(tmp_path)


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("num_inference_steps", 0, "num_inference_steps of 'diffusion' is 0; 1 to 1000 is expected"),
        ("num_inference_steps", 10**9, "num_inference_steps of 'diffusion' is 1e\\+09; 1 to 1000"),
        ("n_obs_steps", 10**6, "n_obs_steps of 'diffusion' is 1e\\+06; 1 to 64"),
        ("horizon", 10**6, "horizon of 'diffusion' is 1e\\+06; 1 to 1000"),
        ("diffusion_step_embed_dim", 10**9, "is 1e\\+09; -1 to 16384"),
        ("down_dims", [512, 10**6], "down_dims of 'diffusion' is 1e\\+06; -1 to 16384"),
    ],
)
def test_b3_sizes_that_no_policy_has_are_refused_before_a_network_is_built(
    name, value, said, tmp_path, tmp_path_factory
):
    folder = tiny.copied("diffusion", tmp_path_factory, tmp_path)
    file = folder / "config.json"
    file.write_text(json.dumps(json.loads(file.read_text()) | {name: value}))
    with pytest.raises(CheckpointError, match=said):
        read_config(folder, LoadOptions(device="cpu"))


@pytest.mark.parametrize(("name", "most"), [("n_encoder_layers", 128), ("dim_model", 16384)])
def test_b3_the_width_and_the_depth_of_a_network_are_bounded(name, most, tmp_path, tmp_path_factory):
    """A million layers, or layers of a million numbers, took all memory or an hour before a word was said."""
    folder = tiny.copied("act", tmp_path_factory, tmp_path)
    file = folder / "config.json"
    file.write_text(json.dumps(json.loads(file.read_text()) | {name: 10**6}))
    with pytest.raises(CheckpointError, match=rf"{name} of 'act' is 1e\+06; -1 to {most} is expected"):
        read_config(folder, LoadOptions(device="cpu"))


@pytest.mark.parametrize("random", [False, True])
def test_b3_a_network_larger_than_its_file_is_refused_before_it_takes_memory(random, tmp_path, tmp_path_factory):
    """Within its bounds, 128 layers of 16384 numbers are 550 GB; the file of this one has some MB."""
    folder = tiny.copied("act", tmp_path_factory, tmp_path)
    file = folder / "config.json"
    large = {"dim_model": 16384, "dim_feedforward": 16384, "n_encoder_layers": 64}
    file.write_text(json.dumps(json.loads(file.read_text()) | large))
    if random:
        (folder / "model.safetensors").unlink()
    begin = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(CheckpointError, match=r"describes a network of \d[\d,]+ numbers, which is more than"):
        LeRobotPolicy.from_pretrained(folder, device="cpu", allow_random_weights=random)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - begin < 500_000  # [KiB]


@pytest.mark.parametrize(
    ("part", "name", "value"), [("text_config", "hidden_size", 10**6), ("vision_config", "num_hidden_layers", 10**6)]
)
def test_b3_a_backbone_of_any_size_is_no_backbone(part, name, value, tmp_path):
    (tmp_path / "config.json").write_text(json.dumps({part: {name: value}}))
    with pytest.raises(CheckpointError, match=rf"has {name} 1000000 \(at most \d+\), as no backbone has"):
        check_model_folder(tmp_path)


def test_denoising_steps_and_seeds_of_the_user_have_bounds_too(tmp_path_factory):
    folder = tiny.saved("diffusion", tmp_path_factory)
    for options, said in (
        ({"num_steps": 10**9}, "1 to 1000"),
        ({"num_steps": -1}, "num_steps -1"),
        ({"seed": -1}, "seed"),
    ):
        with pytest.raises(CheckpointError, match=said):
            read_config(folder, LoadOptions(device="cpu", **options))
