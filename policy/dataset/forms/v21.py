"""Formats v2.1 and v2.0: a parquet file and a video a camera for each episode, the rest in ``.jsonl`` files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from policy.dataset.format import EPISODES_MAX, Dataset, Episode, VideoSpan, inside, meta_file, read_json
from policy.dataset.forms.numbering import in_numbers, in_order
from policy.dataset.stats import merged
from policy.errors import DatasetError
from policy.reading import JSON_MAX, ReadingError, parse_json, read_text

CHUNK = 1000
"""Episodes a folder where ``info.json`` does not say it, as LeRobot 2 wrote them."""


def read_v21(folder: Path, info: Mapping[str, Any]) -> Dataset:
    """A dataset in the format v2.1 or v2.0.

    Raises:
        DatasetError: If ``meta`` is incomplete or contradicts itself.
    """
    features = info["features"]
    cameras = [key for key, feature in features.items() if feature["dtype"] in ("image", "video")]
    file = meta_file(folder, "episodes.jsonl")
    lines = in_order(_lines(file, "episode_index", "length", "tasks"), file)
    stats = _episode_stats(meta_file(folder, "episodes_stats.jsonl"), cameras)
    videos = [key for key in cameras if features[key]["dtype"] == "video"]
    episodes = tuple(_episode(folder, info, line, videos, stats.get(line["episode_index"], {})) for line in lines)
    whole = meta_file(folder, "stats.json")
    camera_stats = read_json(whole) if whole.exists() else merged([episode.camera_stats for episode in episodes])
    return Dataset(
        folder, info["codebase_version"], info, read_tasks(meta_file(folder, "tasks.jsonl")), episodes, camera_stats
    )


def _episode(
    folder: Path, info: Mapping[str, Any], line: Mapping[str, Any], videos: list[str], camera_stats: dict[str, Any]
) -> Episode:
    index, length = line["episode_index"], line["length"]
    parts = {"episode_chunk": index // info.get("chunks_size", CHUNK), "episode_index": index}
    end = length / float(info["fps"])
    return Episode(
        index=index,
        length=length,
        tasks=tuple(line["tasks"] or ()),
        file=inside(folder, info.get("data_path"), **parts),
        first_row=0,
        videos={
            key: VideoSpan(inside(folder, info.get("video_path"), video_key=key, **parts), 0.0, end) for key in videos
        },
        camera_stats=camera_stats,
        extra={
            key: value
            for key, value in line.items()
            if key not in ("episode_index", "length", "tasks") and isinstance(value, (str, int, float, bool))
        },
    )


def _episode_stats(file: Path, cameras: list[str]) -> dict[int, dict[str, Any]]:
    if not file.exists():
        return {}
    lines = _lines(file, "episode_index", "stats")
    for line in lines:
        if type(line["episode_index"]) is not int or not isinstance(line["stats"], dict):
            raise DatasetError(f"{file} has a line without a number and an object of statistics: {line!r:.80}")
    return {
        line["episode_index"]: {key: line["stats"][key] for key in cameras if key in line["stats"]} for line in lines
    }


def read_tasks(file: Path) -> tuple[str, ...]:
    """Tasks of a dataset by number; see `in_numbers`."""
    return in_numbers(((line["task_index"], line["task"]) for line in _lines(file, "task_index", "task")), file)


def _lines(file: Path, *needed: str) -> list[dict[str, Any]]:
    try:
        texts = [line for line in read_text(file, JSON_MAX).splitlines() if line.strip()]
        if len(texts) > EPISODES_MAX:
            raise ReadingError(f"has {len(texts)} lines; at most {EPISODES_MAX} are read")
        lines = [parse_json(line) for line in texts]
    except (FileNotFoundError, NotADirectoryError) as error:
        raise DatasetError(f"{file} does not exist; download all of the dataset's meta") from error
    except (OSError, ReadingError) as error:
        raise DatasetError(f"{file} cannot be read: {error}") from error
    for line in lines:
        if not isinstance(line, dict) or any(name not in line for name in needed):
            raise DatasetError(f"{file} has a line without {', '.join(needed)}: {str(line)[:80]}")
    return lines
