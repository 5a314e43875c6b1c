"""A copy of a dataset with other actions: some episodes as they are, some with new actions, some left out."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from policy.dataset.checks import check_cameras, check_images, check_times, check_videos
from policy.dataset.columns import numeric_columns, stored_columns
from policy.dataset.format import ACTION, Dataset, Episode
from policy.dataset.open import open_dataset
from policy.dataset.stats import statistics
from policy.dataset.writer import DatasetWriter, set_column
from policy.errors import DatasetError

if TYPE_CHECKING:
    import pyarrow


def rewrite_dataset(
    source: str | Path, target: str | Path, actions: Mapping[int, np.ndarray | None], *, said: Mapping[str, Any]
) -> int:
    """Write a dataset (v3.0) whose episodes have other actions; videos are copied as they are.

    An episode whose new actions are more or fewer than its frames is played at another speed: each frame is that of the
    source nearest to its time. Videos cannot be played at another speed without being encoded anew.

    Args:
        source: Dataset folder (v3.0, v2.1, v2.0).
        target: Folder to write; must not exist.
        actions: New actions by episode, shape (n, D), or None to keep its own; episodes that are not named are left
            out.
        said: Written to ``meta/repair.json``.

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
    with DatasetWriter(Path(target), dataset.info, dataset.tasks) as writer:
        for old in episodes:
            rows = dataset.table(old, stored)
            check_images(rows, [key for key in dataset.cameras if key in stored], old)
            episode, rows = _with_actions(dataset, old, rows, actions[old.index])
            rows = writer.numbered(rows)
            found = dict(numeric_columns(rows, dataset.features, episode))
            for key, values in found.items():
                columns.setdefault(key, []).append(values)
            writer.add(episode, rows, {key: statistics(x) for key, x in found.items()} | dict(episode.camera_stats))
        whole = {key: statistics(np.concatenate(parts)) for key, parts in columns.items()}
        cameras = {key: dataset.stats[key] for key in dataset.cameras if key in dataset.stats}
        writer.finish(whole | cameras, dict(_files(dataset, said)))
    return len(episodes)


def _with_actions(
    dataset: Dataset, episode: Episode, rows: pyarrow.Table, actions: np.ndarray | None
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
    return episode, set_column(rows, ACTION, actions.astype(np.float32))


def _files(dataset: Dataset, said: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Texts in ``meta``: layouts as in the source, and what was done."""
    for name in ("action_spec.json", "state_spec.json", "conversion.json"):
        file = dataset.folder / "meta" / name
        if file.is_file():
            yield name, file.read_text(encoding="utf-8")
    yield "repair.json", json.dumps(said, indent=2) + "\n"
