"""docs/policy_contract.md against LeRobot's own classes: every row of its tables, and every sentence marked (t).

Strategy: tiny instances with random weights; a layout of 27 numbers, so that action, state and padding differ in width;
a batch of two, three cameras that are no squares. The page's shapes are evaluated with the sizes of that instance.
"""

import dataclasses
import re
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest
import torch

from models import g1
from policy.action_spec.anchor import Anchor
from policy.action_spec.builtin import builtin
from policy.action_spec.codec import decode
from policy.action_spec.state import state_layout, state_numbers
from policy.lerobot.policy import LeRobotPolicy
from tests.support.tiny_policies import CAMERAS, WIDTH, config, observation, shorter, tiny_backbones, write_checkpoint
from wholebody.episode.run import observe
from wholebody.execution.supervisor import Supervisor
from wholebody.sim.plant import MujocoPlant

PAGE = (Path(__file__).parents[3] / "docs" / "policy_contract.md").read_text()
SPEC = builtin("wbc27")
HEIGHT, BREADTH, RESOLUTION = 48, 64, 56
SIZES = {
    "B": 2,
    "C": len(CAMERAS),
    "N": (RESOLUTION // 14) ** 2,
    "R": RESOLUTION,
    "W": WIDTH,
    "E": WIDTH,
    "H": SPEC.horizon,
    "A": SPEC.dim,
    "S": SPEC.dim,
    "D": 32,
    "h": HEIGHT,
    "w": BREADTH,
}
TASKS = ["pick up the can", "open_the drawer\n"]


def table(heading):
    """Rows of the first table after a heading, as lists of cells."""
    text = PAGE.split(heading, 1)[1]
    lines = re.search(r"(?:^\|.*\n)+", text, flags=re.MULTILINE).group().splitlines()
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[2:]]


def load(kind, folder):
    with tiny_backbones():
        return LeRobotPolicy.from_pretrained(write_checkpoint(kind, folder, spec=SPEC))


@pytest.fixture(scope="module")
def policies(tmp_path_factory):
    return {kind: load(kind, tmp_path_factory.mktemp(kind)) for kind in ("pi05", "pi0")}


def seen(seed=0):
    at, rng = observation(), np.random.default_rng(seed)
    images = {name: rng.integers(0, 256, (HEIGHT, BREADTH, 3), dtype=np.uint8) for name in CAMERAS}
    return dataclasses.replace(at, images=images, task=TASKS[0])


def raw_inputs(at=None, *, shift=0.0):
    """Two observations as LeRobot's pre-processor takes them, stacked."""
    at = at or seen()
    state = torch.from_numpy(state_numbers(state_layout(SPEC), at).astype(np.float32)) + shift
    raw = {"observation.state": state.expand(2, -1).clone(), "task": list(TASKS)}
    for name in CAMERAS:
        image = torch.from_numpy(at.images[name]).permute(2, 0, 1).to(torch.float32) / 255.0
        raw[f"observation.images.{name}"] = image.expand(2, -1, -1, -1).clone()
    return raw


def batch_of(policy, **changes):
    return policy.checkpoint.preprocessor(raw_inputs(**changes))


def noise(seed=0):
    return torch.randn((2, SPEC.horizon, 32), generator=torch.Generator().manual_seed(seed))


def predict(policy, batch, **settings):
    return policy.checkpoint.network.predict_action_chunk(dict(batch), **{"noise": noise()} | settings)


@pytest.fixture(scope="module")
def tensors(policies):
    """Everything that the tables list, by policy and name."""
    return {"pi05": through_pi05(policies["pi05"]), "pi0": through_pi0(policies["pi0"])}


