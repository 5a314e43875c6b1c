"""A dataset folder in LeRobot's format v3.0, written an episode at a time without decoding or encoding a frame.

Videos are copied as they are, whole files, whichever episodes are in them. The folder appears under its name only when
it is complete; what was begun and not closed is removed.
"""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

import numpy as np

from policy.dataset.format import Episode, VideoSpan
from policy.dataset.stats import plain
from policy.errors import DatasetError
from policy.reading import ReadingError, parse_json

if TYPE_CHECKING:
    import pyarrow
    import pyarrow.parquet

DATA_PATH = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
VIDEO_PATH = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
EPISODES_PATH = "meta/episodes/chunk-000/file-000.parquet"
CHUNK = 1000
"""Files a folder, LeRobot's default."""
DATA_FILE_MB, VIDEO_FILE_MB = 100, 200
"""Sizes that LeRobot keeps files below when it appends, its defaults; data files are kept below the first one here."""


class DatasetWriter:
    """Writes a dataset; use it in a ``with`` statement, which completes the folder or removes it.

    Args:
        folder: Where the dataset is to be; must not exist.
        info: Content of ``meta/info.json``; counts and paths are filled in.
        tasks: Text of each task index.
        link: Hard-link videos instead of copying them.

    Raises:
        DatasetError: If the folder exists.
    """

    def __init__(self, folder: Path, info: Mapping[str, Any], tasks: tuple[str, ...], *, link: bool = False) -> None:
        if folder.exists():
            raise DatasetError(f"{folder} exists already; remove it, or give another place to write to")
        if not folder.absolute().parent.is_dir():
            raise DatasetError(f"cannot write {folder}: there is no folder {folder.parent}")
        self.folder, self.info, self.tasks = folder, info, tasks
        self._copy = os.link if link else shutil.copyfile
        self._rows: list[dict[str, Any]] = []
        self._frames = 0
        self._videos: dict[tuple[str, Path], int] = {}
        self._data: pyarrow.parquet.ParquetWriter | None = None
        self._data_file, self._data_bytes = -1, 0
        self._work = Path()

    def __enter__(self) -> DatasetWriter:
        """Begin beside the folder, so that the last step is a rename."""
        self._work = Path(tempfile.mkdtemp(prefix=f".{self.folder.name}.", dir=self.folder.absolute().parent))
        self._work.chmod(0o755)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Give the folder its name, or take it away after an error."""
        if self._data is not None:
            self._data.close()
        if kind is None:
            self._work.rename(self.folder)
        else:
            shutil.rmtree(self._work)

    def numbered(self, rows: pyarrow.Table) -> pyarrow.Table:
        """Rows of the next episode with ``episode_index`` and ``index`` as they will be here."""
        number = np.full(len(rows), len(self._rows), dtype=np.int64)
        rows = set_column(rows, "episode_index", number)
        return set_column(rows, "index", self._frames + np.arange(len(rows), dtype=np.int64))

    def add(self, episode: Episode, rows: pyarrow.Table, stats: Mapping[str, Mapping[str, Any]]) -> None:
        """Append an episode.

        Args:
            episode: As it was in the source; its index and rows there do not matter.
            rows: Its rows, `numbered`.
            stats: Statistics of its features.
        """
        number, start = len(self._rows), self._frames
        self._write(rows)
        row: dict[str, Any] = {"episode_index": number, "tasks": list(episode.tasks), "length": episode.length}
        row |= {"data/chunk_index": self._data_file // CHUNK, "data/file_index": self._data_file % CHUNK}
        row |= {"dataset_from_index": start, "dataset_to_index": start + episode.length}
        for key, span in episode.videos.items():
            row |= self._video(key, span)
        row |= dict(episode.extra)
        row |= {f"stats/{key}/{name}": value for key, found in plain(stats).items() for name, value in found.items()}
        self._rows.append(row | {"meta/episodes/chunk_index": 0, "meta/episodes/file_index": 0})
        self._frames += episode.length

    def finish(self, stats: Mapping[str, Mapping[str, Any]], files: Mapping[str, str]) -> None:
        """Write ``meta``.

        Args:
            stats: Statistics over all episodes.
            files: Text of other files in ``meta``, by name.
        """
        import pandas
        import pyarrow
        import pyarrow.parquet

        (self._work / EPISODES_PATH).parent.mkdir(parents=True)
        # Rows need not have the same columns; what an episode lacks is null.
        names = list(dict.fromkeys(name for row in self._rows for name in row))
        columns = {name: [row.get(name) for row in self._rows] for name in names}
        pyarrow.parquet.write_table(pyarrow.table(columns), self._work / EPISODES_PATH)
        # LeRobot looks tasks up in pandas' index, which is what pandas writes.
        index = pandas.Index(list(self.tasks), name="task")
        tasks = pandas.DataFrame({"task_index": range(len(self.tasks))}, index=index)
        tasks.to_parquet(self._work / "meta" / "tasks.parquet")
        texts = {"info.json": self._info(), "stats.json": plain(stats)}
        for name, content in texts.items():
            (self._work / "meta" / name).write_text(json.dumps(content, indent=4) + "\n")
        for name, text in files.items():
            (self._work / "meta" / name).write_text(text)

    def _info(self) -> dict[str, Any]:
        counts = {
            "total_episodes": len(self._rows),
            "total_frames": self._frames,
            "total_tasks": len(self.tasks),
            "splits": {"train": f"0:{len(self._rows)}"},
        }
        places = {
            "chunks_size": CHUNK,
            "data_files_size_in_mb": DATA_FILE_MB,
            "video_files_size_in_mb": VIDEO_FILE_MB,
            "data_path": DATA_PATH,
            "video_path": VIDEO_PATH if self._videos else None,
        }
        legacy = ("total_chunks", "total_videos")
        kept = {key: value for key, value in self.info.items() if key not in legacy}
        return {**kept, "codebase_version": "v3.0", **counts, **places}

    def _write(self, rows: pyarrow.Table) -> None:
        """One row group an episode, as LeRobot records; a new file where this one would grow too large."""
        import pyarrow.parquet

        full = self._data_bytes + rows.nbytes > DATA_FILE_MB * 2**20
        if self._data is None or full:
            if self._data is not None:
                self._data.close()
            self._data_file, self._data_bytes = self._data_file + 1, 0
            place = {"chunk_index": self._data_file // CHUNK, "file_index": self._data_file % CHUNK}
            file = self._work / DATA_PATH.format(**place)
            file.parent.mkdir(parents=True, exist_ok=True)
            self._data = pyarrow.parquet.ParquetWriter(file, rows.schema, compression="snappy")
        self._data.write_table(rows.cast(self._data.schema))
        self._data_bytes += rows.nbytes

    def _video(self, key: str, span: VideoSpan) -> dict[str, Any]:
        """Columns of ``meta/episodes`` for a camera; its file is copied when it first occurs."""
        source = (key, span.file)
        if source not in self._videos:
            if not span.file.is_file():
                raise DatasetError(f"{span.file} does not exist; download all of the dataset's videos", feature=key)
            self._videos[source] = sum(known == key for known, _ in self._videos)
        number = self._videos[source]
        place = {"chunk_index": number // CHUNK, "file_index": number % CHUNK}
        target = self._work / VIDEO_PATH.format(video_key=key, **place)
        if not target.exists():
            target.parent.mkdir(parents=True, exist_ok=True)
            self._copy(span.file, target)
        numbers = {**place, "from_timestamp": span.start, "to_timestamp": span.end}
        return {f"videos/{key}/{name}": value for name, value in numbers.items()}


def set_column(rows: pyarrow.Table, name: str, values: np.ndarray) -> pyarrow.Table:
    """A table with a column (n,) or (n, D) in the place of one of that name, or at the end.

    What Hugging Face's ``datasets`` notes about columns in the schema is kept true.
    """
    import pyarrow

    flat = pyarrow.array(np.ascontiguousarray(values).ravel())
    column = flat if values.ndim == 1 else pyarrow.FixedSizeListArray.from_arrays(flat, values.shape[1])
    field = pyarrow.field(name, column.type)
    if name in rows.column_names:
        rows = rows.set_column(rows.column_names.index(name), field, column)
    else:
        rows = rows.append_column(field, column)
    return rows.replace_schema_metadata(_noted(rows.schema.metadata, name, values))


def _noted(metadata: Mapping[bytes, bytes] | None, name: str, values: np.ndarray) -> dict[bytes, bytes]:
    kept = {key: value for key, value in (metadata or {}).items() if key == b"huggingface"}
    if not kept:
        return {}
    try:
        note = parse_json(kept[b"huggingface"].decode())
    except (ReadingError, UnicodeDecodeError):
        return {}
    info = note.get("info") if isinstance(note, dict) else None
    features = info.get("features") if isinstance(info, dict) else None
    if not isinstance(features, dict):
        return {}
    value = {"dtype": str(values.dtype), "_type": "Value"}
    features[name] = value if values.ndim == 1 else {"feature": value, "length": values.shape[1], "_type": "List"}
    return {b"huggingface": json.dumps(note).encode()}
