"""Prompts: LeRobot cuts them from the right in silence, and in π0.5 the robot's state is at the right.

The tokenizer of these tests has one token a character; Gemma's has one a digit, so a state is about as long in both.
"""

import dataclasses

import numpy as np
import pytest

from policy.action_spec.anchor import Anchor
from policy.action_spec.builtin import builtin
from policy.errors import ObservationError
from policy.findings import CheckpointError
from policy.geometry.se3 import make_transform
from policy.lerobot.policy import LeRobotPolicy
from policy.lerobot.prompt import check_prompt, longest_prompt, token_count, tokenizer_step
from tests.support import tiny_policies as tiny

LONG = "pick up the red can from the left shelf and put it into the blue bin on the right"


@pytest.fixture(scope="module")
def pi05(tmp_path_factory):
    with tiny.tiny_backbones():
        return LeRobotPolicy.from_pretrained(tiny.saved("pi05", tmp_path_factory), seed=0, clamp=1.0)


def test_lerobot_deletes_the_state_behind_a_long_task_and_we_refuse_it(pi05, monkeypatch):
    """Trap 7."""
    seen = tiny.observation(task=LONG)
    step = tokenizer_step(pi05.checkpoint.preprocessor)
    monkeypatch.setattr("policy.lerobot.inputs.require_whole_prompt", lambda *_: None)
    batch, _ = pi05.inputs.batch(seen, Anchor.measured(seen), LONG)
    assert batch["task"][0].endswith(";\nAction: ")
    text = step.input_tokenizer.decode(batch["observation.language.tokens"][0], skip_special_tokens=True)
    assert "Action" not in text
    monkeypatch.undo()

    with pytest.raises(ObservationError, match=r"would be cut to 200, without '.*;\\nAction:'; shorten the task"):
        pi05.infer(seen)
    assert len(pi05.infer(tiny.observation(task="pick up the can"))) == 50


def test_the_longest_prompt_has_the_room_that_the_finding_says(pi05):
    config, state = pi05.checkpoint.network.config, pi05.checkpoint.state
    step = tokenizer_step(pi05.checkpoint.preprocessor)
    (finding,) = check_prompt(config, pi05.checkpoint.preprocessor, state, "")
    assert finding.level == "ok"
    room = step.max_length - token_count(step, longest_prompt(config, state, ""))
    assert f"at most {room} of 200 tokens are left for the task" == finding.text
    assert token_count(step, longest_prompt(config, state, "x" * room)) == 200
    assert check_prompt(config, pi05.checkpoint.preprocessor, state, "x" * room)[0].level == "ok"
    assert check_prompt(config, pi05.checkpoint.preprocessor, state, "x" * (room + 1))[0].level == "error"


def test_a_prompt_of_exactly_the_limit_is_whole(pi05):
    step = tokenizer_step(pi05.checkpoint.preprocessor)
    seen = tiny.observation(task="go")
    batch, _ = pi05.inputs.batch(seen, Anchor.measured(seen), "go")
    used = token_count(step, batch["task"][0])
    task = "go" + "o" * (step.max_length - used)
    batch, _ = pi05.inputs.batch(seen, Anchor.measured(seen), task)
    assert bool(batch["observation.language.attention_mask"].all())
    with pytest.raises(ObservationError, match="the prompt has 201 tokens"):
        pi05.inputs.batch(seen, Anchor.measured(seen), task + "o")


def test_a_state_that_leaves_no_room_is_refused_on_loading(tmp_path):
    """The 43 joints of the G1 in the state, as some feed it: 215 tokens of 200."""
    with tiny.tiny_backbones():
        folder = tiny.write_checkpoint("pi05", tmp_path / "pi05", tokenizer_max_length=140)
        with pytest.raises(CheckpointError, match="the longest prompt has 153 tokens without a task; the tokenizer"):
            LeRobotPolicy.from_pretrained(folder)


def test_a_task_that_does_not_fit_is_refused_on_loading(tmp_path_factory):
    folder = tiny.saved("pi05", tmp_path_factory)
    with tiny.tiny_backbones(), pytest.raises(CheckpointError, match="shorten the task, or train with fewer numbers"):
        LeRobotPolicy.from_pretrained(folder, task=LONG)


