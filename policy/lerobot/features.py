"""Whether a checkpoint's inputs and outputs are those of the robot: dimensions, names, cameras, steps of a chunk."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from policy.action_spec.builtin import LAYOUTS, builtin
from policy.action_spec.spec import ActionSpec
from policy.errors import did_you_mean, printable
from policy.findings import Finding, fail
from policy.lerobot.stats import ACTION, STATE
from policy.reading import HORIZON_MAX

if TYPE_CHECKING:
    from lerobot.configs import PreTrainedConfig

IMAGES = "observation.images."
ENVIRONMENT = "observation.environment_state"
EMPTY_CAMERA = "empty_camera_"
"""Cameras that π0, π0.5 and SmolVLA fill in by themselves, with nothing."""
NAMED_MAX = 3
"""Numbers of another robot that a sentence names."""


SIZES = {
    "num_inference_steps": (1, 1000),
    "num_steps": (1, 1000),
    "chunk_size": (1, HORIZON_MAX),
    "n_action_steps": (1, HORIZON_MAX),
    "horizon": (1, HORIZON_MAX),
    "n_obs_steps": (1, 64),
    "num_train_timesteps": (1, 10_000),
    "tokenizer_max_length": (1, 8192),
    "max_state_dim": (1, 1024),
    "max_action_dim": (1, 1024),
    "empty_cameras": (0, 16),
    "expert_width_multiplier": (0.01, 4.0),
}
"""Least and largest number of steps, frames, tokens and entries in ``config.json``."""
LAYERS_MAX, WIDTH_MAX, OTHER_MAX = 128, 16_384, 10_000_000
"""Most layers of a network, largest width of one, and largest count of training steps and other number there."""
BACKBONES = ("resnet18", "resnet34", "resnet50", "resnet101", "resnet152")
"""Networks of torchvision that LeRobot's policies see with; of its other names some are no networks."""
FEATURES_MAX, SIDE_MAX = 32, 8192
"""Most features of a policy, and entries of each along an axis."""


def check_sizes(config: PreTrainedConfig) -> None:
    """Refuse numbers in ``config.json`` that ask for more memory or time than any policy takes.

    Raises:
        CheckpointError: Naming the field and its bounds.
    """
    cure = "give num_steps for denoising steps; else take config.json from the training run"
    for name, value in vars(config).items():
        for number in value if isinstance(value, tuple | list) else (value,):
            if not isinstance(number, int | float) or isinstance(number, bool):
                continue
            least, most = _bounds(name, number)
            if not least <= number <= most:
                raise fail("config", f"{name} of '{config.type}' is {number:g}; {least} to {most} is expected", cure)
    backbone = getattr(config, "vision_backbone", BACKBONES[0])
    if backbone not in BACKBONES:
        text = f"vision_backbone of '{config.type}' is {printable(repr(backbone), 80)}"
        raise fail("config", f"{text}; {', '.join(BACKBONES)} are known", cure)
    features = {**(config.input_features or {}), **(config.output_features or {})}
    for key, feature in list(features.items())[: FEATURES_MAX + 1]:
        shape = tuple(feature.shape)
        if len(shape) > 4 or not all(type(n) is int and 1 <= n <= SIDE_MAX for n in shape):
            text = f"'{printable(key, 80)}' of '{config.type}' has the shape {printable(shape, 80)}"
            raise fail("config", f"{text}; up to 4 lengths from 1 to {SIDE_MAX} are expected", cure)
    if len(features) > FEATURES_MAX:
        raise fail("config", f"'{config.type}' has {len(features)} features; at most {FEATURES_MAX} are taken", cure)


def _bounds(name: str, number: float) -> tuple[float, float]:
    """Least and largest value of a number of ``config.json``, by its name: -1 is as many layers as there are."""
    if name in SIZES:
        return SIZES[name]
    if "layer" in name or "ensemble" in name:
        return -1, LAYERS_MAX
    if isinstance(number, float) or "steps" in name:
        return -OTHER_MAX, OTHER_MAX
    return -1, WIDTH_MAX


def camera_keys(config: PreTrainedConfig) -> dict[str, str]:
    """Camera -> feature of LeRobot, in the order of the configuration, without the empty ones."""
    cameras = {key.removeprefix(IMAGES): key for key in config.image_features}
    return {name: key for name, key in cameras.items() if not name.startswith(EMPTY_CAMERA)}


