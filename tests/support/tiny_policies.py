"""Tiny real instances of LeRobot's policies: the same classes and files, small enough for a test, without a network.

π0 and π0.5 store only the name of a backbone variant, so `tiny_backbones` must be active while they are built and while
they are loaded. SmolVLA reads its backbone from a folder, which is written here. Weights are random, from a seed.
"""

from __future__ import annotations

import dataclasses
import shutil
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from unittest import mock

import numpy as np
import torch

from policy.action_spec.anchor import Anchor
from policy.action_spec.builtin import builtin
from policy.action_spec.state import aligned_state, state_layout, state_numbers
from policy.lerobot.policy import LeRobotPolicy
from policy.lerobot.spec import write_specs
from policy.observation import Observation

VOCABULARY = 512
WIDTH, DEPTH = 64, 2
TEXT_POLICIES = ("pi05", "pi0", "smolvla")
POLICIES = ("pi05", "pi0", "smolvla", "act", "diffusion")
CAMERAS = ("head", "left_wrist", "right_wrist")
SPEC = builtin("wbc32-v1")
"""Of checkpoints that exist: their layout stays what it was."""
HALF_RANGE = 0.02
"""Half the range of every number in the made-up statistics around the stance [m, rad]."""


@contextmanager
def tiny_backbones():
    """π0 and π0.5 with two layers of width 64 instead of Gemma 2B and SigLIP."""
    from lerobot.policies.pi0 import modeling_pi0
    from lerobot.policies.pi05 import modeling_pi05

    pi05, pi0 = (mock.patch.multiple(module, **_patches(module)) for module in (modeling_pi05, modeling_pi0))
    with pi05, pi0:
        yield


def _patches(module):
    # Eight heads are written into compute_layer_complete.
    size = {"width": WIDTH, "depth": DEPTH, "mlp_dim": 128, "num_heads": 8, "num_kv_heads": 1, "head_dim": 16}
    vision = {"hidden_size": 32, "num_hidden_layers": 1, "num_attention_heads": 2, "intermediate_size": 64}
    paligemma, gemma = (
        getattr(module, name) for name in ("PaliGemmaForConditionalGenerationWithPiGemma", "PiGemmaForCausalLM")
    )

    def small_paligemma(config):
        for name, value in vision.items():
            setattr(config.vision_config, name, value)
        config.vision_config.projection_dim = config.text_config.hidden_size
        config.text_config.vocab_size = VOCABULARY
        return paligemma(config=config)

    def small_gemma(config):
        config.vocab_size = VOCABULARY
        return gemma(config=config)

    return {
        "get_gemma_config": lambda variant: module.GemmaConfig(**size),
        "PaliGemmaForConditionalGenerationWithPiGemma": small_paligemma,
        "PiGemmaForCausalLM": small_gemma,
    }


def write_tokenizer(folder: Path) -> Path:
    """A tokenizer with one token a character, as Gemma has one a digit, and a beginning-of-sentence token."""
    from tokenizers import Tokenizer, decoders, models, pre_tokenizers, processors
    from transformers import PreTrainedTokenizerFast

    special = ("<pad>", "<bos>", "<eos>", "<unk>", "<image>", "<fake_token_around_image>", "<global-img>", "<end>")
    alphabet = [*special, *sorted(pre_tokenizers.ByteLevel.alphabet())]
    core = Tokenizer(models.BPE({token: i for i, token in enumerate(alphabet)}, [], unk_token="<unk>"))
    core.pre_tokenizer = pre_tokenizers.ByteLevel(add_prefix_space=False)
    core.decoder = decoders.ByteLevel()
    core.post_processor = processors.TemplateProcessing(single="<bos> $A", special_tokens=[("<bos>", 1)])
    tokenizer = PreTrainedTokenizerFast(
        tokenizer_object=core,
        pad_token="<pad>",
        bos_token="<bos>",
        eos_token="<eos>",
        unk_token="<unk>",
        extra_special_tokens={
            "image_token": "<image>",
            "fake_image_token": "<fake_token_around_image>",
            "global_image_token": "<global-img>",
            "end_of_utterance_token": "<end>",
        },
    )
    tokenizer.save_pretrained(folder)
    return folder