def through_pi05(policy):
    at, network = seen(), policy.checkpoint.network
    batch = batch_of(policy)
    tokens, masks = batch["observation.language.tokens"], batch["observation.language.attention_mask"]
    with torch.no_grad():
        images, img_masks = network._preprocess_images(batch)
        embs, pad_masks, att_masks = network.model.embed_prefix(images, img_masks, tokens, masks)
        padded = network.model.sample_actions(images, img_masks, tokens, masks, noise(), 3)
    chunk = predict(policy, batch, num_steps=3)
    network.reset()
    row = network.select_action(dict(batch))
    network.reset()
    actions = policy.checkpoint.postprocessor(chunk)
    decoded = decode(SPEC, actions[0].double().numpy(), Anchor.measured(at))
    raw = {name: value[0] for name, value in raw_inputs(at).items()}
    return {
        "Observation.images[NAME]": at.images["head"],
        "raw observation.images.NAME": raw["observation.images.head"],
        "raw observation.state": raw["observation.state"],
        "batch observation.images.NAME": batch["observation.images.head"],
        "batch observation.state": batch["observation.state"],
        "batch tokens": tokens,
        "batch masks": masks,
        "images[i]": images,
        "img_masks[i]": img_masks,
        "embed_prefix embs": embs,
        "embed_prefix pad_masks": pad_masks,
        "embed_prefix att_masks": att_masks,
        "noise": network.model.sample_noise((2, SPEC.horizon, 32), "cpu"),
        "sample_actions": padded,
        "predict_action_chunk": chunk,
        "select_action": row,
        "postprocessor": actions,
        "chunk.T_world_lhand": decoded.T_world_lhand,
        "chunk.q_lhand": decoded.q_lhand,
        "command.q": commanded(decoded),
    }


def commanded(chunk):
    """First joint targets for a chunk."""
    spec = g1()
    supervisor, plant = Supervisor(spec), MujocoPlant(spec)
    state = plant.reset()
    supervisor.reset(state)
    assert observe(spec, supervisor, state).q_body.shape == (29,)
    supervisor.accept(chunk)
    return supervisor.step(state).q


def through_pi0(policy):
    network, batch = policy.checkpoint.network, batch_of(policy)
    tokens, masks = batch["observation.language.tokens"], batch["observation.language.attention_mask"]
    with torch.no_grad():
        images, img_masks = network._preprocess_images(batch)
        state = network.prepare_state(batch)
        padded = network.model.sample_actions(images, img_masks, tokens, masks, state, noise(), 3)
        suffix = network.model.embed_suffix(state, noise(), torch.ones(2))[0]
        projected = network.model.state_proj(state)
    assert torch.equal(suffix[:, 0], projected)
    return {
        "batch observation.state": batch["observation.state"],
        "batch tokens": tokens,
        "padded state": state,
        "state_proj": projected,
        "embed_suffix embs": suffix,
        "sample_actions": padded,
        "predict_action_chunk": predict(policy, batch, num_steps=3),
    }


ROWS = [(kind, row) for kind, heading in (("pi05", "### π0.5"), ("pi0", "### π0\n")) for row in table(heading)]


@pytest.mark.parametrize(("kind", "row"), ROWS, ids=[f"{kind} {row[0]}" for kind, row in ROWS])
def test_every_row_of_the_tables_is_what_the_real_classes_have(tensors, kind, row):
    name, shape, dtype, ends, _ = row
    sizes = SIZES | {"T": 200 if kind == "pi05" else 48}
    expected = eval(shape.strip("`"), {"__builtins__": {}}, sizes)
    found = tensors[kind][name.strip("`")]
    found = found if isinstance(found, list) else [found]
    if name == "`images[i]`":
        assert len(found) == sizes["C"]
    for value in found:
        assert tuple(value.shape) == expected
        assert str(value.dtype).removeprefix("torch.") == dtype
        assert torch.isfinite(torch.as_tensor(value).to(torch.float64)).all()
        if ends.startswith("`["):
            low, high = (float(end) for end in ends.strip("`[]").split(","))
            assert low <= float(value.min())
            assert float(value.max()) <= high
    assert len(tensors[kind]) == sum(k == kind for k, _ in ROWS)


def test_images_fill_their_range(tensors):
    images = tensors["pi05"]["images[i]"]
    assert min(float(image.min()) for image in images) == -1.0
    assert max(float(image.max()) for image in images) > 0.9


# How the state enters.


