"""An episode of a LeRobot dataset as a policy: its commanded actions, played back from the nominal stance."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path

from models.spec import RobotSpec
from policy.action_spec.anchor import Anchor
from policy.action_spec.builtin import builtin
from policy.action_spec.codec import decode
from policy.action_spec.spec import ActionSpec
from policy.dataset.beside.hands import hand_findings
from policy.dataset.beside.states import beside_findings
from policy.dataset.checks import check_times, column_layout, wrist_layouts
from policy.dataset.format import ACTION, Dataset
from policy.dataset.inspection import action_findings, read_as_said, settled, spec_as_said, with_notes
from policy.dataset.joint_values import require_finite
from policy.dataset.naming.sources import find_source
from policy.dataset.naming.vouched import require_same_names
from policy.dataset.open import open_dataset
from policy.dataset.pelvis.legs import recorded_legs
from policy.dataset.pelvis.rows import decode_rows, in_own_pelvis
from policy.dataset.pelvis.wrists import recorded_layout
from policy.errors import DatasetError
from policy.reading import listed
from policy.recorded.replay import ReplayPolicy


def open_episode(
    folder: str | Path, number: int, *, assume: ActionSpec | None = None, robot: RobotSpec | None = None,
    read_as: Sequence[str] = (),
) -> ReplayPolicy:  # fmt: skip
    """Policy that plays an episode's actions: wrists whose layout the dataset names, or joints.

    Wrists that were recorded in each step's own pelvis are played where they were, if the dataset has the legs too.

    Args:
        folder: Dataset (v3.0, v2.1, v2.0).
        number: Which episode.
        assume: Layout of the actions that the user vouches for; replaces what the dataset says.
        robot: The robot that it is of; the G1 with Dex3 hands if None.
        read_as: What the numbers are instead of what they are called, of `policy.suspicion.corrections.READ_AS`.

    Raises:
        DatasetError: If the dataset cannot be read, has no such episode, or does not say what its actions are.
        ChunkError: If an action is malformed.
        FileFormatError: If its numbers cannot be what they are called.
    """
    dataset = open_dataset(folder)
    if not 0 <= number < len(dataset.episodes):
        raise DatasetError(f"{folder} has no episode {number}; it has 0 to {len(dataset.episodes) - 1}")
    check_times(dataset, [dataset.episodes[number]])
    episode, source = dataset.episodes[number], find_source(dataset, ACTION)
    spec, notes = recorded_layout(dataset, ACTION, robot) if assume is None else assume, source.notes
    if assume is not None:
        require_same_names(assume, tuple(zip(source.parts, source.names, strict=True)), ACTION)
    if spec is None and (named := wrist_layouts(source, robot)):
        spec = _only(named, dataset, robot)
    columns = None
    if spec is None:
        joints = column_layout(dataset, source, robot=robot)
        spec = joints.whole_spec
        columns = joints.columns_of(spec)
        notes += tuple(f"{listed(names, 6)} left out: {reason}" for reason, names in joints.left_out.items())
        notes += () if joints.hand else ("there are no hands in it: fingers stay as they are",)
    actions = source.of(dataset.table(episode, list(source.features)), episode, columns)
    if spec.dim != actions.shape[1]:
        raise DatasetError(f"'{ACTION}' of {folder} has {actions.shape[1]} numbers; '{spec.name}' has {spec.dim}")
    require_finite(actions, spec.feature_names)
    anchor = Anchor.nominal(robot=spec.robot)
    actions, fps = read_as_said(spec, actions, dataset.fps, read_as)
    found = action_findings(spec, actions, anchor, fps)
    found += hand_findings(dataset, episode, spec, actions)
    if columns is not None:
        found += beside_findings(dataset, episode, {"robot": spec.robot}, read_as)
    notes += settled(found, read_as, f"{folder}#{number}")
    # The layout says what a number is; how fast they follow one another is the dataset's to say.
    spec = dataclasses.replace(spec_as_said(spec, read_as), fps=fps)
    legs = recorded_legs(dataset, robot=robot) if in_own_pelvis(spec) else None
    chunk = (
        decode(spec, actions, anchor) if legs is None else decode_rows(spec, actions, legs.anchors(dataset, episode))
    )
    chunk = with_notes(chunk, notes)
    return ReplayPolicy(chunk, name=f"{Path(folder).name}#{number}", spec=spec)


def _only(named: Sequence[str], dataset: Dataset, robot: RobotSpec | None) -> ActionSpec:
    """The layout whose features the actions are named by, if there is one of these names."""
    if len(named) > 1:
        raise DatasetError(
            f"{dataset.folder} names its actions as {' and '.join(named)} do, which are in different frames, and has "
            f"no meta/action_spec.json that says which: --assume-spec {named[0]} or {named[1]} does",
            feature=ACTION,
        )
    return builtin(named[0], robot)