def write_smolvlm(folder: Path) -> Path:
    """Configuration and processor of a SmolVLM2 with two layers, as SmolVLA reads them from the hub."""
    from transformers import (
        AutoTokenizer,
        SmolVLMConfig,
        SmolVLMImageProcessor,
        SmolVLMProcessor,
        SmolVLMVideoProcessor,
    )

    write_tokenizer(folder)
    SmolVLMConfig(
        image_token_id=4,
        pad_token_id=0,
        scale_factor=2,
        vision_config={
            "hidden_size": 32,
            "intermediate_size": 64,
            "num_hidden_layers": 1,
            "num_attention_heads": 2,
            "image_size": 64,
            "patch_size": 16,
        },
        text_config={
            "model_type": "llama",
            "hidden_size": WIDTH,
            "intermediate_size": 128,
            "num_hidden_layers": DEPTH,
            "num_attention_heads": 4,
            "num_key_value_heads": 2,
            "head_dim": 16,
            "vocab_size": VOCABULARY,
            "pad_token_id": 0,
        },
    ).save_pretrained(folder)
    SmolVLMProcessor(
        image_processor=SmolVLMImageProcessor(),
        tokenizer=AutoTokenizer.from_pretrained(folder),
        video_processor=SmolVLMVideoProcessor(),
        image_seq_len=4,
    ).save_pretrained(folder)
    return folder


def observation(time=0.0, *, size=64, cameras=CAMERAS, task="pick up the can", seed=0):
    """The nominal stance, seen by some cameras."""
    anchor, rng = Anchor.nominal(), np.random.default_rng(seed)
    images = {name: rng.integers(0, 256, (size, size, 3), dtype=np.uint8) for name in cameras}
    return Observation(
        time, anchor.q_body, anchor.q_lhand, anchor.q_rhand, anchor.T_world_base, images=images, task=task
    )


def stats(spec=SPEC, *, cameras=CAMERAS):
    """Statistics around the stance, as LeRobot writes them: mean, std, min, max and quantiles."""
    visual = {"mean": np.full((3, 1, 1), 0.5), "std": np.full((3, 1, 1), 0.3)}
    layouts = {"observation.state": state_layout(spec), "action": aligned_state(spec)}
    numbers = {key: _around_stance(layout) for key, layout in layouts.items()}
    return numbers | {f"observation.images.{name}": visual for name in cameras}


def _around_stance(layout):
    middle = state_numbers(layout, observation())
    low, high = middle - HALF_RANGE, middle + HALF_RANGE
    for slot in layout.slots:
        if slot.kind == "rot6d":
            low[slot.indices], high[slot.indices] = (np.clip(end[slot.indices], -1.0, 1.0) for end in (low, high))
    spread = np.full(len(middle), 0.5 * HALF_RANGE)
    one = {"mean": middle, "std": spread, "min": low, "max": high, "q01": low, "q99": high}
    return {name: np.asarray(value, np.float32) for name, value in one.items()}


