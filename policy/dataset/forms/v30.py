"""Format v3.0: several episodes a file, what belongs to which in ``meta/episodes``."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from policy.dataset.format import Dataset, Episode, VideoSpan, inside, meta_file, read_json
from policy.dataset.forms.numbering import in_numbers, in_order
from policy.dataset.forms.tables import read_rows
from policy.errors import DatasetError
from policy.reading import JSON_MAX, listed

_PLACES = ("data/", "videos/", "stats/", "meta/episodes/")
_FIELDS = ("episode_index", "length", "tasks", "dataset_from_index", "dataset_to_index")
"""Columns of ``meta/episodes`` that every dataset has; others are carried along."""
VIDEO_MAX = 1e6
"""Latest time in a video file [s]."""


def read_v30(folder: Path, info: Mapping[str, Any]) -> Dataset:
    """A dataset in the format v3.0.

    Raises:
        DatasetError: If ``meta`` is incomplete or contradicts itself.
    """
    features = info["features"]
    cameras = [key for key, feature in features.items() if feature["dtype"] in ("image", "video")]
    rows = in_order(_rows(folder, cameras), folder / "meta" / "episodes")
    for row in rows:
        if type(row["dataset_from_index"]) is not int or row["dataset_from_index"] < 0:
            number = row["episode_index"]
            raise DatasetError(f"{folder}/meta/episodes has no dataset_from_index of episode {number}")
    first: dict[Path, int] = {}
    files = [_data_file(folder, info, row) for row in rows]
    for file, row in zip(files, rows, strict=True):
        first[file] = min(first.get(file, row["dataset_from_index"]), row["dataset_from_index"])
    episodes = tuple(
        Episode(
            index=row["episode_index"],
            length=row["length"],
            tasks=tuple(row["tasks"] or ()),
            file=file,
            first_row=row["dataset_from_index"] - first[file],
            videos={key: _span(folder, info, row, key) for key in cameras if features[key]["dtype"] == "video"},
            camera_stats=_camera_stats(row, cameras),
            extra={key: row[key] for key in row if key not in _FIELDS and not key.startswith(_PLACES)},
        )
        for file, row in zip(files, rows, strict=True)
    )
    stats = meta_file(folder, "stats.json")
    return Dataset(folder, "v3.0", info, read_tasks(folder), episodes, read_json(stats) if stats.exists() else {})


def _rows(folder: Path, cameras: list[str]) -> list[dict[str, Any]]:
    """What ``meta/episodes`` says of each episode, without statistics that are computed anew."""
    files = sorted((folder / "meta" / "episodes").glob("*/*.parquet"))
    if not files:
        raise DatasetError(f"{folder}/meta/episodes has no .parquet files; download all of the dataset's meta")
    files = [meta_file(folder, "episodes", file.parent.name, file.name) for file in files]

    def wanted(name: str) -> bool:
        return not name.startswith("stats/") or name.split("/", 2)[1] in cameras

    rows = read_rows(files, wanted)
    missing = next((name for row in rows for name in _FIELDS if name not in row), None)
    if missing is not None:
        raise DatasetError(f"{folder}/meta/episodes has no column '{missing}'; it is none of the format v3.0")
    return rows


def _data_file(folder: Path, info: Mapping[str, Any], row: Mapping[str, Any]) -> Path:
    chunk, file = row.get("data/chunk_index"), row.get("data/file_index")
    return inside(folder, info.get("data_path"), chunk_index=chunk, file_index=file)


def _span(folder: Path, info: Mapping[str, Any], row: Mapping[str, Any], key: str) -> VideoSpan:
    names = [f"videos/{key}/{name}" for name in ("chunk_index", "file_index", "from_timestamp", "to_timestamp")]
    missing = [name for name in names if row.get(name) is None]
    if missing:
        number = row["episode_index"]
        raise DatasetError(f"{folder}/meta/episodes has no '{missing[0]}' for episode {number}", feature=key)
    chunk, number, start, end = (row[name] for name in names)
    file = inside(folder, info.get("video_path"), video_key=key, chunk_index=chunk, file_index=number)
    if not (isinstance(start, int | float) and isinstance(end, int | float) and 0.0 <= start < end < VIDEO_MAX):
        text = f"{folder}/meta/episodes has the frames of episode {row['episode_index']} from {start!r} to {end!r} s"
        raise DatasetError(f"{text} of {file.name}; a time within {VIDEO_MAX:g} s is expected", feature=key)
    return VideoSpan(file, float(start), float(end))


def _camera_stats(row: Mapping[str, Any], cameras: list[str]) -> dict[str, dict[str, Any]]:
    stats: dict[str, dict[str, Any]] = {}
    for name, value in row.items():
        if name.startswith("stats/") and value is not None:
            _, key, kind = (*name.split("/", 2), "")[:3]
            stats.setdefault(key, {})[kind] = value
    return {key: stats[key] for key in cameras if key in stats}


def read_tasks(folder: Path) -> tuple[str, ...]:
    """Tasks of a dataset by number; see `in_numbers`."""
    file = meta_file(folder, "tasks.parquet")
    rows = read_rows([file], most=JSON_MAX)
    names = list(rows[0]) if rows else ["task_index", "task"]
    text = next((name for name in names if name != "task_index"), None)
    if len(names) != 2 or "task_index" not in names or text is None:
        raise DatasetError(f"{file} has the columns {listed(names)}; task_index and task are expected")
    return in_numbers([(row["task_index"], row[text]) for row in rows], file)