def chunk_length(config: PreTrainedConfig) -> int:
    """Steps that ``predict_action_chunk`` returns."""
    # Diffusion cuts its horizon to n_action_steps; the others return all of their chunk.
    names = ("chunk_size", "action_chunk_size", "n_action_steps")
    return int(next(getattr(config, name) for name in names if hasattr(config, name)))


def resizes_images(config: PreTrainedConfig) -> bool:
    """Whether the network brings images of any size to its own; ACT and Diffusion compute with what they get."""
    return any(getattr(config, name, None) for name in ("image_resolution", "resize_imgs_with_padding"))


def relative_step(processor: Any) -> Any | None:
    """The step of a pre-processor that makes actions relative to the state, None if none does."""
    from lerobot.processor import RelativeActionsProcessorStep

    steps = (step for step in processor.steps if isinstance(step, RelativeActionsProcessorStep))
    return next((step for step in steps if step.enabled), None)


def absolute_step(processor: Any) -> Any | None:
    """Its inverse in a post-processor, None if there is none."""
    from lerobot.processor import AbsoluteActionsProcessorStep

    steps = (step for step in processor.steps if isinstance(step, AbsoluteActionsProcessorStep))
    return next((step for step in steps if step.enabled), None)


def check_features(
    config: PreTrainedConfig,
    layouts: Mapping[str, ActionSpec],
    *,
    cameras: Iterable[str] = (),
    environment: bool = False,
) -> list[Finding]:
    """What `config.json` says against the layouts.

    Args:
        config: Of the policy.
        layouts: What the numbers of ``action`` and, where the policy has one, ``observation.state`` are.
        cameras: Cameras that the user thinks it has.
        environment: Whether something gives ``observation.environment_state``.
    """
    findings = [*check_action(config, layouts[ACTION]), *_check_inputs(config, environment)]
    known = camera_keys(config)
    for name in cameras:
        if name not in known:
            text = f"the policy has no camera '{name}'; {did_you_mean(name, known)}it has {', '.join(known) or 'none'}"
            findings.append(Finding("features", "error", text, "cameras maps the policy's names to the robot's"))
    if STATE in layouts:
        findings += check_width(config, STATE, config.robot_state_feature, layouts[STATE], "max_state_dim")
    if findings:
        return findings
    inputs = f"{layouts[STATE].dim} numbers of state, " if STATE in layouts else ""
    cameras = ", ".join(camera_keys(config)) or "no camera"
    spec = layouts[ACTION]
    text = f"{inputs}{cameras} -> {spec.horizon} steps of {spec.dim} at {spec.fps:g} Hz"
    return [Finding("features", "ok", text)]


def check_relative(config: PreTrainedConfig, processors: tuple[Any, Any], layouts: Mapping[str, ActionSpec]) -> Finding:
    """Whether what makes actions relative and what undoes it belong together, and the state lines up with them."""
    before, after = relative_step(processors[0]), absolute_step(processors[1])
    wanted = bool(getattr(config, "use_relative_actions", False))
    if before is None and after is None and not wanted:
        return Finding("relative", "ok", "actions are predicted as the layout has them, not relative to the state")
    parts = {"config.json": wanted, "the pre-processor": before is not None, "the post-processor": after is not None}
    if not all(parts.values()):
        text = f"relative actions are on in {_those(parts, True)} and off in {_those(parts, False)}"
        return Finding("relative", "error", text, "take all three from the same training run")
    spec, state = layouts[ACTION], layouts.get(STATE)
    if state is None or state.feature_names != spec.feature_names:
        other = "none" if state is None else f"'{state.name}'"
        text = f"relative actions add the state number by number, but the state layout is {other}, not '{spec.name}'"
        return Finding("relative", "error", text, "the state must be in the action's slots")
    broken = [slot.name for slot in spec.slots if slot.kind in ("quaternion", "rotvec", "rpy")]
    if broken:
        text = f"relative actions subtract {', '.join(broken)} number by number, which jumps at sign flips and at 180°"
        return Finding("relative", "error", text, "use rot6d, or a layout whose slots are relative themselves")
    mask = before._build_mask(spec.dim)
    kept = [name for name, relative in zip(spec.feature_names, mask, strict=True) if not relative]
    text = f"{sum(mask)} of {spec.dim} numbers are predicted relative to the state, chunks are made absolute once"
    return Finding("relative", "ok", f"{text}; absolute: {', '.join(kept) or 'none'}")


