"""Five broken checkpoints, for the real π0.5 and the real ACT: what LeRobot makes of them, and what we say.

Strategy: a tiny checkpoint is saved by LeRobot itself and broken in one way. For π0.5 the test first shows that LeRobot
0.6.1 returns a network without an exception, and that its weights are not the file's; then that we refuse it with the
tensor or the file in the sentence. ACT shares LeRobot's generic loading, which fails aloud for some of the five.
"""

import numpy as np
import pytest
import torch
from lerobot.policies.act.modeling_act import ACTPolicy
from lerobot.policies.pi05.modeling_pi05 import PI05Policy
from lerobot.policies.smolvla.modeling_smolvla import SmolVLAPolicy
from safetensors.torch import load_file, save_file

from policy.findings import CheckpointError
from policy.lerobot.policy import LeRobotPolicy
from policy.lerobot.weights import WEIGHTS_FILE
from tests.support import tiny_policies as tiny

OUT = {"pi05": "model.action_out_proj.weight", "act": "model.action_head.weight"}


def rewritten(folder, change):
    tensors = load_file(folder / WEIGHTS_FILE)
    change(tensors)
    save_file(tensors, folder / WEIGHTS_FILE)


def absent(folder, name):
    (folder / WEIGHTS_FILE).unlink()


