"""An episode of a LeRobot dataset as a policy: its commanded actions, played back from the nominal stance."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np

from models.spec import RobotSpec
from policy.action_spec.anchor import Anchor
from policy.action_spec.builtin import builtin
from policy.action_spec.codec import decode
from policy.action_spec.spec import ActionSpec
from policy.dataset.checks import check_times, column_layout, wrist_layout
from policy.dataset.format import ACTION, Dataset
from policy.dataset.joint_values import check_values
from policy.dataset.naming.sources import find_source
from policy.dataset.naming.vouched import require_same_names
from policy.dataset.open import open_dataset
from policy.errors import DatasetError, SpecError
from policy.reading import SPEC_MAX, ReadingError, listed, read_text
from policy.recorded.replay import ReplayPolicy


def open_episode(
    folder: str | Path, number: int, *, assume: ActionSpec | None = None, robot: RobotSpec | None = None
) -> ReplayPolicy:
    """Policy that plays an episode's actions: wrists whose layout the dataset names, or joints.

    Args:
        folder: Dataset (v3.0, v2.1, v2.0).
        number: Which episode.
        assume: Layout of the actions that the user vouches for; replaces what the dataset says.
        robot: The robot that it is of; the G1 with Dex3 hands if None.

    Raises:
        DatasetError: If the dataset cannot be read, has no such episode, or does not say what its actions are.
        ChunkError: If an action is malformed.
    """
    dataset = open_dataset(folder)
    if not 0 <= number < len(dataset.episodes):
        raise DatasetError(f"{folder} has no episode {number}; it has 0 to {len(dataset.episodes) - 1}")
    check_times(dataset, [dataset.episodes[number]])
    episode, source = dataset.episodes[number], find_source(dataset, ACTION)
    actions = source.of(dataset.table(episode, list(source.features)), episode)
    spec, notes = _layout(dataset, robot) if assume is None else assume, source.notes
    if assume is not None:
        require_same_names(assume, tuple(zip(source.parts, source.names, strict=True)), ACTION)
    if spec is None and (name := wrist_layout(source, robot)):
        spec = builtin(name, robot)
    if spec is None:
        joints = column_layout(dataset, source, robot=robot)
        check_values(joints, actions, feature=ACTION)
        spec = joints.whole_spec
        actions = actions[:, joints.columns_of(spec)]
        notes += tuple(f"{listed(names, 6)} left out: {reason}" for reason, names in joints.left_out.items())
        notes += () if joints.hand else ("there are no hands in it: fingers stay as they are",)
    if spec.dim != actions.shape[1]:
        raise DatasetError(f"'{ACTION}' of {folder} has {actions.shape[1]} numbers; '{spec.name}' has {spec.dim}")
    # The layout says what a number is; how fast they follow one another is the dataset's to say.
    spec = dataclasses.replace(spec, fps=dataset.fps)
    chunk = decode(spec, np.asarray(actions, dtype=float), Anchor.nominal(robot=spec.robot))
    chunk = dataclasses.replace(chunk, notes=(*chunk.notes, *notes))
    return ReplayPolicy(chunk, name=f"{Path(folder).name}#{number}", spec=spec)


def _layout(dataset: Dataset, robot: RobotSpec | None) -> ActionSpec | None:
    """What ``meta/action_spec.json`` says, None without it."""
    file = dataset.folder / "meta" / "action_spec.json"
    if not file.exists():
        return None
    try:
        return ActionSpec.from_json(read_text(file, SPEC_MAX), robot)
    except (OSError, ReadingError, SpecError) as error:
        raise DatasetError(f"{file}: {error}") from error
