"""A dataset of recordings that are not in parquet files: each a few columns of numbers, read when it is asked for."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from policy.dataset.format import EPISODES_MAX, Dataset, Episode
from policy.dataset.forms.tables import NO_PYARROW, ROWS_MAX
from policy.errors import DatasetError
from policy.reading import ReadingError, require_rate

if TYPE_CHECKING:
    import pyarrow

WIDTH_MAX = 1024
"""Most numbers of a column; chosen: past every robot's."""


@dataclass(frozen=True)
class RecordingPlace:
    """Where a recording is: a file, and its name in there."""

    file: Path
    name: str = ""

    def __str__(self) -> str:
        """Name for messages."""
        return f"{self.file}{':' if self.name else ''}{self.name}"


@dataclass(frozen=True)
class Recording:
    """Numbers of an episode.

    Attributes:
        columns: Numbers (n, D) by feature, such as ``action.left_arm``.
        names: What the source calls the columns of a feature, as far as it does.
        fps: Rows a second [Hz].
        task: What was to be done; empty if the source does not say it.
    """

    columns: Mapping[str, np.ndarray]
    fps: float
    names: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    task: str = ""

    def about(self) -> tuple[dict[str, tuple[int, tuple[str, ...] | None]], float]:
        """Width and names of each feature, and the rate: what all episodes of a dataset have in common."""
        return {key: (x.shape[1], self.names.get(key)) for key, x in self.columns.items()}, self.fps


Read = Callable[[RecordingPlace], Recording]
"""Reads a recording; raises `DatasetError` where it is broken."""


def gathered(folder: Path, form: str, places: Sequence[RecordingPlace], read: Read) -> Dataset:
    """Dataset of recordings, of which the broken ones are refused when they are read.

    Args:
        folder: What the user named.
        form: Name of the form.
        places: Of its recordings, in order.
        read: Reads one.

    Raises:
        DatasetError: If there are too many recordings, or none can be read.
    """
    if not find_spec("pyarrow"):
        raise DatasetError(f"{folder}: {NO_PYARROW}")
    if len(places) > EPISODES_MAX:
        raise DatasetError(f"{folder} has {len(places)} episodes; at most {EPISODES_MAX} are read")
    first, error, lengths, tasks = None, None, [], []
    for place in places:
        length, task = 0, ""
        try:
            one = read(place)
            _require_sound(one, place)
            first = first or one
            length, task = len(next(iter(one.columns.values()))), one.task
        except DatasetError as broken:
            error = error or broken
        lengths.append(length)
        tasks.append(task)
    if first is None:
        raise error or DatasetError(f"{folder} has no episodes")
    features = {
        key: {"dtype": "float64", "shape": [width], "names": None if names is None else list(names)}
        for key, (width, names) in first.about()[0].items()
    }
    indices = {"timestamp": "float64"} | dict.fromkeys(("frame_index", "episode_index", "index", "task_index"), "int64")
    features |= {key: {"dtype": dtype, "shape": [1], "names": None} for key, dtype in indices.items()}
    info = {"codebase_version": form, "robot_type": "unitree_g1", "fps": first.fps, "features": features}
    every = tuple(dict.fromkeys(tasks))
    episodes = tuple(
        Episode(i, length, (task,), place.file, 0)
        for i, (place, length, task) in enumerate(zip(places, lengths, tasks, strict=True))
    )

    def rows(episode: Episode) -> pyarrow.Table:
        one = read(places[episode.index])
        _require_sound(one, places[episode.index])
        if one.about() != first.about():
            raise DatasetError(
                f"{places[episode.index]} has other columns, names or another rate than the episodes before it: "
                f"{_differing(one, first)}"
            )
        return _table(one, episode.index, sum(lengths[: episode.index]), every.index(one.task))

    return Dataset(folder, form, info, every, episodes, {}, rows)


def _require_sound(one: Recording, place: RecordingPlace) -> None:
    """Refuse columns of other shapes than (n, D), of different lengths, or none; a rate that is none."""
    try:
        require_rate("its rate", one.fps)
    except ReadingError as error:
        raise DatasetError(f"{place}: {error}") from error
    shapes = {key: x.shape for key, x in one.columns.items()}
    if not shapes or any(len(shape) != 2 or not 1 <= shape[1] <= WIDTH_MAX for shape in shapes.values()):
        raise DatasetError(f"{place} has columns of the shapes {shapes}; some of (rows, numbers) are expected")
    if len({shape[0] for shape in shapes.values()}) != 1 or not 1 <= next(iter(shapes.values()))[0] <= ROWS_MAX:
        raise DatasetError(f"{place} has columns of the shapes {shapes}; as many rows in each are expected")


def _differing(one: Recording, first: Recording) -> str:
    (mine, fps), (others, others_fps) = one.about(), first.about()
    wrong = [key for key in dict.fromkeys((*mine, *others)) if mine.get(key) != others.get(key)]
    return f"{wrong[0]}" if wrong else f"{fps:g} Hz for {others_fps:g} Hz"


def _table(one: Recording, number: int, start: int, task: int) -> pyarrow.Table:
    import pyarrow

    n = len(next(iter(one.columns.values())))
    columns = {
        key: pyarrow.FixedSizeListArray.from_arrays(pyarrow.array(np.ascontiguousarray(x).ravel()), x.shape[1])
        for key, x in one.columns.items()
    }
    columns |= {"timestamp": pyarrow.array(np.arange(n) / one.fps), "frame_index": pyarrow.array(np.arange(n))}
    columns |= {"episode_index": pyarrow.array(np.full(n, number)), "index": pyarrow.array(start + np.arange(n))}
    return pyarrow.table(columns | {"task_index": pyarrow.array(np.full(n, task))})