def truncated(folder, name):
    data = (folder / WEIGHTS_FILE).read_bytes()
    (folder / WEIGHTS_FILE).write_bytes(data[: len(data) // 2])


def missing_key(folder, name):
    rewritten(folder, lambda tensors: tensors.pop(name))


def wrong_shape(folder, name):
    rewritten(folder, lambda tensors: tensors.update({name: torch.zeros(36, tensors[name].shape[1])}))


def extra_key(folder, name):
    rewritten(folder, lambda tensors: tensors.update({"model.third_arm.weight": torch.zeros(3)}))


BREAKS = {
    absent: r"model\.safetensors is missing",
    truncated: r"model\.safetensors is cut short or damaged, \d+ bytes",
    missing_key: r"lacks tensors of the network: {name}; this is no complete '{kind}' checkpoint",
    wrong_shape: r"another shape: {name} \(36, (64|32)\) in the file, \(32, (64|32)\) in the network",
    extra_key: r"has tensors that the network lacks: model\.third_arm\.weight",
}


@pytest.mark.parametrize("damage", BREAKS, ids=lambda damage: damage.__name__)
@pytest.mark.parametrize("kind", ["pi05", "act"])
def test_a_broken_checkpoint_is_refused_with_the_tensor_or_the_file(kind, damage, tmp_path, tmp_path_factory):
    folder = tiny.copied(kind, tmp_path_factory, tmp_path)
    name = OUT[kind]
    damage(folder, name)
    expected = BREAKS[damage].replace("{name}", name.replace(".", r"\.")).replace("{kind}", kind)
    with tiny.tiny_backbones(), pytest.raises(CheckpointError, match=expected) as caught:
        LeRobotPolicy.from_pretrained(folder)
    assert {finding.check for finding in caught.value.findings} == {"weights"}
    assert all(finding.cure for finding in caught.value.findings)


@pytest.mark.parametrize("damage", [absent, truncated, missing_key, wrong_shape], ids=lambda damage: damage.__name__)
def test_lerobot_itself_returns_random_weights_without_an_exception(damage, tmp_path, tmp_path_factory):
    """Trap 1: every loading error of π0.5 is caught and printed; strict=True, the default, changes nothing."""
    folder = tiny.copied("pi05", tmp_path_factory, tmp_path)
    trained = load_file(folder / WEIGHTS_FILE)[OUT["pi05"]]
    damage(folder, OUT["pi05"])
    torch.manual_seed(1)
    with tiny.tiny_backbones():
        network = PI05Policy.from_pretrained(folder)
    assert not torch.equal(network.state_dict()[OUT["pi05"]], trained)


def test_lerobot_itself_ignores_an_extra_tensor_of_pi05(tmp_path, tmp_path_factory, capsys):
    folder = tiny.copied("pi05", tmp_path_factory, tmp_path)
    extra_key(folder, "")
    with tiny.tiny_backbones():
        PI05Policy.from_pretrained(folder)
    assert "Could not load state dict" in capsys.readouterr().out


def test_lerobot_itself_accepts_an_act_checkpoint_with_a_missing_tensor(tmp_path, tmp_path_factory):
    """The generic loader is not strict unless told so."""
    folder = tiny.copied("act", tmp_path_factory, tmp_path)
    trained = load_file(folder / WEIGHTS_FILE)[OUT["act"]]
    missing_key(folder, OUT["act"])
    torch.manual_seed(1)
    assert not torch.equal(ACTPolicy.from_pretrained(folder).state_dict()[OUT["act"]], trained)


def test_weights_that_are_not_finite_are_refused(tmp_path, tmp_path_factory):
    folder = tiny.copied("pi05", tmp_path_factory, tmp_path)
    rewritten(folder, lambda tensors: tensors[OUT["pi05"]].__setitem__((0, 0), np.nan))
    with tiny.tiny_backbones(), pytest.raises(CheckpointError, match=r"not finite: model\.action_out_proj\.weight"):
        LeRobotPolicy.from_pretrained(folder)


@pytest.mark.parametrize("kind", tiny.POLICIES)
def test_every_tensor_is_the_files(kind, tmp_path_factory):
    folder = tiny.saved(kind, tmp_path_factory)
    with tiny.tiny_backbones():
        network = LeRobotPolicy.from_pretrained(folder).checkpoint.network
    stored, state = load_file(folder / WEIGHTS_FILE), network.state_dict()
    assert set(stored) <= set(state)
    assert all(torch.equal(state[name], tensor) for name, tensor in stored.items())
    assert not network.training


def test_tensors_that_a_loader_changes_in_silence_are_found(tmp_path_factory, monkeypatch):
    """A loader that reports success and returns other weights: the comparison is with the file, not with its word."""

    def corrupting(cls, model, *arguments):
        for parameter in model.parameters():
            torch.nn.init.zeros_(parameter)
        return model

    monkeypatch.setattr(SmolVLAPolicy, "_load_as_safetensor", classmethod(corrupting))
    with pytest.raises(CheckpointError, match="after loading, tensors are not those of"):
        LeRobotPolicy.from_pretrained(tiny.saved("smolvla", tmp_path_factory))


def test_random_weights_run_only_when_they_are_asked_for(tmp_path, tmp_path_factory):
    folder = tiny.copied("pi05", tmp_path_factory, tmp_path)
    absent(folder, "")
    with tiny.tiny_backbones():
        policy = LeRobotPolicy.from_pretrained(folder, allow_random_weights=True, clamp=1.0)
    (warning,) = policy.warnings
    assert warning.check == "weights"
    assert "random weights, as allowed" in warning.text
    assert len(policy.infer(tiny.observation())) == tiny.SPEC.horizon


def test_weights_in_shards_are_named(tmp_path, tmp_path_factory):
    folder = tiny.copied("act", tmp_path_factory, tmp_path)
    (folder / WEIGHTS_FILE).rename(folder / "model-00001-of-00002.safetensors")
    with pytest.raises(CheckpointError, match=r"shards \['model-00001-of-00002\.safetensors'\]"):
        LeRobotPolicy.from_pretrained(folder)


def test_bfloat16_weights_are_the_files_rounded(tmp_path_factory):
    folder = tiny.saved("pi05", tmp_path_factory)
    with tiny.tiny_backbones():
        policy = LeRobotPolicy.from_pretrained(folder, dtype="bfloat16", clamp=1.0)
    dtypes = {tensor.dtype for tensor in policy.checkpoint.network.state_dict().values()}
    assert torch.bfloat16 in dtypes
    assert len(policy.infer(tiny.observation())) == tiny.SPEC.horizon


def test_a_backbone_that_is_not_on_the_machine_is_named(tmp_path, tmp_path_factory):
    folder = tiny.copied("smolvla", tmp_path_factory, tmp_path)
    text = (folder / "config.json").read_text()
    (folder / "config.json").write_text(text.replace(str(tiny.saved("smolvla", tmp_path_factory) / "vlm"), "./gone"))
    with pytest.raises(CheckpointError, match=r"backbone '\./gone' must be on this machine: say tokenizer=FOLDER"):
        LeRobotPolicy.from_pretrained(folder)


def test_lerobot_leaves_pi05_in_training_and_here_it_is_in_evaluation(tmp_path_factory):
    """Trap 22: drop-out and the like would be on in whatever calls the network directly."""
    folder = tiny.saved("pi05", tmp_path_factory)
    with tiny.tiny_backbones():
        assert PI05Policy.from_pretrained(folder).training
        assert not LeRobotPolicy.from_pretrained(folder).checkpoint.network.training
