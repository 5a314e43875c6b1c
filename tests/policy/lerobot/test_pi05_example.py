"""The example that takes π0.5 apart: what it does by hand is what LeRobot's own call does, to the bit."""

import importlib.util
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
import torch

from policy.action_spec.anchor import Anchor
from policy.action_spec.codec import decode
from policy.lerobot.policy import LeRobotPolicy
from tests.support.tiny_policies import observation, tiny_backbones, write_checkpoint

ROOT = Path(__file__).parents[3]
SPEC = importlib.util.spec_from_file_location("pi05_to_g1", ROOT / "examples" / "pi05_to_g1.py")
EXAMPLE = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(EXAMPLE)


@pytest.fixture(scope="module")
def policy(tmp_path_factory):
    with tiny_backbones():
        return LeRobotPolicy.from_pretrained(write_checkpoint("pi05", tmp_path_factory.mktemp("pi05")))


@pytest.mark.parametrize("num_steps", [1, 3, 10])
def test_calling_sample_actions_by_hand_gives_the_bits_of_predict_action_chunk(policy, num_steps):
    trace = EXAMPLE.network_by_hand(policy, observation(), num_steps)
    network = policy.checkpoint.network
    chunk = network.predict_action_chunk(dict(trace.batch), noise=trace.noise, num_steps=num_steps)
    assert chunk.dtype == trace.normalised.dtype == torch.float32
    assert torch.equal(chunk, trace.normalised)
    assert trace.actions.shape == (50, 32)


def test_the_adapter_gives_the_same_bits_in_one_call(policy):
    trace = EXAMPLE.network_by_hand(policy, observation(), 10)
    actions = policy.predict(observation(), noise=trace.noise[0].numpy())
    assert actions.tobytes() == trace.actions.tobytes()
    at = observation()
    chunk = decode(policy.spec, actions, Anchor.measured(at), t_obs=at.time)
    assert chunk.T_world_lhand.shape == (50, 4, 4)


def test_select_action_hands_the_same_chunk_out_row_by_row(policy):
    trace = EXAMPLE.network_by_hand(policy, observation(), 10)
    network = policy.checkpoint.network
    network.reset()
    # select_action takes no noise: LeRobot draws it from torch's own generator.
    torch.manual_seed(3)
    rows = torch.stack([network.select_action(dict(trace.batch)) for _ in range(50)], dim=1)
    torch.manual_seed(3)
    assert torch.equal(rows, network.predict_action_chunk(dict(trace.batch)))
    network.reset()


@pytest.fixture(scope="module")
def printed(tmp_path_factory):
    """Output of the whole example, network and controller, on the tiny checkpoint."""
    text = StringIO()
    with tiny_backbones(), redirect_stdout(text):
        EXAMPLE.main(write_checkpoint("pi05", tmp_path_factory.mktemp("pi05")), seconds=0.1)
    return text.getvalue()


@pytest.mark.parametrize(
    "line",
    [
        "observation.images.head          (3, 64, 64)          float32",
        "observation.state                (32,)                float32",
        "observation.state                (1, 32)              float32",
        "tokens                           (1, 200)             int64",
        "images[i]                        (1, 3, 56, 56)       float32",
        "embed_prefix: embs               (1, 248, 64)         float32",
        "noise                            (1, 50, 32)          float32",
        "sample_actions                   (1, 50, 32)          float32",
        "predict_action_chunk             (1, 50, 32)          float32",
        "postprocessor                    (50, 32)             float64",
        "chunk.T_world_lhand              (50, 4, 4)           float64",
        "chunk.q_rhand                    (50, 7)              float64",
        "command.q                        (43,)                float64",
        "command.tau                      (43,)                float64",
    ],
)
def test_the_example_prints_every_shape_from_image_to_joint_target(printed, line):
    assert line in printed


def test_the_example_ends_with_joint_targets_of_a_standing_robot(printed):
    assert "prompt: 'Task: pick up the can, State: 127 128" in printed
    assert "accept: StatusReport" in printed
    assert "damping" not in printed
    height = float(printed.split("pelvis at ")[1].split()[0])
    assert height == pytest.approx(0.78, abs=0.02)
    angle = float(printed.split("left_elbow_joint")[1].split()[0])
    assert np.isfinite(angle)


def test_the_example_takes_no_other_policy(tmp_path):
    with pytest.raises(SystemExit, match=r"is a 'act'; this example takes π0\.5 apart"):
        EXAMPLE.main(write_checkpoint("act", tmp_path))
