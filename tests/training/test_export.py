"""An ACT of random weights with two layers of each kind, compared with LeRobot's own on its whole way."""

import sys

import numpy as np
import pytest
import torch
from lerobot.configs import FeatureType, NormalizationMode, PolicyFeature
from lerobot.policies import make_pre_post_processors
from lerobot.policies.act.configuration_act import ACTConfig
from lerobot.policies.act.modeling_act import ACTPolicy

from policy.errors import PolicyError
from policy.learned.act import ACTION, SHOWN, STATE, ActNetwork
from training.export import arrays_of, main

SIZES = {STATE: 29, SHOWN: 6, ACTION: 32}


def trained(**settings):
    """Policy and statistics."""
    torch.manual_seed(0)
    rng = np.random.default_rng(0)
    kinds = {STATE: FeatureType.STATE, SHOWN: FeatureType.ENV, ACTION: FeatureType.ACTION}
    features = {key: PolicyFeature(kinds[key], (size,)) for key, size in SIZES.items()}
    config = ACTConfig(
        device="cpu", input_features={key: features[key] for key in (STATE, SHOWN)},
        output_features={ACTION: features[ACTION]}, chunk_size=7, n_action_steps=7, dim_model=32, n_heads=4,
        dim_feedforward=48, n_encoder_layers=2, n_decoder_layers=2, n_vae_encoder_layers=1, latent_dim=4,
        normalization_mapping=dict.fromkeys(("STATE", "ENV", "ACTION"), NormalizationMode.MEAN_STD) | settings,
    )  # fmt: skip
    policy = ACTPolicy(config)
    with torch.no_grad():
        for value in policy.parameters():
            value.add_(0.1 * torch.randn_like(value))  # LeRobot begins with zeros in places
    stats = {key: {"mean": rng.normal(size=size), "std": rng.uniform(0.1, 2.0, size)} for key, size in SIZES.items()}
    return policy, stats


def test_it_says_what_lerobots_says():
    policy, stats = trained()
    network = ActNetwork(arrays_of(policy, stats))
    before, after = make_pre_post_processors(policy.config, dataset_stats=stats)
    rng = np.random.default_rng(1)
    for scale in (0.0, 1.0, 3.0):
        given = {key: stats[key]["mean"] + scale * rng.normal(size=SIZES[key]) for key in (STATE, SHOWN)}
        batch = before({key: torch.tensor(value, dtype=torch.float32) for key, value in given.items()})
        said = after(policy.predict_action_chunk(batch))[0].numpy()
        assert said.shape == (network.horizon, SIZES[ACTION])
        assert np.abs(network.chunk(given[STATE], given[SHOWN]) - said).max() < 1e-5


def test_a_checkpoint_is_exported_to_a_file_of_the_same_network(tmp_path, monkeypatch):
    policy, stats = trained()
    folder, file = tmp_path / "checkpoint", tmp_path / "act.npz"
    policy.save_pretrained(folder)
    for processor in make_pre_post_processors(policy.config, dataset_stats=stats):
        processor.save_pretrained(folder)
    monkeypatch.setattr(sys, "argv", ["training.export", str(folder), str(file)])
    main()
    numbers = np.ones(SIZES[STATE]), np.ones(SIZES[SHOWN])
    exported, same = ActNetwork.load(file), ActNetwork(arrays_of(policy, stats))
    np.testing.assert_allclose(exported.chunk(*numbers), same.chunk(*numbers), atol=1e-6)


def test_another_normalisation_is_refused():
    with pytest.raises(ValueError, match="MIN_MAX"):
        arrays_of(*trained(STATE=NormalizationMode.MIN_MAX))
    policy, stats = trained()
    del policy.config.normalization_mapping["ENV"]
    with pytest.raises(ValueError, match="ENV is normalised by nothing"):
        arrays_of(policy, stats)


def test_a_file_that_lacks_weights_is_refused(tmp_path):
    policy, stats = trained()
    arrays = arrays_of(policy, stats)
    del arrays["action_head.bias"]
    np.savez(tmp_path / "act.npz", **arrays)
    with pytest.raises(PolicyError, match=r"action_head\.bias"):
        ActNetwork.load(tmp_path / "act.npz")
