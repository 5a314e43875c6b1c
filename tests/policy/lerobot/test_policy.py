"""LeRobot's policies as policies of the G1: round trips, inputs, sampling, tasks, relative actions.

Strategy: the real classes in tiny instances (`tiny_policies`). What we return is compared with what LeRobot's own
calls return, and where LeRobot does something in silence, the test shows that first.
"""

import dataclasses
from time import thread_time

import numpy as np
import pytest
import torch
from lerobot.policies.utils import prepare_observation_for_inference
from lerobot.processor.relative_action_processor import to_relative_actions

from policy.action_spec.anchor import Anchor
from policy.action_spec.builtin import builtin
from policy.action_spec.state import state_layout, state_numbers
from policy.base import Policy
from policy.errors import ChunkError, ObservationError, PolicyError, SpecError
from policy.findings import CheckpointError
from policy.lerobot.spec import write_specs
from policy.placeholder_cameras import grey_images
from tests.support import tiny_policies as tiny
from wholebody.cli.sources import open_source


def noise_of(config, seed=0):
    dims = getattr(config, "max_action_dim", None) or config.action_feature.shape[0]
    steps = config.chunk_size if hasattr(config, "max_action_dim") else config.horizon
    return np.random.default_rng(seed).standard_normal((steps, dims)).astype(np.float32)


def plain_lerobot(network, pre, post, observation, **settings):
    """The chunk as a user of LeRobot would compute it."""
    raw = {f"observation.images.{name}": image for name, image in observation.images.items()}
    raw["observation.state"] = state_numbers(state_layout(tiny.SPEC), observation).astype(np.float32)
    batch = pre(prepare_observation_for_inference(raw, torch.device("cpu"), task=observation.task))
    if network.config.type == "diffusion":
        for key in ("observation.state", *network.config.image_features):
            batch[key] = torch.stack([batch[key]] * network.config.n_obs_steps, dim=1)
    with torch.no_grad():
        return post(network.predict_action_chunk(batch, **settings))[0].numpy()


@pytest.mark.parametrize("kind", tiny.POLICIES)
def test_a_saved_policy_gives_the_same_chunk_as_before_saving(kind, tmp_path):
    network, pre, post = tiny.build(kind, tmp_path, seed=3)
    seen = tiny.observation()
    settings = {} if kind == "act" else {"noise": noise_of(network.config)}
    torch.manual_seed(0)
    wanted = plain_lerobot(network, pre, post, seen, **{k: torch.from_numpy(v)[None] for k, v in settings.items()})

    for part in (network, pre, post):
        part.save_pretrained(tmp_path)
    write_specs(tmp_path, tiny.SPEC)
    policy = tiny.load(tmp_path)
    torch.manual_seed(0)
    assert np.array_equal(policy.predict(seen, **settings), wanted)


@pytest.mark.parametrize("kind", tiny.POLICIES)
def test_chunks_are_valid_numbered_and_start_at_the_observation(kind, tmp_path_factory):
    policy, before = tiny.load(tiny.saved(kind, tmp_path_factory), seed=0, clamp=1.0), None
    assert isinstance(policy, Policy)
    assert policy.sees_robot
    for i in range(3):
        chunk = policy.infer(tiny.observation(2.0 + 0.5 * i))
        chunk.validate(after=before)
        assert (chunk.seq, len(chunk), chunk.t_obs, chunk.spec_id) == (i, 50, 2.0 + 0.5 * i, policy.spec.id)
        before = chunk
    policy.reset()
    assert policy.infer(tiny.observation(0.0)).seq == 0


@pytest.fixture
def pi05(tmp_path_factory):
    return tiny.load(tiny.saved("pi05", tmp_path_factory), seed=0, clamp=1.0)


@pytest.fixture
def act(tmp_path_factory):
    return tiny.load(tiny.saved("act", tmp_path_factory))


