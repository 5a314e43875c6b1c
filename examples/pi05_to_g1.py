"""π0.5 by hand: from camera images to joint targets of the G1, every tensor on the way printed.

``embed_prefix`` and ``sample_actions`` are called directly on LeRobot's ``PI05Policy``. `LeRobotPolicy.infer` does the
same in one call and checks every step of it; `docs/policy_contract.md` explains the shapes.

    python examples/pi05_to_g1.py                  a tiny π0.5 with random weights, made on the spot
    python examples/pi05_to_g1.py CHECKPOINT       your own, 4.1 billion parameters: seconds a step without a GPU

Random weights know nothing: what the robot does with them is small and aimless, and it keeps standing.
"""

import sys
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import torch

from models import g1
from policy import Anchor, LeRobotPolicy, Observation, decode
from policy.action_spec.state import state_numbers
from policy.lerobot.features import camera_keys
from wholebody import MujocoPlant, Supervisor, observe

TASK = "pick up the can"
NUM_STEPS = 10
"""Denoising steps: `num_inference_steps` of the configuration, free to be fewer."""


@dataclass
class Trace:
    """What went through the network, to compare with LeRobot's own call."""

    batch: dict
    noise: torch.Tensor
    normalised: torch.Tensor
    actions: np.ndarray


def network_by_hand(policy: LeRobotPolicy, observation: Observation, num_steps: int = NUM_STEPS) -> Trace:
    """From an observation to raw actions of the layout, one LeRobot call a line."""
    checkpoint = policy.checkpoint
    network, config = checkpoint.network, checkpoint.network.config

    # 1. What a LeRobot robot sends: images in [0, 1], channels first; state in SI units, in the slots of the action.
    raw = {"task": observation.task}
    for camera, key in camera_keys(config).items():
        pixels = torch.from_numpy(observation.images[camera].copy())
        raw[key] = pixels.permute(2, 0, 1).to(torch.float32) / 255.0
        show(key, raw[key])
    raw["observation.state"] = torch.from_numpy(state_numbers(checkpoint.state, observation).astype(np.float32))
    show("observation.state", raw["observation.state"], "[m, 1, rad]")

    # 2. The pre-processor normalises the state to [-1, 1], writes it into the prompt in 256 bins, and tokenizes.
    batch = checkpoint.preprocessor(raw)
    show("observation.state", batch["observation.state"], "normalised; the network never reads it")
    print(f"prompt: {batch['task'][0]!r}")
    tokens, masks = batch["observation.language.tokens"], batch["observation.language.attention_mask"]
    show("tokens", tokens)
    show("masks", masks, f"{int(masks.sum())} of {masks.shape[1]} tokens are used")

    with torch.no_grad():
        # 3. Images: padded to a square, resized, to [-1, 1]. This method of LeRobot's is private, but the only one.
        images, img_masks = network._preprocess_images(batch)
        for image, mask in zip(images, img_masks, strict=True):
            show("images[i]", image)
            show("img_masks[i]", mask)

        # 4. What the language model attends to: image tokens, then text tokens. The state is in the text.
        embs, pad_masks, att_masks = network.model.embed_prefix(images, img_masks, tokens, masks)
        show("embed_prefix: embs", embs)
        show("embed_prefix: pad_masks", pad_masks)
        show("embed_prefix: att_masks", att_masks, "all 0: every token sees every other")

        # 5. Noise to actions, in num_steps Euler steps from t = 1 to t = 0. `sample_actions` embeds the prefix itself.
        generator = torch.Generator(device=tokens.device).manual_seed(0)
        shape = (1, config.chunk_size, config.max_action_dim)
        noise = torch.randn(shape, generator=generator, device=tokens.device)
        show("noise", noise)
        padded = network.model.sample_actions(images, img_masks, tokens, masks, noise, num_steps)
        show("sample_actions", padded, "normalised, padded to max_action_dim")

    # 6. `predict_action_chunk` would return this; `select_action` would hand it out row by row.
    normalised = padded[:, :, : config.output_features["action"].shape[0]]
    show("predict_action_chunk", normalised, "normalised")

    # 7. The post-processor gives the numbers their units back, for the whole chunk at once.
    actions = checkpoint.postprocessor(normalised)[0].double().numpy()
    show("postprocessor", actions, "[m, 1, rad]")
    return Trace(batch, noise, normalised, actions)


def main(path: str | Path, seconds: float = 0.5) -> Trace:
    """One chunk through network and controller."""
    policy = LeRobotPolicy.from_pretrained(path)
    kind = policy.checkpoint.network.config.type
    if kind != "pi05":
        raise SystemExit(f"{path} is a '{kind}'; this example takes π0.5 apart, LeRobotPolicy runs the others too")
    robot = g1()
    supervisor, plant = Supervisor(robot), MujocoPlant(robot)
    state = plant.reset()
    supervisor.reset(state)
    observation = observe(robot, supervisor, state, TASK, cameras(policy))
    trace = network_by_hand(policy, observation)

    # 8. Numbers become poses, in the frame of the layout as it was measured in this observation.
    chunk = decode(policy.spec, trace.actions, Anchor.measured(observation), t_obs=observation.time)
    for name, value in chunk.arrays().items():
        show(f"chunk.{name}", value)

    # 9. The controller follows them with the whole body, at 500 Hz.
    print(f"accept: {supervisor.accept(chunk)}")
    for _ in range(round(seconds / plant.control_dt)):
        command = supervisor.step(state)
        state = plant.step(command)
    print(f"after {seconds} s: {supervisor.status.status.value}, pelvis at {state.q[2]:.3f} m")
    for name in ("q", "dq", "tau", "kp", "kd"):
        show(f"command.{name}", getattr(command, name))
    for name in ("waist_pitch_joint", "left_shoulder_pitch_joint", "left_elbow_joint", "right_hand_index_0_joint"):
        i = robot.joint_names.index(name)
        print(f"  {name:28s} {command.q[i]:+.4f} rad  {command.tau[i]:+7.3f} N m")
    return trace


def cameras(policy: LeRobotPolicy) -> dict[str, np.ndarray]:
    """Made-up pictures in the sizes of the policy: any uint8 (height, width, 3) RGB will do."""
    images = {}
    for camera, key in camera_keys(policy.checkpoint.network.config).items():
        height, width = policy.checkpoint.network.config.image_features[key].shape[1:]
        rows, columns = np.mgrid[0:height, 0:width]
        images[camera] = np.stack([rows % 256, columns % 256, (rows + columns) % 256], axis=-1).astype(np.uint8)
    return images


def show(name: str, value: torch.Tensor | np.ndarray, meaning: str = "") -> None:
    """Name, shape, type and range of an array."""
    kind = str(value.dtype).removeprefix("torch.")
    ends = "" if kind == "bool" else f"{float(value.min()):+.3f} .. {float(value.max()):+.3f}"
    print(f"{name:32s} {tuple(value.shape)!s:20s} {kind:8s} {ends:20s} {meaning}".rstrip())


def main_with_tiny_weights() -> Trace:
    """The same with a π0.5 of a million parameters, random on purpose: the one that the tests use."""
    sys.path.insert(0, str(Path(__file__).parent.parent))
    from tests.support.tiny_policies import tiny_backbones, write_checkpoint

    with TemporaryDirectory() as folder, tiny_backbones():
        return main(write_checkpoint("pi05", folder))


if __name__ == "__main__":
    main(sys.argv[1]) if len(sys.argv) > 1 else main_with_tiny_weights()
