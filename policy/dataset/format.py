"""A LeRobot dataset folder as it is on disk: what its episodes are, and where their rows and videos lie.

Read with pyarrow alone, so that no network is asked, no torch is loaded and no video is decoded. Formats v3.0 (several
episodes a file), v2.1 and v2.0 (one file an episode) give the same `Dataset`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from string import Formatter
from typing import TYPE_CHECKING, Any

import numpy as np

from policy import reading
from policy.dataset.forms.tables import read_parquet
from policy.errors import DatasetError, did_you_mean

if TYPE_CHECKING:
    import pyarrow

ACTION, STATE = "action", "observation.state"
INDICES = ("timestamp", "frame_index", "episode_index", "index", "task_index")
"""Columns that every dataset has."""
EPISODES_MAX = 100_000
"""Most episodes of a dataset."""
PATH_MAX = 300
"""Most characters of a path in ``meta/info.json``."""
_FIELD = re.compile(r"(0[1-9])?d?")
"""Format of a number in a path, as in ``{file_index:03d}``."""
Stats = Mapping[str, Mapping[str, Any]]
"""Statistics by feature and name, nested lists as in JSON."""


@dataclass(frozen=True)
class VideoSpan:
    """Where the frames of an episode are in a video file, from ``start`` to ``end`` [s]."""

    file: Path
    start: float
    end: float


@dataclass(frozen=True)
class Episode:
    """One recording.

    Attributes:
        index: Its number in the dataset.
        length: Number of frames.
        tasks: What was to be done.
        file: Parquet file with its rows.
        first_row: Its first row there.
        videos: Where each camera's frames are.
        camera_stats: Statistics of its images, as far as the dataset has them.
        extra: What else the dataset says about it.
    """

    index: int
    length: int
    tasks: tuple[str, ...]
    file: Path
    first_row: int
    videos: Mapping[str, VideoSpan] = field(default_factory=dict)
    camera_stats: Stats = field(default_factory=dict)
    extra: Mapping[str, Any] = field(default_factory=dict)


RowReader = Callable[[Episode], "pyarrow.Table"]
"""Reads all columns of an episode."""


@dataclass(frozen=True)
class Dataset:
    """A dataset folder.

    Attributes:
        folder: Where ``meta`` and ``data`` are.
        version: Format, such as ``v3.0``.
        info: Content of ``meta/info.json``.
        tasks: Text of each task index.
        episodes: In order.
        stats: Statistics over all episodes; empty where the dataset has none.
        reader: Reads the rows of an episode where they are not in parquet files.
    """

    folder: Path
    version: str
    info: Mapping[str, Any]
    tasks: tuple[str, ...]
    episodes: tuple[Episode, ...]
    stats: Stats
    reader: RowReader | None = field(default=None, compare=False, repr=False)

    @property
    def fps(self) -> float:
        """Frames per second [Hz]."""
        return float(self.info["fps"])

    @property
    def features(self) -> Mapping[str, Mapping[str, Any]]:
        """What the columns and videos are, by key."""
        return self.info["features"]

    @property
    def cameras(self) -> tuple[str, ...]:
        """Keys of images and videos."""
        return tuple(key for key, feature in self.features.items() if feature["dtype"] in ("image", "video"))

    @property
    def frames(self) -> int:
        """Number of frames of all episodes."""
        return sum(episode.length for episode in self.episodes)

    def feature(self, key: str) -> Mapping[str, Any]:
        """A vector feature.

        Raises:
            DatasetError: If there is none of that name, or it is no vector.
        """
        if key not in self.features:
            vectors = [name for name in self.features if name not in (*self.cameras, *INDICES)]
            raise DatasetError(
                f"{self.folder} has no feature '{key}'; {did_you_mean(key, vectors)}there are "
                f"{', '.join(vectors) or 'none'}",
                feature=key,
            )
        feature = self.features[key]
        shape = feature.get("shape")
        if not isinstance(shape, (list, tuple)) or len(shape) != 1:
            raise DatasetError(f"'{key}' of {self.folder} has shape {shape}; a vector is expected", feature=key)
        return feature

    def table(self, episode: Episode, columns: list[str] | None = None) -> pyarrow.Table:
        """Rows of an episode.

        Raises:
            DatasetError: If the file is damaged, lacks a column, or holds something else there.
        """
        if self.reader is not None:
            rows = self.reader(episode)
            return rows if columns is None else rows.select(columns)
        wanted = None if columns is None else (*columns, "episode_index")
        modified_ns = episode.file.stat().st_mtime_ns if episode.file.exists() else 0
        rows = _file(episode.file, modified_ns, wanted).slice(episode.first_row, episode.length)
        found = np.asarray(rows.column("episode_index")) if "episode_index" in rows.column_names else np.empty(0)
        if found.dtype.kind not in "iu" or len(found) != episode.length or (found != episode.index).any():
            raise DatasetError(
                f"{episode.file} does not hold the {episode.length} frames of episode {episode.index} from row "
                f"{episode.first_row} on; meta/episodes and data are of different recordings: get both again",
                feature="episode_index",
            )
        return rows if columns is None else rows.select(columns)

    def numbers(self, key: str) -> Iterator[np.ndarray]:
        """A vector feature of each episode in turn, shape (length, D).

        Raises:
            DatasetError: If a row is missing or has another length than the feature.
        """
        width = int(self.feature(key)["shape"][0])
        for episode in self.episodes:
            yield vectors(self.table(episode, [key]).column(key), width, key, episode)


def read_json(file: Path) -> dict[str, Any]:
    """An object in a JSON file.

    Raises:
        DatasetError: If there is none.
    """
    try:
        data = reading.read_json(file)
    except (FileNotFoundError, NotADirectoryError) as error:
        raise DatasetError(
            f"{file} does not exist; give the folder of a LeRobot dataset, the one with meta and data in it"
        ) from error
    except (OSError, reading.ReadingError) as error:
        raise DatasetError(f"{file} cannot be read: {error}") from error
    if not isinstance(data, dict):
        raise DatasetError(f"{file} is a JSON {type(data).__name__}; an object is expected")
    return data


def inside(folder: Path, template: object, **parts: object) -> Path:
    """Path of a file that ``info.json`` names by a template, never outside the dataset.

    Raises:
        DatasetError: If the template is none, or leads elsewhere.
    """
    if not isinstance(template, str):
        raise DatasetError(
            f"{folder}/meta/info.json does not say where files are: data_path (and video_path of videos) is a text "
            "such as 'data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet'"
        )
    try:
        text = template
        if len(text) > PATH_MAX or not all(
            name is None or (name.isidentifier() and conversion is None and _FIELD.fullmatch(layout or ""))
            for _, name, layout, conversion in Formatter().parse(text)
        ):
            raise ValueError("only {name} and {name:03d} can be filled in")
        file = folder / template.format(**parts)
    except (KeyError, IndexError, ValueError, TypeError, AttributeError) as error:
        raise DatasetError(f"meta/info.json has the path '{template}', which cannot be filled in: {error!r}") from error
    if not _within(file, folder):
        raise DatasetError(f"meta/info.json has the path '{template}', which leaves the dataset's folder")
    return file


def meta_file(folder: Path, *names: str) -> Path:
    """Path of a file in ``meta``, which is no link to a file outside the dataset.

    Raises:
        DatasetError: If it is.
    """
    file = Path(folder, "meta", *names)
    if not _within(file, folder):
        raise DatasetError(f"{file} is a link that leaves the dataset's folder; put the file itself there")
    return file


def _within(file: Path, folder: Path) -> bool:
    try:
        return file.resolve().is_relative_to(folder.resolve())
    except (OSError, ValueError, RuntimeError):  # a circle of links, a name with a zero in it
        return False


def vectors(column: pyarrow.ChunkedArray, width: int, key: str, episode: Episode) -> np.ndarray:
    """Rows of a vector column, or of one of single numbers, shape (n, width), in their own precision."""
    flat = column.combine_chunks()
    flat = None if flat.null_count else flat.flatten() if hasattr(flat.type, "value_type") else flat
    values = None if flat is None else flat.to_numpy(zero_copy_only=False)
    if values is None or values.dtype.kind not in "fiu" or values.size != width * len(column):
        raise DatasetError(
            f"'{key}' of episode {episode.index} in {episode.file} is no table of {width} numbers a frame, as "
            "meta/info.json says; rows are missing or of another length",
            feature=key,
        )
    return values.reshape(len(column), width)


@lru_cache(maxsize=1)
def _file(file: Path, modified_ns: int, columns: tuple[str, ...] | None) -> pyarrow.Table:
    """A data file; the last one is kept, because its episodes are asked for one after the other."""
    table = read_parquet(file, list(columns) if columns else None)
    missing = [name for name in columns or () if name not in table.column_names]
    if missing:
        known = ", ".join(read_parquet(file).column_names)
        raise DatasetError(f"{file} has no column '{missing[0]}'; it has {known}", feature=missing[0])
    return table