def test_a_seed_makes_every_episode_the_same_and_every_chunk_another(pi05):
    first = [pi05.predict(tiny.observation()), *(pi05.infer(tiny.observation(t)).T_world_lhand for t in (0.0, 0.5))]
    pi05.reset()
    again = [pi05.predict(tiny.observation()), *(pi05.infer(tiny.observation(t)).T_world_lhand for t in (0.0, 0.5))]
    assert all(np.array_equal(*pair) for pair in zip(first, again, strict=True))
    assert not np.array_equal(first[1], first[2])


def test_without_a_seed_the_random_numbers_of_the_program_are_used(tmp_path_factory):
    """Trap 23: the same observation gives another chunk every time."""
    policy = tiny.load(tiny.saved("pi05", tmp_path_factory))
    chunks = [policy.predict(tiny.observation()) for _ in range(2)]
    assert not np.array_equal(*chunks)


def test_a_seed_leaves_the_programs_random_numbers_alone(pi05):
    torch.manual_seed(5)
    wanted = torch.rand(3)
    torch.manual_seed(5)
    pi05.infer(tiny.observation())
    assert torch.equal(torch.rand(3), wanted)


@pytest.mark.parametrize("kind", ["pi05", "pi0", "smolvla", "diffusion"])
def test_fewer_denoising_steps_are_fewer_calls_of_the_network(kind, tmp_path_factory):
    policy = tiny.load(tiny.saved(kind, tmp_path_factory), num_steps=3, clamp=1.0)
    network, calls = policy.checkpoint.network, []
    part = network.diffusion.unet if kind == "diffusion" else network.model.action_out_proj
    part.register_forward_hook(lambda *_: calls.append(1))
    policy.predict(tiny.observation())
    assert len(calls) == 3


def test_what_a_policy_does_not_offer_is_refused(tmp_path_factory):
    folder = tiny.saved("act", tmp_path_factory)
    for options, said in (
        ({"num_steps": 3}, "num_steps 3 for 'act'"),
        ({"dtype": "bfloat16"}, "'act' has no choice of dtype"),
        ({"rtc": True}, "'act' has no real-time chunking"),
        ({"device": "cuda:17"}, "device 'cuda:17' cannot be used"),
    ):
        with pytest.raises(CheckpointError, match=said):
            tiny.load(folder, **options)
    with pytest.raises(TypeError, match="num_stepz"):
        tiny.load(folder, num_stepz=3)


def test_noise_of_another_shape_is_refused(pi05, act):
    with pytest.raises(PolicyError, match=r"noise has shape \(50, 28\); \(50, 32\) is expected"):
        pi05.predict(tiny.observation(), noise=np.zeros((50, 28)))
    with pytest.raises(PolicyError, match="'act' does not denoise"):
        act.predict(tiny.observation(), noise=np.zeros((50, 32)))


def test_lerobot_swallows_a_misspelt_setting_and_we_do_not(pi05):
    """Trap 17."""
    batch, _ = pi05.inputs.batch(tiny.observation(), Anchor.measured(tiny.observation()), "go")
    pi05.checkpoint.network.predict_action_chunk(batch, execution_horizonn=10)
    with pytest.raises(TypeError, match="noize"):
        pi05.predict(tiny.observation(), noize=None)


def test_images_reach_the_network_as_lerobot_makes_them(act):
    seen = tiny.observation()
    batch, _ = act.inputs.batch(seen, Anchor.measured(seen), "")
    raw = prepare_observation_for_inference({"observation.images.head": seen.images["head"]}, torch.device("cpu"))
    mean, std = (tiny.stats()["observation.images.head"][name].ravel()[0] for name in ("mean", "std"))
    wanted = (raw["observation.images.head"] - mean) / (std + 1e-8)
    torch.testing.assert_close(batch["observation.images.head"], wanted, rtol=0, atol=1e-6)


