"""What a checkpoint may name: nothing that is imported, run, or read outside its folder.

LeRobot 0.6.1 imports whatever a processor step's ``class`` names and calls it with the ``config`` beside it, tells
transformers to run the code of whatever repository or folder some steps and policies name, and otherwise lets it ask on
the terminal whether to. So the three JSON files are read here first, as data; what names code is refused.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from policy.errors import printable
from policy.findings import fail
from policy.reading import SPEC_MAX, ReadingError, listed, read_json, require_file

POLICY_TYPES = ("act", "diffusion", "pi0", "pi05", "smolvla", "tdmpc", "vqbet")
"""Policies of LeRobot that load nothing by a name in ``config.json``, but for SmolVLA's configuration and tokenizer."""
LOADING_STEPS = ("action_tokenizer_processor", "reward_classifier_processor")
"""Steps of LeRobot that let a repository or folder that they name run its code."""
STATE_MAX = 64 * 2**20
"""Largest file of a step's numbers [bytes]; statistics have 30 kB."""
FOLDER_JSON_MAX = 128 * 2**20
"""Largest JSON file of a tokenizer [bytes]; Gemma's has 34 MB."""
BACKBONE_LAYERS_MAX, BACKBONE_WIDTH_MAX, VOCABULARY_MAX = 128, 32_768, 1_000_000
"""Most layers, largest width and most tokens of a backbone's ``config.json``."""
_STEPS_MAX = 64
"""Most steps of a pipeline; real ones have 4 to 8."""
_PACKAGE = "lerobot."


def check_policy_type(file: Path) -> None:
    """Refuse policies whose networks or configurations run what a file names.

    Args:
        file: ``config.json``.

    Raises:
        CheckpointError: If the type is none, or such a one.
    """
    from lerobot.configs import PreTrainedConfig

    kind = _object("config", file, "is no configuration of a LeRobot policy").get("type")
    known = PreTrainedConfig.get_known_choices()
    if not isinstance(kind, str) or kind not in known:
        fault = f"Policy type {printable(repr(kind), 80)} is not registered"
        cure = f"policies of LeRobot that are run here: {', '.join(POLICY_TYPES)}"
        raise fail("config", f"{file} is no configuration of a LeRobot policy: {fault}", cure)
    # A policy that the running program itself has registered is its own responsibility.
    if kind not in POLICY_TYPES and known[kind].__module__.startswith(_PACKAGE):
        text = f"{file} is of the policy type '{kind}', which loads code or models that its file names"
        cure = f"serve it with a server of its own and say ws://HOST:PORT; run here: {', '.join(POLICY_TYPES)}"
        raise fail("config", text, cure)


def check_steps(file: Path) -> list[dict[str, Any]]:
    """Entries of a pipeline's steps, none of which imports or runs what the file names.

    Args:
        file: ``policy_preprocessor.json`` or its counterpart.

    Raises:
        CheckpointError: Naming the step.
    """
    steps = _object("processors", file, "is no pipeline of LeRobot").get("steps")
    if not isinstance(steps, list) or not all(isinstance(step, dict) for step in steps) or len(steps) > _STEPS_MAX:
        text = f"{file} has no 'steps', a list of at most {_STEPS_MAX} objects"
        raise fail("processors", text, "copy it again from the training run's pretrained_model folder")
    for number, step in enumerate(steps):
        _check_step(file, number, step)
    return steps


def check_model_folder(folder: Path, check: str = "processors") -> None:
    """Refuse a tokenizer or backbone that brings its own code.

    Raises:
        CheckpointError: Naming the file.
    """
    for file in sorted(folder.glob("*.json")):
        try:
            # transformers writes 10^30 for "no limit".
            data = read_json(file, FOLDER_JSON_MAX, integer_max=10**31)
        except (OSError, ReadingError) as error:
            raise fail(check, f"{file} cannot be read: {error}", "copy the tokenizer again") from error
        if isinstance(data, dict) and "auto_map" in data:
            text = f"{file} names code to be run (auto_map)"
            raise fail(check, text, "a tokenizer is data here: save it again with a class of transformers' own")
        if file.name == "config.json" and (found := _too_large(data)) is not None:
            raise fail(check, f"{file} has {found}, as no backbone has", "copy the backbone again")


