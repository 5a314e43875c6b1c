"""The layouts of a checkpoint, made of a named layout and what the checkpoint and its dataset say themselves."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from policy.action_spec.spec import ActionSpec
from policy.action_spec.state import state_layout
from policy.errors import SpecError
from policy.findings import Finding, require_no_error
from policy.lerobot.checkpoint import PROCESSORS, LoadOptions, read_config
from policy.lerobot.features import check_action, check_width, chunk_length, compare_names
from policy.lerobot.folder import checkpoint_folder
from policy.lerobot.spec import read_action_spec, read_state_spec
from policy.lerobot.stats import ACTION, STATE
from policy.lerobot.training_data import TrainingData
from policy.lerobot.trust import check_steps

if TYPE_CHECKING:
    from lerobot.configs import PreTrainedConfig


@dataclass(frozen=True)
class FittedLayouts:
    """What `policy.lerobot.spec.write_specs` writes beside a checkpoint.

    Attributes:
        folder: Of the checkpoint.
        spec: Layout of its actions.
        state: Layout of its state.
        findings: Warnings.
    """

    folder: Path
    spec: ActionSpec
    state: ActionSpec
    findings: tuple[Finding, ...]


def fit_layouts(
    checkpoint: str | Path,
    layout: ActionSpec | None = None,
    *,
    state: ActionSpec | None = None,
    dataset: str | Path | None = None,
    fps: float | None = None,
) -> FittedLayouts:
    """Layouts with the checkpoint's own number of steps, and the rate of its dataset.

    Args:
        checkpoint: Its folder, or that of its training run.
        layout: What its actions are; horizon and rate are replaced. What the dataset says of itself if None, as one
            that `wholebody convert` made does.
        state: What its state is; likewise, else the actions' layout, absolute, if None.
        dataset: Folder of the LeRobot dataset that it was trained on: says the rate, and its names are compared.
        fps: Steps per second, where there is no dataset; the layout's own if None.

    Raises:
        CheckpointError: If the checkpoint has other numbers than the layouts, or the dataset other names.
        SpecError: If nothing says the layout, or the rate is none.
        ImportError: If LeRobot is not installed.
    """
    folder = checkpoint_folder(checkpoint)
    config, data = read_config(folder, LoadOptions(device="cpu")), None
    if dataset is not None:
        data = TrainingData.open(dataset)
        fps, meta = float(data.info["fps"]), data.folder / "meta"
        if layout is None:
            layout = read_action_spec(meta, None, None)
            state = read_state_spec(meta, layout) if state is None else state
    if layout is None:
        raise SpecError(f"nothing says what the actions of {folder} mean: name their layout (--layout wbc32)")
    spec = dataclasses.replace(layout, fps=layout.fps if fps is None else float(fps), horizon=chunk_length(config))
    seen = state_layout(spec) if state is None else dataclasses.replace(state, fps=spec.fps, horizon=spec.horizon)
    findings = [] if _converts(folder) else [*_against_config(config, spec, seen)]
    findings += _against_names(data, config, spec, seen)
    require_no_error(findings)
    if fps is None:
        text = f"{layout.fps:g} Hz is taken from '{layout.name}': a checkpoint does not say its rate"
        findings.append(Finding("dataset", "warning", text, "name its dataset or the rate (--from, --fps)"))
    return FittedLayouts(folder, spec, seen, tuple(findings))


def _against_config(config: PreTrainedConfig, spec: ActionSpec, state: ActionSpec) -> Iterator[Finding]:
    yield from check_action(config, spec)
    if config.robot_state_feature is not None:
        yield from check_width(config, STATE, config.robot_state_feature, state, "max_state_dim")


def _against_names(
    data: TrainingData | None, config: PreTrainedConfig, spec: ActionSpec, state: ActionSpec
) -> Iterator[Finding]:
    if data is None:
        return
    for key, layout in ((ACTION, spec), (STATE, state)):
        names = data.names(key)
        if names and (key == ACTION or config.robot_state_feature is not None):
            yield from compare_names("dataset", key, names, layout, f"{data.folder}")


def _converts(folder: Path) -> bool:
    """Whether the numbers between the processors are others than outside, by our own steps."""
    files = [file for name in PROCESSORS if (file := folder / f"{name}.json").is_file()]
    return any(step["registry_name"] == "g1_wrists_to_joints" for file in files for step in check_steps(file))