def test_lerobot_masks_a_misnamed_camera_and_we_refuse_it(pi05):
    """Trap 13: with one camera of three under its name, two black ones are made up, and the order changes."""
    seen = tiny.observation()
    batch, _ = pi05.inputs.batch(seen, Anchor.measured(seen), "go")
    for name in ("head", "left_wrist"):
        batch[f"observation.images.{name}_camera"] = batch.pop(f"observation.images.{name}")
    images, masks = pi05.checkpoint.network._preprocess_images(batch)
    assert [bool(mask) for mask in masks] == [True, False, False]
    assert torch.all(images[1] == -1.0)

    images = {"head_camera": seen.images["head"], **{name: seen.images[name] for name in tiny.CAMERAS[1:]}}
    with pytest.raises(ObservationError, match="lacks head and has head_camera besides"):
        pi05.infer(dataclasses.replace(seen, images=images))


def test_a_camera_that_no_one_asked_for_is_refused_unless_cameras_are_mapped(tmp_path_factory):
    folder = tiny.saved("pi05", tmp_path_factory)
    seen = tiny.observation(cameras=("zed", "left_wrist", "right_wrist", "chest"))
    with pytest.raises(ObservationError, match="lacks head and has chest, zed besides"):
        tiny.load(folder, clamp=1.0).infer(seen)
    assert len(tiny.load(folder, cameras={"head": "zed"}, clamp=1.0).infer(seen)) == 50
    with pytest.raises(CheckpointError, match=r"the policy has no camera 'haed'; did you mean 'head'\?"):
        tiny.load(folder, cameras={"haed": "zed"})


def test_lerobot_shows_a_float_image_of_0_to_255_to_the_network_and_we_take_bytes_only(pi05):
    """Trap 12: at the network's own size nothing is clipped; it sees 509 instead of 1."""
    seen = tiny.observation()
    batch, _ = pi05.inputs.batch(seen, Anchor.measured(seen), "go")
    for name in tiny.CAMERAS:
        batch[f"observation.images.{name}"] = torch.full((1, 3, 56, 56), 255.0)
    images, _ = pi05.checkpoint.network._preprocess_images(batch)
    assert float(images[0].max()) == 509.0

    images = seen.images | {"head": seen.images["head"].astype(np.float32)}
    with pytest.raises(ObservationError, match=r"image 'head' is float32 .* uint8"):
        pi05.infer(dataclasses.replace(seen, images=images))


def test_a_policy_that_does_not_resize_refuses_another_size(act, pi05):
    with pytest.raises(ObservationError, match="camera 'head' is 80 x 80, 'act' was trained with 64 x 64"):
        act.infer(tiny.observation(size=80))
    assert len(pi05.infer(tiny.observation(size=80))) == 50


def test_another_aspect_is_mentioned(pi05):
    seen = tiny.observation()
    images = {name: image[:48] for name, image in seen.images.items()}
    notes = pi05.infer(dataclasses.replace(seen, images=images)).notes
    assert "camera 'head' is 64 x 48, in training 64 x 64: the network sees other black bars" in notes


def test_images_may_be_views_of_a_cameras_buffer(act):
    seen = tiny.observation()
    flipped = {name: image[..., ::-1] for name, image in seen.images.items()}
    for image in flipped.values():
        image.flags.writeable = False
    wanted = {name: image.copy() for name, image in flipped.items()}
    chunks = [act.predict(dataclasses.replace(seen, images=images)) for images in (flipped, wanted)]
    assert np.array_equal(*chunks)


def test_an_empty_task_is_refused(pi05, act):
    """Trap 21: LeRobot makes ``Task: , State: ...`` of it."""
    with pytest.raises(ObservationError, match="there is no task; this policy reads one"):
        pi05.infer(tiny.observation(task="  "))
    act.infer(tiny.observation(task=""))


def test_the_task_comes_from_the_observation_or_reset_or_the_options(tmp_path_factory):
    policy = tiny.load(tiny.saved("pi05", tmp_path_factory), task="c", clamp=1.0)
    prompts = []
    pre = policy.checkpoint.preprocessor
    policy.checkpoint = dataclasses.replace(
        policy.checkpoint, preprocessor=lambda b: prompts.append(b["task"]) or pre(b)
    )
    policy.inputs.checkpoint = policy.checkpoint
    policy.infer(tiny.observation(0.0, task=""))
    policy.reset("b")
    policy.infer(tiny.observation(0.0, task=""))
    policy.infer(tiny.observation(1.0, task="a"))
    assert prompts == ["c", "b", "a"]