def test_pi05_never_reads_the_state_of_the_batch(policies):
    policy = policies["pi05"]
    batch = batch_of(policy)
    blind = dict(batch) | {"observation.state": torch.full((2, SPEC.dim), float("nan"))}
    assert torch.equal(predict(policy, batch), predict(policy, blind))
    assert not [name for name in policy.checkpoint.network.state_dict() if "state" in name]


def test_pi05_reads_the_state_in_the_prompt(policies):
    policy = policies["pi05"]
    here, there = batch_of(policy), batch_of(policy, shift=0.015)
    assert not torch.equal(here["observation.language.tokens"], there["observation.language.tokens"])
    assert not torch.equal(predict(policy, here), predict(policy, there))


def test_the_prompt_of_pi05_has_task_and_bins(policies):
    batch = batch_of(policies["pi05"], shift=0.004)
    numbers = (batch["observation.state"][0].numpy() + 1.0) * 128.0
    assert (numbers > 0.0).all()
    bins = " ".join(str(min(int(number), 255)) for number in numbers)
    assert batch["task"][0] == f"Task: pick up the can, State: {bins};\nAction: "
    assert batch["task"][1].startswith("Task: open the drawer, State: ")


@pytest.mark.parametrize(("shift", "text"), [(1.0, "255"), (-1.0, "-1"), (float("nan"), "255")])
def test_a_state_outside_its_range_becomes_one_and_the_same_text(policies, shift, text):
    prompt = batch_of(policies["pi05"], shift=shift)["task"][0]
    assert re.search("State: (.*);", prompt).group(1) == " ".join([text] * SPEC.dim)


def test_pi0_reads_the_state_through_state_proj_and_not_in_the_prompt(policies):
    policy = policies["pi0"]
    here, there = batch_of(policy), batch_of(policy, shift=0.015)
    assert here["task"] == ["pick up the can\n", "open_the drawer\n"]
    assert torch.equal(here["observation.language.tokens"], there["observation.language.tokens"])
    assert not torch.equal(predict(policy, here), predict(policy, there))
    state = policy.checkpoint.network.prepare_state(here)
    assert torch.equal(state[:, : SPEC.dim], here["observation.state"])
    assert not state[:, SPEC.dim :].any()
    assert policy.checkpoint.network.model.state_proj.in_features == 32


# Which settings shape the action.

CHANGED = {
    "chunk_size": {"spec": shorter(SPEC, 20)},
    "n_action_steps": {"n_action_steps": 7},
    "max_action_dim": {"max_action_dim": 40},
    "max_state_dim": {"max_state_dim": 40},
    "num_inference_steps": {"num_inference_steps": 3},
    "image_resolution": {"image_resolution": (70, 70)},
    "tokenizer_max_length": {"tokenizer_max_length": 300},
    "empty_cameras": {"empty_cameras": 1},
    "dtype": {"dtype": "bfloat16"},
    "use_relative_actions": {"use_relative_actions": True},
}
"""Another value of each setting, but for the two variants, which the tiny instances replace."""


def weights(kind, **changes):
    """Shape of every weight of a tiny network."""
    from lerobot.policies.factory import get_policy_class

    settings = {"spec": SPEC} | changes
    with tiny_backbones():
        network = get_policy_class(kind)(config(kind, **settings))
    return {name: tuple(tensor.shape) for name, tensor in network.state_dict().items()}


@pytest.mark.parametrize("kind", ["pi05", "pi0"])
@pytest.mark.parametrize("row", table("## 2. Which settings"), ids=lambda row: row[0])
def test_every_setting_has_the_default_of_the_page_and_is_in_the_weights_or_not(kind, row):
    from lerobot.policies.factory import make_policy_config

    name, *defaults, in_weights, _ = (cell.strip("`") for cell in row)
    assert str(getattr(make_policy_config(kind, device="cpu"), name)) == defaults[("pi05", "pi0").index(kind)]
    if name not in CHANGED:
        assert name.endswith("_variant")
        return
    expected = {"yes": True, "no": False, "π0 only": kind == "pi0"}[in_weights]
    assert (weights(kind, **CHANGED[name]) != weights(kind)) == expected


# What the calls take and return.