def config(kind, *, spec=SPEC, cameras=CAMERAS, size=64, folder=None, **changes):
    """Configuration of a tiny policy."""
    from lerobot.configs import FeatureType, PolicyFeature
    from lerobot.policies.factory import make_policy_config

    features = {f"observation.images.{name}": PolicyFeature(FeatureType.VISUAL, (3, size, size)) for name in cameras}
    features["observation.state"] = PolicyFeature(FeatureType.STATE, (state_layout(spec).dim,))
    small = {
        "pi05": {"image_resolution": (56, 56), "paligemma_variant": "gemma_300m", "chunk_size": spec.horizon},
        "pi0": {"image_resolution": (56, 56), "paligemma_variant": "gemma_300m", "chunk_size": spec.horizon},
        "smolvla": {
            "vlm_model_name": str(folder and folder / "vlm"),
            "resize_imgs_with_padding": (64, 64),
            "num_vlm_layers": DEPTH,
            "chunk_size": spec.horizon,
        },
        "act": {
            "dim_model": 32,
            "n_heads": 2,
            "dim_feedforward": 32,
            "n_encoder_layers": 1,
            "n_vae_encoder_layers": 1,
            "latent_dim": 8,
            "chunk_size": spec.horizon,
            "pretrained_backbone_weights": None,
        },
        "diffusion": {
            "down_dims": (16, 32),
            "diffusion_step_embed_dim": 16,
            "n_groups": 4,
            "spatial_softmax_num_keypoints": 4,
            "horizon": 64,
            "n_action_steps": spec.horizon,
            "num_train_timesteps": 8,
            "use_separate_rgb_encoder_per_camera": False,
            "pretrained_backbone_weights": None,
        },
    }[kind]
    steps = {} if kind == "diffusion" else {"n_action_steps": spec.horizon}
    return make_policy_config(
        kind,
        device="cpu",
        push_to_hub=False,
        input_features=features,
        output_features={"action": PolicyFeature(FeatureType.ACTION, (spec.dim,))},
        **small | steps | changes,
    )


def build(kind, folder, *, spec=SPEC, seed=0, statistics=None, cameras=CAMERAS, **changes):
    """A tiny policy with its processors, as training makes them; tokenizer and backbone are written into the folder.

    Returns:
        Network, pre-processor, post-processor.
    """
    from lerobot.policies.factory import get_policy_class

    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    tokenizer = write_tokenizer(folder / "tokenizer")
    if kind == "smolvla":
        tokenizer = write_smolvlm(folder / "vlm")
    settings = config(kind, spec=spec, cameras=cameras, folder=folder, **changes)
    torch.manual_seed(seed)
    with tiny_backbones():
        network = get_policy_class(kind)(settings)
    network.eval()
    statistics = stats(spec, cameras=cameras) if statistics is None else statistics
    return network, *processors(settings, tokenizer, statistics)


def processors(settings, tokenizer, statistics):
    """Pre- and post-processor as training makes them, with a tokenizer from a folder."""
    from lerobot.policies.factory import make_pre_post_processors
    from lerobot.processor import tokenizer_processor

    local = partial(tokenizer_processor.AutoTokenizer.from_pretrained, tokenizer)
    with mock.patch.object(tokenizer_processor.AutoTokenizer, "from_pretrained", side_effect=lambda name: local()):
        return make_pre_post_processors(settings, dataset_stats=statistics)


def write_checkpoint(kind, folder, *, spec=SPEC, with_spec=True, **changes):
    """Save a tiny policy with its processors, as training would; returns the folder."""
    for part in build(kind, folder, spec=spec, **changes):
        part.save_pretrained(folder)
    if with_spec:
        write_specs(folder, spec)
    return Path(folder)


def saved(kind, tmp_path_factory):
    """Checkpoint of a kind, made once a test run; `copied` gives one that may be changed."""
    folder = tmp_path_factory.getbasetemp() / "tiny_policies" / kind
    return folder if folder.exists() else write_checkpoint(kind, folder)


def copied(kind, tmp_path_factory, target):
    """A copy of `saved` in a folder of the test's own."""
    return Path(shutil.copytree(saved(kind, tmp_path_factory), target / kind))


def shorter(spec, horizon):
    """The same layout with another number of steps."""
    return dataclasses.replace(spec, horizon=horizon)


def load(folder, **options):
    """A saved policy through our adapter."""
    with tiny_backbones():
        return LeRobotPolicy.from_pretrained(folder, **options)