def test_lerobot_ignores_a_new_task_until_its_queue_is_empty_and_we_do_not(pi05):
    """Trap 14: select_action pops 50 steps that were planned for the task before."""
    seen = tiny.observation()
    network, anchor = pi05.checkpoint.network, Anchor.measured(seen)
    batches = [pi05.inputs.batch(seen, anchor, task)[0] for task in ("pick up the can", "put it down")]
    calls = []
    network.model.action_out_proj.register_forward_hook(lambda *_: calls.append(1))
    network.select_action(batches[0])
    network.select_action(batches[1])
    assert len(calls) == network.config.num_inference_steps

    calls.clear()
    pi05.infer(tiny.observation(0.0, task="pick up the can"))
    assert not network._action_queue
    pi05.infer(tiny.observation(0.1, task="put it down"))
    assert len(calls) == 2 * network.config.num_inference_steps


def test_lerobots_chunks_are_never_clamped_and_ours_say_so(tmp_path_factory):
    """Trap 11: an untrained head reaches 4 times the range of training."""
    free = tiny.load(tiny.saved("pi05", tmp_path_factory), seed=0)
    held = tiny.load(tiny.saved("pi05", tmp_path_factory), seed=0, clamp=1.0)
    seen = tiny.observation()
    bounds = tiny.stats()["action"]
    assert (free.predict(seen) > bounds["q99"] + 1e-6).any()
    assert (held.predict(seen) <= bounds["q99"] + 1e-6).all()
    (note,) = held.infer(seen).notes
    assert note.endswith("clamped to 1")


def test_a_network_that_returns_no_number_is_refused(tmp_path_factory, monkeypatch):
    policy = tiny.load(tiny.saved("act", tmp_path_factory))
    monkeypatch.setattr(
        policy.checkpoint.network, "predict_action_chunk", lambda batch: torch.full((1, 50, 32), np.nan)
    )
    with pytest.raises(ChunkError, match=r"left_wrist_x\.pos\) is nan at step 0"):
        policy.infer(tiny.observation())


def test_time_that_goes_back_is_refused(act):
    act.infer(tiny.observation(1.0))
    with pytest.raises(ObservationError, match="call reset"):
        act.infer(tiny.observation(0.5))
    act.reset()
    assert act.infer(tiny.observation(0.5)).seq == 0


def test_a_history_is_taken_at_the_policys_own_steps(tmp_path_factory):
    """Diffusion looks one step back; LeRobot fills its queue by select_action only."""
    policy = tiny.load(tiny.saved("diffusion", tmp_path_factory))
    seen = [tiny.observation(t, seed=i) for i, t in enumerate((0.0, 0.033, 0.066, 0.1))]
    for observation in seen[:-1]:
        policy.observe(observation)
    chunk = policy.infer(seen[-1])
    assert chunk.notes == ()
    queue = policy.checkpoint.network._queues["observation.images"]
    head = [frames[0, 0] for frames in queue]
    wanted = [policy.inputs.batch(o, Anchor.measured(o), "go")[0]["observation.images.head"][0] for o in seen[2:]]
    assert all(torch.equal(*pair) for pair in zip(head, wanted, strict=True))

    policy.reset()
    (note,) = policy.infer(seen[-1]).notes
    assert note.startswith("1 of 2 observations of the history are missing")