def _too_large(data: object) -> str | None:
    """The first number of a backbone's configuration that no network has, as ``name value``, if there is one."""
    for name, value in data.items() if isinstance(data, dict) else ():
        if isinstance(value, dict) and (inner := _too_large(value)) is not None:
            return inner
        wide = VOCABULARY_MAX if name == "vocab_size" else BACKBONE_WIDTH_MAX
        most = BACKBONE_LAYERS_MAX if name.endswith("layers") else wide
        if name.endswith(("layers", "_size", "heads", "_dim")) and isinstance(value, int) and value > most:
            return f"{printable(name, 80)} {value} (at most {most})"
    return None


@contextlib.contextmanager
def no_foreign_code() -> Iterator[None]:
    """Make transformers refuse what brings its own code, where it would ask on the terminal whether to run it."""
    try:
        from transformers import dynamic_module_utils
    except ImportError:
        yield
        return
    before = dynamic_module_utils.TIME_OUT_REMOTE_CODE
    # At 0 it raises at once; any other number is how many seconds it waits for a "y" on standard input.
    dynamic_module_utils.TIME_OUT_REMOTE_CODE = 0
    try:
        yield
    finally:
        dynamic_module_utils.TIME_OUT_REMOTE_CODE = before


def _object(check: str, file: Path, otherwise: str) -> dict[str, Any]:
    """A JSON object of a checkpoint."""
    try:
        data = read_json(file, SPEC_MAX)
        if not isinstance(data, dict):
            raise ReadingError(f"is a JSON {type(data).__name__}, no object")
    except (OSError, ReadingError) as error:
        raise fail(check, f"{file} {otherwise}: it {error}", "save the checkpoint again") from error
    return data


def _check_step(file: Path, number: int, step: dict[str, Any]) -> None:
    from lerobot.processor import ProcessorStepRegistry

    import policy.lerobot.steps  # noqa: F401 - registers our own

    def refusal(what: str, cure: str) -> Exception:
        return fail("processors", f"step {number} of {file} {what}", cure)

    name = step.get("registry_name")
    if not isinstance(name, str):
        what = f"names the class {printable(repr(step.get('class')), 120)}, which would be imported and called"
        cure = "only steps of LeRobot's registry and ours are run, by their registry_name: register it and save again"
        raise refusal(what, cure)
    if name not in ProcessorStepRegistry.list():
        known = listed(sorted(ProcessorStepRegistry.list()), 60)
        raise refusal(f"is '{printable(name, 80)}', which no one has registered", f"registered are: {known}")
    module = ProcessorStepRegistry.get(name).__module__
    allowed = (f"{_PACKAGE}processor.", *(f"{_PACKAGE}policies.{kind}." for kind in POLICY_TYPES))
    if name in LOADING_STEPS or (module.startswith(_PACKAGE) and not module.startswith(allowed)):
        what = f"is '{name}', which loads code or models that it names"
        raise refusal(
            what, "no policy that is run here needs it: take it out, or serve the policy and say ws://HOST:PORT"
        )
    config, state = step.get("config", {}), step.get("state_file")
    if not isinstance(config, dict):
        raise refusal(f"('{name}') has a config that is no object", "save the processors again")
    if state is not None:
        _check_state_file(file, state, refusal)


def _check_state_file(file: Path, name: Any, refusal: Any) -> None:
    cure = "copy the checkpoint again; numbers of a step are a .safetensors file beside the JSON"
    if not isinstance(name, str) or Path(name).name != name or not name.endswith(".safetensors"):
        raise refusal(f"reads its numbers from {printable(repr(name), 120)}, which is no file of the checkpoint", cure)
    try:
        require_file(file.parent / name, STATE_MAX)
    except (OSError, ReadingError) as error:
        raise refusal(f"reads its numbers from '{name}', which {error}", cure) from error
