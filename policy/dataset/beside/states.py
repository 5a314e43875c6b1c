"""States of a dataset beside its actions: what was measured of the joints that were commanded."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from policy.dataset.checks import column_layout
from policy.dataset.format import ACTION, STATE, Dataset, Episode
from policy.dataset.naming.sources import find_source
from policy.dataset.read_as import read_as_corrections
from policy.errors import DatasetError
from policy.findings import Finding
from policy.suspicion.gaps import Gap, joint_gaps
from policy.suspicion.rows import state_findings


def commanded_and_measured(
    dataset: Dataset, episode: Episode, given: Mapping[str, Any] | None = None, read_as: Sequence[str] = ()
) -> tuple[list[str], np.ndarray, np.ndarray]:
    """Names that actions and states share, joints [rad] and grippers, and their numbers (n, D) in both.

    Args:
        dataset: Where they are.
        episode: Of it.
        given: As of `policy.dataset.checks.column_layout`: assume, unit, robot.
        read_as: What the user says that the numbers are instead of what they are called.

    Returns:
        Names are empty where either is not joints or not finite, which is reported where the numbers are used.
    """
    try:
        found = []
        for key in (ACTION, STATE):
            source = find_source(dataset, key)
            layout = column_layout(dataset, source, **(given or {}))
            source = read_as_corrections(source, layout, read_as, rows_too=True)
            values = source.of(dataset.table(episode, list(source.features)), episode).astype(float)
            if layout.unit == "deg":
                joint = [name in layout.robot.joint_names for name in layout.names]
                values = np.where(joint, np.deg2rad(values), values)
            found.append((layout.names, values))
    except DatasetError:
        return [], np.empty((0, 0)), np.empty((0, 0))
    (commanded, action), (measured, state) = found
    names = [name for name in commanded if name and name in measured]
    action = action[:, [commanded.index(name) for name in names]]
    state = state[:, [measured.index(name) for name in names]]
    if not (np.isfinite(action).all() and np.isfinite(state).all()):
        return [], np.empty((0, 0)), np.empty((0, 0))
    return names, action, state


def beside_findings(
    dataset: Dataset, episode: Episode, given: Mapping[str, Any] | None = None, read_as: Sequence[str] = ()
) -> list[Finding]:
    """Hypotheses about the states of an episode, with the settings of `commanded_and_measured`."""
    names, action, state = commanded_and_measured(dataset, episode, given, read_as)
    return state_findings(state, action, names) if names else []


def episode_gaps(
    dataset: Dataset, episode: Episode, given: Mapping[str, Any] | None = None, read_as: Sequence[str] = ()
) -> list[Gap]:
    """How each joint of an episode follows, with the settings of `commanded_and_measured`."""
    names, action, state = commanded_and_measured(dataset, episode, given, read_as)
    return joint_gaps(state, action, names, dataset.fps) if names else []