def compare_names(check: str, key: str, names: Sequence[str], layout: ActionSpec, where: str) -> Iterator[Finding]:
    """Names that a file gives to the numbers of a feature against those of a layout; nothing if they agree.

    Args:
        check: Name of the check.
        key: Feature.
        names: What the file says.
        layout: What is meant.
        where: The file.
    """
    if tuple(names) == layout.feature_names:
        return
    if len(names) != layout.dim:
        text = f"{key} has {len(names)} names in {where}; layout '{layout.name}' has {layout.dim} numbers"
        yield Finding(check, "error", text, "name the layout that the checkpoint was trained with")
        return
    i = next(i for i, pair in enumerate(zip(names, layout.feature_names, strict=True)) if pair[0] != pair[1])
    text = f"number {i} of {key} is '{names[i]}' in {where}, '{layout.feature_names[i]}' in layout '{layout.name}'"
    if sorted(names) == sorted(layout.feature_names):
        yield Finding(check, "error", text, "the order differs: use a layout with the checkpoint's order")
    else:
        yield Finding(check, "warning", text, "make sure that both mean the same")


def _those(parts: Mapping[str, bool], on: bool) -> str:
    return " and ".join(name for name, value in parts.items() if value is on)


def check_action(config: PreTrainedConfig, spec: ActionSpec) -> Iterator[Finding]:
    """Width, steps and names of the actions in `config.json` against a layout; nothing if they agree."""
    yield from check_width(config, ACTION, config.action_feature, spec, "max_action_dim")
    if chunk_length(config) != spec.horizon:
        text = f"chunks of this '{config.type}' have {chunk_length(config)} steps; '{spec.name}' says {spec.horizon}"
        cure = f"wholebody spec CHECKPOINT --layout {spec.name} writes action_spec.json with the checkpoint's own"
        yield Finding("features", "error", text, cure)
    names = getattr(config, "action_feature_names", None)
    if names:
        yield from compare_names("features", ACTION, names, spec, "config.json")


def check_width(config: PreTrainedConfig, key: str, feature: Any, layout: ActionSpec, most: str) -> Iterator[Finding]:
    """Numbers of a feature of `config.json` against those of a layout; nothing if they agree.

    Args:
        config: Of the policy.
        key: Feature.
        feature: What the configuration says of it.
        layout: What is meant.
        most: Name of the setting that bounds it.
    """
    if feature is None:
        text = f"'{config.type}' has no feature '{key}'"
        yield Finding("features", "error", text, "this policy does not control a robot by actions")
        return
    width = int(feature.shape[0])
    if width != layout.dim:
        text = f"{key} has {width} numbers; layout '{layout.name}' has {layout.dim}"
        yield Finding("features", "error", text, _layouts_of(width, getattr(config, "action_feature_names", None)))
    bound = getattr(config, most, None)
    if bound is not None and width > bound:
        text = f"{key} has {width} numbers; {most}, which is part of the weights, is {bound}"
        yield Finding("features", "error", text, "numbers past it are lost: train with a layout that fits, as wbc32")


def _layouts_of(width: int, names: Sequence[str] | None) -> str:
    """What helps where a checkpoint has another number of numbers than a layout."""
    fitting = [name for name in LAYOUTS if builtin(name).dim == width]
    if fitting:
        return f"name the layout that the checkpoint was trained with; of {width} numbers: {', '.join(fitting)}"
    called = f" ({', '.join(names[:NAMED_MAX])}, ...)" if names else ""
    return (
        f"no layout of the G1 has {width}{called}: a policy of another robot cannot run here; fine-tune it on data of "
        "a G1 (wholebody convert DATASET --to wbc32 makes them), or describe its numbers in a layout of your own (JSON)"
    )


def _check_inputs(config: PreTrainedConfig, environment: bool) -> Iterator[Finding]:
    known = {STATE, ENVIRONMENT, *config.image_features}
    for key in config.input_features:
        if key not in known:
            text = f"input '{key}' is neither state nor image"
            yield Finding("features", "error", text, "the robot has nothing to put there: train without it")
    if ENVIRONMENT in config.input_features and not environment:
        text = f"the policy wants '{ENVIRONMENT}', which no sensor of the robot gives"
        yield Finding("features", "error", text, "pass environment=FUNCTION, which makes it from an observation")
    for key in config.image_features:
        if not key.startswith(IMAGES):
            yield Finding("features", "error", f"image '{key}' is not called {IMAGES}NAME", "rename it in training")