def test_relative_actions_are_added_to_the_state_they_answer(tmp_path):
    """Trap 18: LeRobot adds the state that was preprocessed last, whichever chunk it is."""
    spec = tiny.SPEC
    folder = tiny.write_checkpoint("pi05", tmp_path / "pi05", statistics=relative_stats(), use_relative_actions=True)
    policy = tiny.load(folder, seed=0, clamp=0.0)
    checkpoint, seen = policy.checkpoint, tiny.observation()
    moved = np.array(seen.q_body)
    moved[15] += 0.05
    later = dataclasses.replace(seen, time=0.1, q_body=moved)
    states = [state_numbers(state_layout(spec), o) for o in (seen, later)]
    images = {f"observation.images.{name}": torch.zeros(3, 64, 64) for name in tiny.CAMERAS}
    for numbers in states:
        checkpoint.preprocessor({"observation.state": torch.from_numpy(numbers).float(), "task": "go", **images})
    late = checkpoint.postprocessor(torch.zeros(1, 50, 32))[0, 0].numpy()
    assert np.allclose(late, states[1], atol=1e-6)
    assert not np.allclose(late, states[0], atol=1e-3)

    for observation, numbers in zip((seen, later), states, strict=True):
        assert np.allclose(policy.predict(observation), numbers, atol=1e-6)
    (finding,) = (finding for finding in policy.findings if finding.check == "relative")
    assert finding.text.startswith("32 of 32 numbers are predicted relative to the state")


def test_relative_actions_need_a_state_in_the_same_slots(tmp_path):
    folder = tiny.write_checkpoint("pi05", tmp_path / "pi05", statistics=relative_stats(), use_relative_actions=True)
    other = builtin("wbc32-v1")
    turned = [other.slots[1], *other.slots[:1], *other.slots[2:]]
    at, slots = 0, []
    for slot in turned:
        slots.append(dataclasses.replace(slot, start=at))
        at += slot.size
    write_specs(folder, other, dataclasses.replace(other, name="turned", slots=tuple(slots)))
    with pytest.raises(CheckpointError, match="the state layout is 'turned', not 'wbc32'"):
        tiny.load(folder)


def test_relative_actions_that_only_one_processor_knows_of_are_refused(tmp_path):
    folder = tiny.write_checkpoint("pi05", tmp_path / "pi05", statistics=relative_stats(), use_relative_actions=True)
    file = folder / "policy_postprocessor.json"
    file.write_text(file.read_text().replace('"enabled": true', '"enabled": false'))
    with pytest.raises(
        CheckpointError, match=r"on in config\.json and the pre-processor and off in the post-processor"
    ):
        tiny.load(folder)


def test_lerobot_subtracts_quaternions_number_by_number_and_we_refuse_such_a_layout(tmp_path):
    """Trap 19: q and -q are one rotation, and their relative action is 2 q."""
    q = torch.tensor([[0.5, 0.5, 0.5, 0.5]])
    assert torch.equal(to_relative_actions(q, -q, [True] * 4), 2.0 * q)

    layout = quaternion_layout()
    relative = {name: np.full(layout.dim, value, np.float32) for name, value in SMALL.items()}
    statistics = tiny.stats(layout) | {"action": relative}
    folder = tiny.write_checkpoint(
        "pi05", tmp_path / "pi05", spec=layout, statistics=statistics, use_relative_actions=True
    )
    with pytest.raises(CheckpointError, match="subtract left_wrist_rotation, right_wrist_rotation number by number"):
        tiny.load(folder)


def quaternion_layout():
    """wbc32 with quaternions for its rotations."""
    slots, at = [], 0
    for slot in tiny.SPEC.slots:
        changed = {"kind": "quaternion", "size": 4, "rot6d_layout": None, "quaternion_order": "xyzw"}
        slots.append(dataclasses.replace(slot, start=at, **(changed if slot.kind == "rot6d" else {})))
        at += slots[-1].size
    return dataclasses.replace(tiny.SPEC, name="quaternions", slots=tuple(slots))


SMALL = {"mean": 0.0, "std": 0.01, "min": -0.02, "max": 0.02, "q01": -0.02, "q99": 0.02}
"""Statistics of actions relative to the state: around zero."""


def relative_stats():
    return tiny.stats() | {"action": {name: np.full(32, value, np.float32) for name, value in SMALL.items()}}


def test_loading_shows_every_finding(pi05):
    assert isinstance(pi05, Policy)
    checks = [finding.check for finding in pi05.findings]
    assert checks == ["config", "spec", "processors", "features", "statistics", "relative", "prompt", "weights"]
    assert pi05.warnings == ()
    assert pi05.name == "pi05 pi05"