def test_a_prompt_that_does_not_end_as_trained_is_refused(pi05):
    """A pre-processor of π0 under the weights of π0.5: the prompt has no state."""
    pre = pi05.checkpoint.preprocessor
    stateless = dataclasses.replace(pi05.checkpoint, preprocessor=lambda batch: pre(batch) | {"task": ["go\n"]})
    inputs = type(pi05.inputs).__new__(type(pi05.inputs))
    inputs.__dict__ |= pi05.inputs.__dict__ | {"checkpoint": stateless}
    seen = tiny.observation()
    with pytest.raises(ObservationError, match="it must end 'Action:'"):
        inputs.batch(seen, Anchor.measured(seen), "go")


def test_pi0_and_smolvla_are_told_when_words_are_lost(tmp_path_factory):
    for kind in ("pi0", "smolvla"):
        with tiny.tiny_backbones():
            policy = LeRobotPolicy.from_pretrained(tiny.saved(kind, tmp_path_factory), seed=0, clamp=1.0)
        with pytest.raises(ObservationError, match="would be cut to 48"):
            policy.infer(tiny.observation(task=LONG))


def test_a_policy_without_text_has_nothing_to_check(tmp_path_factory):
    policy = LeRobotPolicy.from_pretrained(tiny.saved("act", tmp_path_factory))
    (finding,) = (finding for finding in policy.findings if finding.check == "prompt")
    assert finding.text == "'act' reads no text"


def test_a_tokenizer_that_is_not_on_the_machine_is_named(tmp_path, tmp_path_factory, monkeypatch):
    """PaliGemma's tokenizer asks for an accepted licence; without it, or without a network, LeRobot raises OSError."""
    from lerobot.processor import tokenizer_processor

    def gated(name):
        raise OSError(f"You are trying to access a gated repo: {name}")

    folder = tiny.copied("pi05", tmp_path_factory, tmp_path)
    (folder / "tokenizer").rename(folder / "elsewhere")
    with tiny.tiny_backbones():
        with monkeypatch.context() as patch:
            patch.setattr(tokenizer_processor.AutoTokenizer, "from_pretrained", gated)
            with pytest.raises(CheckpointError, match=r"gated repo: google/paligemma-3b-pt-224.*tokenizer=FOLDER"):
                LeRobotPolicy.from_pretrained(folder)
        policy = LeRobotPolicy.from_pretrained(folder, tokenizer=folder / "elsewhere", clamp=1.0)
    assert len(policy.infer(tiny.observation())) == 50


def test_the_state_of_wbc32_in_the_stance_goes_through_pi05_as_it_is(tmp_path):
    """23 numbers at the unmodified max_state_dim of 32; height and lean of the pelvis are bins of the prompt."""
    spec = builtin("wbc32")
    with tiny.tiny_backbones():
        folder = tiny.write_checkpoint("pi05", tmp_path / "stance", spec=spec)
    policy = tiny.load(folder, seed=0, clamp=1.0)
    config, state = policy.checkpoint.network.config, policy.checkpoint.state
    assert (config.max_state_dim, config.robot_state_feature.shape) == (32, (23,))
    seen = tiny.observation()
    lower = dataclasses.replace(
        seen, T_world_base=seen.T_world_base @ make_transform(np.eye(3), np.array([0, 0, 0.01]))
    )
    batches = [policy.inputs.batch(each, Anchor.measured(each), "go")[0] for each in (seen, lower)]
    bins = [batch["task"][0].split("State: ")[1].split(";")[0].split() for batch in batches]
    assert [len(each) for each in bins] == [23, 23]
    at = state.slot("base_height").start
    # Higher above soles that went up with it: nothing changes but what is measured in world, and that is not in it.
    assert bins[0] == bins[1]
    bent = dataclasses.replace(seen, q_body=seen.q_body + 0.02 * (np.isin(np.arange(29), (3, 9))))
    batch, _ = policy.inputs.batch(bent, Anchor.measured(bent), "go")
    assert batch["task"][0].split("State: ")[1].split(";")[0].split()[at] != bins[0][at]
    chunk = policy.infer(seen)
    assert chunk.spec_id == policy.spec.id
    assert policy.spec.slot("left_wrist_position").frame == "stance"
