"""``python -m training.export CHECKPOINT FILE``: an ACT of LeRobot as arrays, which `policy.learned.act` runs."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from policy.learned.act import ACTION, FILE_MAX, HEADS, SHOWN, STATE

LEFT_OUT = ("vae_encoder", "encoder_latent_input_proj.weight")
"""Beginnings of names of what only training uses, and of what a latent of 0 does not need."""
EXPECTED = {"feedforward_activation": "relu", "pre_norm": False, "temporal_ensemble_coeff": None}
"""Settings of ACT of which there is but one way to run them here."""


def arrays_of(policy: Any, stats: dict[str, dict[str, Any]]) -> dict[str, np.ndarray]:
    """Arrays of an `ACTPolicy` whose numbers are scaled by the means and standard deviations of statistics.

    Raises:
        ValueError: If it sees pictures, lacks the state or what is shown of a task, or is set up in another way.
    """
    config = policy.config
    if config.image_features or set(config.input_features) != {STATE, SHOWN}:
        raise ValueError(f"it reads {', '.join(config.input_features)}; {STATE} and {SHOWN} are expected")
    if wrong := [name for name, value in EXPECTED.items() if getattr(config, name) != value]:
        raise ValueError(f"{wrong[0]} is {getattr(config, wrong[0])}; {EXPECTED[wrong[0]]} is expected")
    modes = {kind: config.normalization_mapping.get(kind) for kind in ("STATE", "ENV", "ACTION")}
    if other := [kind for kind, mode in modes.items() if mode is None or mode.value != "MEAN_STD"]:
        found = modes[other[0]].value if modes[other[0]] else "nothing"
        raise ValueError(f"{other[0]} is normalised by {found}; not MEAN_STD")
    weights = {name.removeprefix("model."): value for name, value in policy.state_dict().items()}
    arrays = {
        name: value.detach().cpu().float().numpy() for name, value in weights.items() if not name.startswith(LEFT_OUT)
    }
    for key in (STATE, SHOWN, ACTION):
        arrays |= {f"{key}.{name}": np.array(stats[key][name], dtype=float) for name in ("mean", "std")}
    return arrays | {HEADS: np.array(config.n_heads)}


def write(file: Path, arrays: dict[str, np.ndarray]) -> None:
    """Write arrays to a file, and tell its size.

    Raises:
        SystemExit: If it would not be read.
    """
    np.savez_compressed(file, **arrays)
    size = file.stat().st_size
    if size > FILE_MAX:
        raise SystemExit(f"{file} has {size} bytes; at most {FILE_MAX} are read")
    print(f"wrote {file}, {size / 1e6:.2f} MB")


def main() -> None:
    """Export what is named."""
    parser = argparse.ArgumentParser(prog="python -m training.export", description=__doc__)
    parser.add_argument("checkpoint", type=Path, help="folder with config.json and model.safetensors")
    parser.add_argument("file", type=Path)
    given = parser.parse_args()
    from lerobot.policies.act.modeling_act import ACTPolicy
    from lerobot.policies.factory import make_pre_post_processors

    from policy.lerobot.stats import normaliser

    policy = ACTPolicy.from_pretrained(given.checkpoint)
    before, _ = make_pre_post_processors(policy.config, pretrained_path=str(given.checkpoint))
    write(given.file, arrays_of(policy, normaliser(before).stats))


if __name__ == "__main__":
    main()
