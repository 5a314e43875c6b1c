r"""Whether a policy's prompt fits.

The tokenizer step cuts from the right without a word. In π0.5 the robot's state is the last part of the prompt, so a
long task or a long state deletes ``State: ...;\nAction: ``, and the network acts blindly.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from policy.action_spec.spec import ActionSpec
from policy.errors import ObservationError
from policy.findings import Finding

if TYPE_CHECKING:
    from lerobot.configs import PreTrainedConfig

PROMPT_END = "Action:"
"""How the prompt of π0.5 ends, but for white space."""
TASK_TOKENS_MIN = 20
"""Tokens that a task should have left: about a sentence of fifteen words in Gemma's vocabulary."""
_LONGEST_BIN = "255"
"""State bin with the most tokens: Gemma has one token a digit."""


def tokenizer_step(processor: Any) -> Any | None:
    """The tokenizing step of a pre-processor, None if the policy reads no text."""
    from lerobot.processor import TokenizerProcessorStep

    return next((step for step in processor.steps if isinstance(step, TokenizerProcessorStep)), None)


def check_prompt(config: PreTrainedConfig, processor: Any, state: ActionSpec | None, task: str) -> list[Finding]:
    """Room for the task in the longest prompt that the state can make.

    Args:
        config: Of the policy.
        processor: Pre-processor.
        state: Layout of the state.
        task: A task that will be given; only the room is reported if empty.
    """
    step = tokenizer_step(processor)
    if step is None:
        return [Finding("prompt", "ok", f"'{config.type}' reads no text")]
    try:
        used = token_count(step, longest_prompt(config, state, task))
    except ObservationError as error:
        return [Finding("prompt", "error", str(error), "copy the tokenizer again")]
    room = step.max_length - used
    if not task and room >= TASK_TOKENS_MIN:
        return [Finding("prompt", "ok", f"at most {room} of {step.max_length} tokens are left for the task")]
    if task and room >= 0:
        return [Finding("prompt", "ok", f"at most {used} of {step.max_length} tokens with the task '{task}'")]
    # In π0.5 the end is the state itself; elsewhere only words are lost.
    level = "error" if room < 0 else "warning"
    text = f"the longest prompt has {used} tokens{f' with the task {task!r}' if task else ' without a task'}"
    cure = "shorten the task, or train with fewer numbers of state" if task else "train with fewer numbers of state"
    return [Finding("prompt", level, f"{text}; the tokenizer keeps {step.max_length}, from the left", cure)]


def longest_prompt(config: PreTrainedConfig, state: ActionSpec | None, task: str) -> str:
    """Text with the most tokens that a policy can be given for a task, as its pre-processor makes it."""
    if config.type != "pi05":
        return f"{task}\n"
    bins = " ".join([_LONGEST_BIN] * (state.dim if state else 0))
    # Source: lerobot 0.6.1, Pi05PrepareStateTokenizerProcessorStep.
    return f"Task: {task.strip()}, State: {bins};\n{PROMPT_END} "


def token_count(step: Any, text: str) -> int:
    """Tokens of a text by the tokenizer of a step, uncut."""
    with tokenizing():
        return len(step.input_tokenizer(text, truncation=False)["input_ids"])


@contextmanager
def tokenizing() -> Iterator[None]:
    """Tell where the tokenizers' library gives up, which it does past every ``except Exception``.

    A pattern of a tokenizer's own can need more tries for a text than there is time for.

    Raises:
        ObservationError: Instead.
    """
    try:
        yield
    except BaseException as error:
        if type(error).__name__ != "PanicException":
            raise
        raise ObservationError(f"the tokenizer gives up on the prompt: {error}") from error


def require_whole_prompt(config: PreTrainedConfig, step: Any, batch: dict[str, Any]) -> None:
    """Refuse a prompt that was cut.

    Args:
        config: Of the policy.
        step: Its tokenizing step.
        batch: What the pre-processor made.

    Raises:
        ObservationError: If it was cut, or the prompt of π0.5 does not end as it was trained.
    """
    prompt = batch["task"][0]
    if config.type == "pi05" and not prompt.rstrip().endswith(PROMPT_END):
        raise ObservationError(f"the prompt of π0.5 ends '{prompt[-20:]}'; it must end '{PROMPT_END}'")
    mask = batch["observation.language.attention_mask"][0]
    if not bool(mask.all()):
        return
    kept, count = len(mask), token_count(step, prompt)
    if count > step.max_length:
        lost = step.input_tokenizer.decode(step.input_tokenizer(prompt, truncation=False)["input_ids"][kept:])
        raise ObservationError(
            f"the prompt has {count} tokens and would be cut to {step.max_length}, without {lost.strip()[-60:]!r}; "
            "shorten the task"
        )