def test_a_checkpoint_without_a_layout_needs_someone_who_vouches(tmp_path):
    folder = tiny.write_checkpoint("act", tmp_path / "act", with_spec=False)
    with pytest.raises(CheckpointError, match=r"action_spec\.json is missing.*--assume-spec wbc32"):
        tiny.load(folder)
    policy = tiny.load(folder, assume_spec="wbc32-v1")
    assert policy.spec.hash == builtin("wbc32-v1").hash


def test_a_checkpoint_of_another_layout_of_the_same_size_is_refused(tmp_path_factory):
    other = builtin("wbc32-v1")
    rows = [dataclasses.replace(s, rot6d_layout="rows") if s.kind == "rot6d" else s for s in other.slots]
    wanted = dataclasses.replace(other, name="rows32", slots=tuple(rows))
    with pytest.raises(CheckpointError, match="has rot6d_layout cols, expected rows"):
        tiny.load(tiny.saved("act", tmp_path_factory), spec=wanted)


def test_state_layouts_are_absolute():
    with pytest.raises(SpecError, match="a state is absolute in every slot"):
        write_specs("nowhere", builtin("gr00t_g1"), builtin("gr00t_g1"))


def test_the_adapter_costs_little_beside_lerobots_own_processors(tmp_path):
    """In CPU time of the thread, the network left out; absolute numbers are in docs/checkpoints.md."""
    policy = tiny.load(tiny.write_checkpoint("act", tmp_path / "act", size=224))
    chunk = torch.zeros(1, 50, 32)
    policy.checkpoint.network.predict_action_chunk = lambda batch: chunk
    _, pre, post = tiny.build("act", tmp_path / "plain", size=224)
    ours, plain = [], []
    for i in range(25):
        seen = tiny.observation(0.1 * i, size=224)
        raw = {f"observation.images.{name}": image for name, image in seen.images.items()}
        raw["observation.state"] = np.zeros(32, np.float32)
        start = thread_time()
        policy.infer(seen)
        middle = thread_time()
        post(pre(prepare_observation_for_inference(raw, torch.device("cpu"), task="")) and chunk)
        ours.append(middle - start)
        plain.append(thread_time() - middle)
    # Measured 1.8 to 1.9; the rest is kinematics, decoding and checks.
    assert np.median(ours) < 3.0 * np.median(plain)


def test_cameras_that_the_robot_lacks_see_grey_only_when_that_is_asked_for(tmp_path_factory):
    policy = tiny.load(tiny.saved("pi05", tmp_path_factory), placeholder_cameras=True, seed=0, clamp=1.0)
    (warning,) = policy.warnings
    assert warning.text.endswith("head, left_wrist, right_wrist see grey: the policy acts blindly")
    blind, grey = tiny.observation(cameras=()), grey_images(policy.cameras)
    assert np.array_equal(policy.predict(blind), policy.predict(dataclasses.replace(blind, images=grey)))
    seen = tiny.observation()
    assert not np.array_equal(policy.predict(seen), policy.predict(blind))
    with pytest.raises(ObservationError, match="lacks head, left_wrist, right_wrist"):
        tiny.load(tiny.saved("pi05", tmp_path_factory)).infer(blind)


def test_a_checkpoint_is_a_source_of_the_command_line(tmp_path_factory):
    with tiny.tiny_backbones():
        policy = open_source(str(tiny.saved("pi05", tmp_path_factory)), 60.0, None, "wave")
    assert len(policy.infer(tiny.observation(cameras=(), task=""))) == 50
    with pytest.raises(CheckpointError, match="is no configuration of a LeRobot policy"):
        open_source(str(tiny.saved("smolvla", tmp_path_factory) / "vlm"), 60.0, None)


def test_a_path_that_holds_nothing_to_run_is_named(tmp_path):
    with pytest.raises(PolicyError, match=r"neither a checkpoint \(it has no config\.json.*nor a dataset"):
        open_source(str(tmp_path), 60.0, None)
    with pytest.raises(PolicyError, match="there is no folder"):
        open_source(str(tmp_path / "outputs"), 60.0, None)
