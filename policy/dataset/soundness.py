"""Which episodes of a dataset can be converted, and what is odd about them: each stands alone."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from policy.action_spec.anchor import Anchor
from policy.action_spec.spec import ActionSpec
from policy.dataset.beside.hands import hand_findings
from policy.dataset.beside.states import beside_findings
from policy.dataset.checks import check_times, check_videos
from policy.dataset.format import ACTION, Dataset, Episode
from policy.dataset.inspection import action_findings, settled
from policy.dataset.joint_layout import JointLayout
from policy.dataset.joint_values import check_values, require_finite
from policy.dataset.naming.sources import Source
from policy.errors import DatasetError, PolicyError
from policy.findings import Finding
from policy.suspicion.corrections import AS_NAMED
from policy.suspicion.joint_table import joint_findings

Columns = Mapping[str, tuple[Source, "JointLayout | ActionSpec"]]
"""Actions and states: where they are, and what they are."""


@dataclass
class Sound:
    """Episodes that can be converted.

    Attributes:
        dataset: With these episodes alone.
        left_out: Why each of the others cannot be, by its number.
        notes: What is odd about those that can.
    """

    dataset: Dataset
    left_out: dict[int, PolicyError] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    def every(self, act: Callable[[Episode], object]) -> None:
        """Act on every episode, and drop the episodes for which that is refused.

        Raises:
            PolicyError: The first refusal of all, if no episode is left.
        """
        for episode in self.dataset.episodes:
            try:
                act(episode)
            except PolicyError as error:
                self.left_out[episode.index] = error
        kept = tuple(one for one in self.dataset.episodes if one.index not in self.left_out)
        if not kept:
            raise next(iter(self.left_out.values()))
        self.dataset = dataclasses.replace(self.dataset, episodes=kept)


def sound_episodes(dataset: Dataset, columns: Columns, read_as: Sequence[str] = ()) -> Sound:
    """Look at every episode.

    Args:
        dataset: What is converted.
        columns: Its actions and states, as they are to be read.
        read_as: What the user says that they are instead of what they are called.

    Raises:
        PolicyError: The error of the first episode, if none can be converted.
    """
    found, values = Sound(dataset), dict[int, dict[str, np.ndarray]]()
    as_named = AS_NAMED in read_as

    def read(episode: Episode) -> None:
        values[episode.index] = {key: _numbers(dataset, episode, key, *columns[key], as_named) for key in columns}

    found.every(read)
    found.every(lambda episode: check_times(dataset, [episode]))
    found.every(lambda episode: check_videos(dataclasses.replace(dataset, episodes=(episode,))))
    suspicions: dict[str, list[Finding]] = {}

    def suspect(episode: Episode) -> None:
        alike = _findings(dataset, episode, columns, values[episode.index], read_as)
        where = f"{dataset.folder}, episode {episode.index}"
        try:
            settled(alike, read_as, where)
        except PolicyError as error:
            raise DatasetError(str(error)) from error
        for one in alike:
            suspicions.setdefault(one.check, []).append(one)

    found.every(suspect)
    kept = [values[episode.index] for episode in found.dataset.episodes]
    for key, (_, layout) in columns.items():
        if isinstance(layout, JointLayout) and not as_named:
            found.notes += check_values(layout, np.concatenate([one[key] for one in kept]), feature=key)
    for alike in suspicions.values():
        share = f" (in {len(alike)} of {len(kept)} episodes)" if len(kept) > 1 else ""
        found.notes.append(f"{alike[0].sentence}{share}")
    return found


def _numbers(
    dataset: Dataset, episode: Episode, key: str, source: Source, layout: JointLayout | ActionSpec, as_named: bool
) -> np.ndarray:
    """Numbers (n, D) of an episode, checked: finite, and in the ranges of what they are called unless that is said."""
    values = source.of(dataset.table(episode, list(source.features)), episode)
    if not isinstance(layout, JointLayout):
        return values
    try:
        if as_named:
            require_finite(values, layout.given, feature=key, unless=[not name for name in layout.names])
        else:
            check_values(layout, values, feature=key)
    except DatasetError as error:
        at = "" if error.frame is None else f", frame {error.frame}"
        text = f"{dataset.folder}, episode {episode.index}{at}: {error}"
        if np.isfinite(values).all() and layout.unit == "rad":
            text = "; ".join([text, *(one.sentence for one in joint_findings(layout.names, values, layout.robot)[:1])])
        raise DatasetError(text, feature=key, frame=error.frame) from error
    return values


def _findings(
    dataset: Dataset, episode: Episode, columns: Columns, values: Mapping[str, np.ndarray], read_as: Sequence[str]
) -> list[Finding]:
    """Hypotheses about the actions of an episode, and about its states beside them."""
    layout = columns[ACTION][1]
    spec, pick = layout, slice(None)
    if isinstance(layout, JointLayout):
        spec, pick = layout.whole_spec, layout.columns_of(layout.whole_spec)
    actions = np.asarray(values[ACTION], dtype=float)[:, pick]
    if not np.isfinite(actions).all():
        return []  # told where they are decoded
    found = action_findings(spec, actions, Anchor.nominal(robot=spec.robot), dataset.fps)
    found += hand_findings(dataset, episode, spec, actions)
    unit = layout.unit if isinstance(layout, JointLayout) else "rad"
    given = {"assume": None, "unit": unit, "robot": spec.robot}
    return found + beside_findings(dataset, episode, given, read_as)
