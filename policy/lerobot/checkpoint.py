"""A LeRobot checkpoint, opened and held against what the robot will do with it."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from policy.action_spec.builtin import as_spec
from policy.action_spec.describe import called
from policy.action_spec.spec import ActionSpec
from policy.action_spec.state import state_layout
from policy.errors import SpecError
from policy.findings import CheckpointError, Finding, fail
from policy.lerobot.features import camera_keys, check_features, check_relative, check_sizes, chunk_length
from policy.lerobot.folder import CONFIG_FILE, checkpoint_folder, whereabouts
from policy.lerobot.prompt import check_prompt
from policy.lerobot.spec import read_action_spec, read_state_spec
from policy.lerobot.stats import ACTION, STATE, check_stats
from policy.lerobot.trust import check_model_folder, check_policy_type, check_steps, no_foreign_code
from policy.lerobot.weights import WEIGHTS_FILE, load_network, quiet, random_network
from policy.observation import Observation
from policy.placeholder_cameras import blind

if TYPE_CHECKING:
    import numpy as np
    from lerobot.configs import PreTrainedConfig

PROCESSORS = ("policy_preprocessor", "policy_postprocessor")
INSTALL_CURE = "pip install 'g1-wholebody[lerobot]' brings what LeRobot's policies need"
TOKENIZER_CURE = (
    "π0 and π0.5 need the tokenizer of google/paligemma-3b-pt-224, which asks for an accepted licence: download it "
    "once and say tokenizer=FOLDER, or put it into the checkpoint as 'tokenizer'"
)


@dataclass(frozen=True, kw_only=True)
class LoadOptions:
    """How a checkpoint is loaded and run.

    Attributes:
        assume_spec: Layout that the user vouches for, built-in name or spec; replaces ``action_spec.json``.
        assume_state: Layout of the state that the user vouches for; replaces ``state_spec.json``.
        allow_random_weights: Run with random weights where there is no file; for tests and timing.
        allow_narrow: Accept numbers whose range in the statistics is too small to be sound.
        device: ``cpu``, ``cuda``, ``cuda:1``, ...; ``cuda`` if there is one, else ``cpu``, if None.
        dtype: ``float32`` or ``bfloat16`` where the policy offers it (π0, π0.5); as saved if None.
        num_steps: Denoising steps, fewer are faster; as saved if None.
        seed: Makes sampling reproducible: the same chunks after every reset. Fresh noise if None.
        rtc: Turn on LeRobot's real-time chunking, so that `infer` takes a prefix.
        clamp: Clip the normalised chunk to plus or minus this; not clipped if None.
        task: Task where neither `reset` nor the observation has one.
        tokenizer: Folder of the tokenizer (for SmolVLA of the whole VLM: configuration and processor); the checkpoint's
            subfolder ``tokenizer`` if there is one, else what the checkpoint names on the hub.
        cameras: Camera of the policy -> camera of the observation, where the names differ.
        placeholder_cameras: Show grey to cameras that an observation lacks; for simulations without pictures.
        environment: Gives ``observation.environment_state`` from an observation, for policies that want it.
    """

    assume_spec: ActionSpec | str | None = None
    assume_state: ActionSpec | str | None = None
    allow_random_weights: bool = False
    allow_narrow: bool = False
    device: str | None = None
    dtype: str | None = None
    num_steps: int | None = None
    seed: int | None = None
    rtc: bool = False
    clamp: float | None = None
    task: str = ""
    tokenizer: str | Path | None = None
    cameras: Mapping[str, str] = field(default_factory=dict)
    placeholder_cameras: bool = False
    environment: Callable[[Observation], np.ndarray] | None = None


@dataclass(frozen=True)
class Checkpoint:
    """The parts of a loaded checkpoint.

    Attributes:
        folder: Where it is.
        spec: Layout of the actions.
        state: Layout of the state, None if the policy has none.
        network: LeRobot's policy.
        preprocessor, postprocessor: LeRobot's pipelines from the same folder.
        options: How it was loaded.
    """

    folder: Path
    spec: ActionSpec
    state: ActionSpec | None
    network: Any
    preprocessor: Any
    postprocessor: Any
    options: LoadOptions


def open_checkpoint(
    path: str | Path, spec: ActionSpec | str | None, options: LoadOptions
) -> tuple[Checkpoint | None, list[Finding]]:
    """Load a checkpoint and run every check that needs no observation.

    A check that fails does not hide the ones after it, as far as these can run at all.

    Args:
        path: Folder with ``config.json``, ``model.safetensors`` and both processors, or that of its training run.
        spec: Layout that the caller decodes; what the checkpoint says if None.
        options: How to load it.

    Returns:
        The parts, None if one could not be made, and the findings in the order of the checks.
    """
    folder, findings = checkpoint_folder(path), []
    config = _run(findings, "config", lambda: read_config(folder, options))
    if config is None:
        return None, findings
    findings.append(Finding("config", "ok", f"'{config.type}' on {config.device}, {folder}"))
    layouts = _run(findings, "spec", lambda: _layouts(folder, config, as_spec(spec), options))
    if layouts:
        vouched = ", vouched for by the user" if options.assume_spec else ""
        findings.append(Finding("spec", "ok", f"actions are {called(layouts[ACTION])}{vouched}"))
    processors = _run(findings, "processors", lambda: read_processors(folder, config, options))
    if processors:
        findings.append(Finding("processors", "ok", f"{' and '.join(f'{name}.json' for name in PROCESSORS)} loaded"))
    if layouts:
        inner = _inner_layouts(layouts, processors)
        given = options.environment is not None
        findings += check_features(config, inner, cameras=options.cameras, environment=given)
        if options.placeholder_cameras and camera_keys(config):
            findings.append(blind(camera_keys(config)))
        if processors:
            findings += check_stats(config, processors, inner, allow_narrow=options.allow_narrow)
            findings.append(check_relative(config, processors, inner))
            findings += check_prompt(config, processors[0], inner.get(STATE), options.task)
    network = _run(findings, "weights", lambda: _network(folder, config, options, findings))
    if layouts is None or processors is None or network is None:
        return None, findings
    return Checkpoint(folder, layouts[ACTION], layouts.get(STATE), network, *processors, options), findings


def read_config(folder: Path, options: LoadOptions) -> PreTrainedConfig:
    """A checkpoint's configuration with the user's choices in it, and nothing in it that would download.

    Raises:
        CheckpointError: If it is missing, malformed, of an unknown policy, or does not offer what was chosen.
    """
    import lerobot.policies  # noqa: F401 - registers the configurations that from_pretrained looks up
    from draccus.utils import DraccusException
    from lerobot.configs import PreTrainedConfig

    file = folder / CONFIG_FILE
    if not file.is_file():
        raise fail("config", f"{file} is missing", whereabouts(folder))
    check_policy_type(file)
    try:
        config = PreTrainedConfig.from_pretrained(folder)
    except (DraccusException, ValueError, TypeError, KeyError, AttributeError, OSError) as error:
        raise fail("config", f"{file} is no configuration of a LeRobot policy: {error}", "save it again") from error
    if config.use_peft:
        raise fail("config", f"{file} is of a PEFT adapter", "merge the adapter into its base and save that")
    config.pretrained_path = None
    config.device = _device(options.device)
    # Everything is in model.safetensors; these would download first what is then overwritten. Compiling takes minutes.
    nothings = {"pretrained_backbone_weights": None, "load_vlm_weights": False, "compile_model": False}
    for name, nothing in nothings.items():
        if hasattr(config, name):
            setattr(config, name, nothing)
    if config.type == "smolvla" and options.tokenizer is not None:
        config.vlm_model_name = str(options.tokenizer)
    _choose(config, options)
    check_sizes(config)
    return config


def read_processors(folder: Path, config: PreTrainedConfig, options: LoadOptions) -> tuple[Any, Any]:
    """Pre- and post-processor of a checkpoint, from its own folder.

    Raises:
        CheckpointError: If one is missing or does not load.
    """
    from lerobot.policies.factory import make_pre_post_processors
    from safetensors import SafetensorError

    from policy.lerobot.steps import G1WristsToJointsStep, pair

    cure = "without them numbers are not normalised; copy both from the training run's pretrained_model folder"
    for name in PROCESSORS:
        if not (folder / f"{name}.json").is_file():
            raise fail("processors", f"{folder / name}.json is missing", cure)
    named = [[step["registry_name"] for step in check_steps(folder / f"{name}.json")] for name in PROCESSORS]
    overrides = {"device_processor": {"device": config.device}} if "device_processor" in named[0] else {}
    tokenizer = _tokenizer(folder, config, options)
    if tokenizer and "tokenizer_processor" in named[0]:
        check_model_folder(Path(tokenizer))
        overrides["tokenizer_processor"] = {"tokenizer_name": tokenizer}
    try:
        with quiet(), no_foreign_code():
            processors = make_pre_post_processors(
                config, str(folder), preprocessor_overrides=overrides, postprocessor_overrides={}
            )
    except (OSError, ValueError, KeyError, TypeError, ImportError, RuntimeError, SafetensorError) as error:
        # LeRobot wraps what the hub raises, and says which step it was.
        cure = TOKENIZER_CURE if "tokenizer_processor" in str(error) else "save them again"
        raise fail("processors", f"the processors of {folder} do not load: {error}", cure) from error
    if any(isinstance(step, G1WristsToJointsStep) for step in processors[1].steps):
        pair(*processors)
    return processors


def _run[T](findings: list[Finding], check: str, step: Callable[[], T]) -> T | None:
    """Result of a step; what it raises is added to the findings."""
    try:
        return step()
    except CheckpointError as error:
        findings += error.findings
    except (SpecError, ImportError) as error:
        findings.append(Finding(check, "error", str(error), INSTALL_CURE if isinstance(error, ImportError) else ""))
    return None


def _layouts(
    folder: Path, config: PreTrainedConfig, spec: ActionSpec | None, options: LoadOptions
) -> dict[str, ActionSpec]:
    assumed = as_spec(options.assume_spec)
    if assumed is not None:
        # The user vouches for the meaning of the numbers; how many steps there are is in the configuration.
        assumed = dataclasses.replace(assumed, horizon=chunk_length(config))
    actions = read_action_spec(folder, spec, assumed)
    layouts = {ACTION: actions}
    if config.robot_state_feature is not None:
        state = as_spec(options.assume_state)
        layouts[STATE] = read_state_spec(folder, actions) if state is None else state_layout(state)
    return layouts


def _inner_layouts(layouts: dict[str, ActionSpec], processors: tuple[Any, Any] | None) -> dict[str, ActionSpec]:
    """Layouts between the processors: theirs, where they convert between joints and wrists themselves."""
    inner = dict(layouts)
    for key, processor in zip((STATE, ACTION), processors or (), strict=False):
        step = next((step for step in processor.steps if hasattr(step, "conversion")), None)
        if step is not None and key in inner:
            inner[key] = dataclasses.replace(step.conversion.target, fps=layouts[key].fps, horizon=layouts[key].horizon)
    return inner


@no_foreign_code()
def _network(folder: Path, config: PreTrainedConfig, options: LoadOptions, findings: list[Finding]) -> Any:
    if config.type == "smolvla" and Path(config.vlm_model_name).is_dir():
        check_model_folder(Path(config.vlm_model_name), "weights")
    try:
        network = load_network(folder, config)
    except CheckpointError as error:
        if not options.allow_random_weights:
            raise
        text = f"random weights, as allowed: {error}"
        findings.append(Finding("weights", "warning", text))
        return random_network(config)
    count = sum(tensor.numel() for tensor in network.state_dict().values())
    text = f"every tensor equals the file's, {count:,} numbers in {folder / WEIGHTS_FILE}"
    findings.append(Finding("weights", "ok", text))
    return network


def _device(wanted: str | None) -> str:
    import torch

    if wanted is None:
        return "cuda" if torch.cuda.is_available() else "cpu"
    try:
        torch.empty(0, device=wanted)
    except (RuntimeError, AssertionError) as error:
        raise fail("config", f"device '{wanted}' cannot be used: {error}", "device='cpu' always works") from error
    return wanted


def _choose(config: PreTrainedConfig, options: LoadOptions) -> None:
    if options.seed is not None and not 0 <= options.seed < 2**63:
        raise fail("config", f"seed is {options.seed}", "give a whole number from 0 to 9.2e18")
    if options.dtype is not None:
        if not hasattr(config, "dtype"):
            raise fail("config", f"'{config.type}' has no choice of dtype", "leave dtype out: it computes in float32")
        config.dtype = options.dtype
    if options.num_steps is not None:
        names = [name for name in ("num_inference_steps", "num_steps") if hasattr(config, name)]
        if not names or options.num_steps < 1:
            text = f"num_steps {options.num_steps} for '{config.type}'"
            raise fail("config", text, "give 1 or more to a policy that denoises, nothing to others")
        setattr(config, names[0], options.num_steps)
    if options.rtc:
        if not hasattr(config, "rtc_config"):
            raise fail("config", f"'{config.type}' has no real-time chunking", "leave rtc out; blend chunks instead")
        from lerobot.policies.rtc.configuration_rtc import RTCConfig

        config.rtc_config = config.rtc_config or RTCConfig()
        config.rtc_config.enabled = True


def _tokenizer(folder: Path, config: PreTrainedConfig, options: LoadOptions) -> str | None:
    if options.tokenizer is not None:
        return os.fspath(options.tokenizer)
    if config.type == "smolvla" and Path(config.vlm_model_name).is_dir():
        return config.vlm_model_name
    inside = folder / "tokenizer"
    return str(inside) if inside.is_dir() else None
