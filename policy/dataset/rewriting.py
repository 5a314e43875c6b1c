"""A copy of a dataset with other actions: some episodes as they are, some with new actions, some left out."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from policy.action_spec.spec import ActionSpec
from policy.dataset.checks import check_cameras, check_images, check_times, check_videos
from policy.dataset.columns import numeric_columns, stored_columns
from policy.dataset.format import ACTION, Dataset, Episode
from policy.dataset.naming.meaning import DOUBLED, meaning, says_nothing
from policy.dataset.naming.sources import find_source
from policy.dataset.naming.vouched import column_names
from policy.dataset.open import open_dataset
from policy.dataset.stats import statistics
from policy.dataset.writer import DatasetWriter, set_column
from policy.errors import DatasetError

if TYPE_CHECKING:
    import pyarrow


def rewrite_dataset(
    source: str | Path,
    target: str | Path,
    actions: Mapping[int, np.ndarray | None],
    *,
    facts: Mapping[str, Any],
    spec: ActionSpec | None = None,
) -> int:
    """Write a dataset (v3.0) whose episodes have other actions; videos are copied as they are.

    An episode whose new actions are more or fewer than its frames is played at another speed: each frame is that of the
    source nearest to its time. Videos cannot be played at another speed without being encoded anew.

    Args:
        source: Dataset folder (v3.0, v2.1, v2.0).
        target: Folder to write; must not exist.
        actions: New actions by episode, shape (n, D), or None to keep its own; episodes that are not named are left
            out.
        facts: Written to ``meta/repair.json``.
        spec: Layout of the new actions where they are joints, whose columns are found by their names; None where they
            are as the dataset has them.

    Returns:
        Number of episodes.

    Raises:
        DatasetError: If the dataset cannot be read, nothing would be left, or videos would have to be played at another
            speed; nothing is written.
    """
    dataset = open_dataset(source)
    episodes = tuple(one for one in dataset.episodes if one.index in actions)
    if not episodes:
        raise DatasetError(f"{source}: none of its {len(dataset.episodes)} episodes would be left")
    dataset = dataclasses.replace(dataset, episodes=episodes)
    check_cameras(dataset, without_stats=True)
    check_times(dataset)
    check_videos(dataset)
    stored, columns = stored_columns(dataset), dict[str, list[np.ndarray]]()
    where = _Places(dataset, spec)
    facts = {**facts, "kept_as_recorded": where.kept} if where.kept else facts
    with DatasetWriter(Path(target), dataset.info, dataset.tasks) as writer:
        for old in episodes:
            rows = dataset.table(old, stored)
            check_images(rows, [key for key in dataset.cameras if key in stored], old)
            episode, rows = _with_actions(dataset, old, rows, actions[old.index], where)
            rows = writer.numbered(rows)
            found = dict(numeric_columns(rows, dataset.features, episode))
            for key, values in found.items():
                columns.setdefault(key, []).append(values)
            writer.add(episode, rows, {key: statistics(x) for key, x in found.items()} | dict(episode.camera_stats))
        whole = {key: statistics(np.concatenate(parts)) for key, parts in columns.items()}
        cameras = {key: dataset.stats[key] for key in dataset.cameras if key in dataset.stats}
        writer.finish(whole | cameras, dict(_files(dataset, facts)))
    return len(episodes)


def _with_actions(
    dataset: Dataset, episode: Episode, rows: pyarrow.Table, actions: np.ndarray | None, where: _Places
) -> tuple[Episode, pyarrow.Table]:
    if actions is None:
        return episode, rows
    if len(actions) != episode.length:
        if episode.videos:
            raise DatasetError(
                f"episode {episode.index} of {dataset.folder} would take {len(actions)} frames for {episode.length}: "
                "its videos would have to be encoded anew",
                feature=next(iter(episode.videos)),
            )
        nearest = np.rint(np.linspace(0.0, episode.length - 1, len(actions))).astype(np.int64)
        times, frames = (np.asarray(rows.column(name)) for name in ("timestamp", "frame_index"))
        rows, steps = rows.take(nearest), np.arange(len(actions))
        rows = set_column(rows, "timestamp", (times[0] + steps / dataset.fps).astype(times.dtype))
        rows = set_column(rows, "frame_index", (frames[0] + steps).astype(frames.dtype))
        episode = dataclasses.replace(episode, length=len(actions))
    return episode, where.put(rows, episode, actions)


class _Places:
    """Where the numbers of new actions go in the rows of a dataset.

    Attributes:
        kept: Columns of actions that stay as they were recorded, which no number of the new ones is.
    """

    def __init__(self, dataset: Dataset, spec: ActionSpec | None) -> None:
        self._dataset, self._source = dataset, find_source(dataset, ACTION)
        self._numbers = self._columns = np.arange(self._source.dim)
        self.kept: list[str] = []
        named = tuple(zip(self._source.parts, self._source.names, strict=True))
        if spec is None or says_nothing([name for _, name in named], self._source.dim):
            return
        names = column_names(spec)[0]
        # A joint that two features have is changed in both.
        found = [meaning(name, "" if part == DOUBLED else part, spec.robot).name for part, name in named]
        pairs = [(names.index(name), column) for column, name in enumerate(found) if name and name in names]
        self._numbers, self._columns = (np.array(x, dtype=int) for x in zip(*pairs, strict=True))
        used = set(self._columns.tolist())
        self.kept = [name for column, (_, name) in enumerate(named) if column not in used]

    def put(self, rows: pyarrow.Table, episode: Episode, actions: np.ndarray) -> pyarrow.Table:
        """Rows with other actions, in the precision that they had."""
        values = np.array(self._source.of(rows, episode))
        values[:, self._columns] = actions[:, self._numbers]
        parts = np.split(values, np.cumsum(self._source.widths)[:-1], axis=1)
        for name, part in zip(self._source.features, parts, strict=True):
            single = not hasattr(rows.column(name).type, "value_type")
            rows = set_column(rows, name, part[:, 0] if single else part)
        return rows


def _files(dataset: Dataset, facts: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Texts in ``meta``: layouts as in the source, and what was done."""
    for name in ("action_spec.json", "state_spec.json", "conversion.json"):
        file = dataset.folder / "meta" / name
        if file.is_file():
            yield name, file.read_text(encoding="utf-8")
    yield "repair.json", json.dumps(facts, indent=2) + "\n"