def test_predict_action_chunk_is_sample_actions_without_the_padding(tensors):
    found = tensors["pi05"]
    assert torch.equal(found["predict_action_chunk"], found["sample_actions"][:, :, : SPEC.dim])
    assert found["sample_actions"][:, :, SPEC.dim :].abs().max() > 0.0
    found = tensors["pi0"]
    assert torch.equal(found["predict_action_chunk"], found["sample_actions"][:, :, : SPEC.dim])


def test_denoising_takes_equal_steps_from_noise_at_1_to_actions_at_0(policies, monkeypatch):
    policy, times = policies["pi05"], []

    def velocity(*, x_t, timestep, **_):
        times.append(timestep.tolist())
        return torch.ones_like(x_t)

    monkeypatch.setattr(policy.checkpoint.network.model, "denoise_step", velocity)
    chunk = predict(policy, batch_of(policy), num_steps=4)
    assert times == [[t, t] for t in (1.0, 0.75, 0.5, 0.25)]
    assert torch.allclose(chunk, noise()[:, :, : SPEC.dim] - 1.0, atol=1e-6)


def test_noise_beyond_the_action_changes_the_action(policies):
    policy = policies["pi05"]
    batch, other = batch_of(policy), noise()
    other[:, :, SPEC.dim :] += 1.0
    assert not torch.equal(predict(policy, batch), predict(policy, batch, noise=other))


def test_without_noise_the_same_observation_gives_another_chunk(policies):
    policy = policies["pi05"]
    batch = batch_of(policy)
    assert not torch.equal(predict(policy, batch, noise=None), predict(policy, batch, noise=None))


def test_a_misspelt_keyword_is_swallowed(policies):
    policy = policies["pi05"]
    batch = batch_of(policy)
    assert torch.equal(predict(policy, batch, num_stepss=1), predict(policy, batch))


def test_select_action_is_deaf_to_new_observations_and_tasks_until_its_queue_is_empty(policies):
    policy = policies["pi05"]
    network = policy.checkpoint.network
    with ExitStack() as stack:
        stack.callback(network.reset)
        network.reset()
        torch.manual_seed(0)
        chunk = network.predict_action_chunk(dict(batch_of(policy)))
        torch.manual_seed(0)
        other = batch_of(policy, at=seen(seed=5), shift=0.015)
        rows = [network.select_action(dict(batch_of(policy)))]
        rows += [network.select_action(dict(other)) for _ in range(SPEC.horizon - 1)]
        assert torch.equal(torch.stack(rows, dim=1), chunk)
        torch.manual_seed(1)
        after = network.select_action(dict(other))
        torch.manual_seed(1)
        assert torch.equal(after, network.predict_action_chunk(dict(other))[:, 0])


def test_a_missing_camera_is_masked_and_the_others_take_its_place(policies):
    network, batch = policies["pi05"].checkpoint.network, batch_of(policies["pi05"])
    whole, _ = network._preprocess_images(batch)
    del batch[f"observation.images.{CAMERAS[0]}"]
    images, masks = network._preprocess_images(batch)
    assert torch.equal(images[0], whole[1])
    assert torch.equal(images[1], whole[2])
    assert (images[2] == -1.0).all()
    assert [mask.tolist() for mask in masks] == [[True, True], [True, True], [False, False]]


def test_the_code_of_the_page_names_what_exists():
    from policy.remote.client import RemoteOptions
    from policy.remote.openpi import KeyMap

    fields = {field.name for kind in (KeyMap, RemoteOptions) for field in dataclasses.fields(kind)}
    section = PAGE.split("## 5. On another computer")[1]
    for name in (
        "state",
        "images",
        "prompt",
        "actions",
        "assume_spec",
        "keys",
        "connect_timeout",
        "timeout",
        "first_timeout",
    ):
        assert name in fields
        assert name in section
    defaults = RemoteOptions()
    assert f"`timeout` {defaults.timeout:g} s" in section
    assert f"`first_timeout` {defaults.first_timeout:g} s" in section.replace("\n", " ")
    assert f"`connect_timeout` {defaults.connect_timeout:g} s" in section
