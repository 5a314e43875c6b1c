"""Where the numbers of an action or a state are in a dataset: one feature, one a body part, or one a number."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from policy.dataset.format import ACTION, INDICES, STATE, Dataset, Episode, vectors
from policy.dataset.naming.meaning import DOUBLED, meaning, parted_names, says_nothing
from policy.dataset.naming.modality import modality_names, numbered_parts, part_joints
from policy.errors import DatasetError, did_you_mean
from policy.reading import listed

if TYPE_CHECKING:
    import pyarrow

_KEYS = {ACTION: (ACTION, "actions"), STATE: (STATE, "state", "states")}
"""Features that hold all of a vector: LeRobot's, and openpi's."""
_PREFIXES = {ACTION: ("action", "actions"), STATE: ("observation.state", "state", "observation")}
"""What the features of its parts begin with."""
_NUMBERS = ("float16", "float32", "float64")


@dataclass(frozen=True)
class Source:
    """Columns of an action or a state, side by side.

    Attributes:
        key: ``action`` or ``observation.state``.
        features: Features that they are in, in order.
        widths: Columns of each.
        parts, names: Part and name of each column; no names where the dataset has none.
        notes: What was taken for granted.
        correct: What is made of the numbers (n, dim) as a user says that they are to be read; nothing if None.
    """

    key: str
    features: tuple[str, ...]
    widths: tuple[int, ...]
    parts: tuple[str, ...]
    names: tuple[str, ...]
    notes: tuple[str, ...] = ()
    correct: Callable[[np.ndarray], np.ndarray] | None = field(default=None, compare=False, repr=False)

    @property
    def dim(self) -> int:
        """Number of columns."""
        return sum(self.widths)

    @property
    def whole(self) -> bool:
        """Whether they are the feature of that key and nothing else."""
        return self.features == (self.key,)

    def of(self, rows: pyarrow.Table, episode: Episode, columns: np.ndarray | None = None) -> np.ndarray:
        """Numbers of an episode's rows, in their own precision, shape (n, dim) or (n, len(columns)).

        Args:
            rows: Of the episode.
            episode: For messages.
            columns: Which numbers, in which order; all as they are if None.

        Raises:
            DatasetError: If a row is missing or has another length than its feature.
        """
        pairs = zip(self.features, self.widths, strict=True)
        found = [vectors(rows.column(key), width, key, episode) for key, width in pairs]
        values = found[0] if len(found) == 1 else np.concatenate(found, axis=1)
        values = values if self.correct is None else self.correct(values)
        in_order = columns is None or np.array_equal(columns, np.arange(self.dim))
        return values if in_order else values.take(columns, axis=1)

    def numbers(self, dataset: Dataset) -> Iterator[np.ndarray]:
        """Numbers (length, dim) of each episode in turn.

        Raises:
            DatasetError: As in `of`.
        """
        for episode in dataset.episodes:
            yield self.of(dataset.table(episode, list(self.features)), episode)


def find_source(dataset: Dataset, key: str) -> Source:
    """Where a dataset has its actions or states.

    Args:
        dataset: What is looked at.
        key: ``action`` or ``observation.state``.

    Raises:
        DatasetError: If they are nowhere; says what there is.
    """
    for one in _KEYS[key]:
        if one in dataset.features and _width(dataset, one):
            return _whole(dataset, key, one)
    for found in (_scalars(dataset, key), _parts(dataset, key)):
        if found is not None:
            return found
    for one in _KEYS[key]:
        if one in dataset.features:
            dtype = dataset.feature(one)["dtype"]  # refuses what is no vector
            raise DatasetError(
                f"'{one}' of {dataset.folder} has the dtype {dtype}; {' or '.join(_NUMBERS)} is read", feature=one
            )
    there = [name for name in dataset.features if name not in (*dataset.cameras, *INDICES)]
    raise DatasetError(
        f"{dataset.folder} has no feature '{key}'; {did_you_mean(key, there)}there are {', '.join(there) or 'none'}. "
        f"It is looked for as {', '.join(_KEYS[key])}, as {_PREFIXES[key][0]}.PART of each body part, and as "
        f"{key}_0, {key}_1 and so on",
        feature=key,
    )


def _whole(dataset: Dataset, key: str, feature: str) -> Source:
    width = _width(dataset, feature)
    named = parted_names(dataset.features[feature].get("names"))
    notes: tuple[str, ...] = ()
    if says_nothing([name for _, name in named], width):
        named, notes = modality_names(dataset, key, feature, width)
    else:
        named, numbered = numbered_parts(named)
        notes += tuple(f"{key}: {note}" for note in numbered)
    if named and len(named) != width:
        raise DatasetError(
            f"'{feature}' has {width} columns but {len(named)} names; there must be one name a column", feature=feature
        )
    parts, names = zip(*named, strict=True) if named else ((), ())
    return Source(key, (feature,), (width,), parts, names, notes)


def _scalars(dataset: Dataset, key: str) -> Source | None:
    """A feature a number, as ``action_0`` to ``action_27``."""
    found: dict[int, str] = {}
    for feature in dataset.features:
        for prefix in _PREFIXES[key]:
            match = re.fullmatch(rf"{re.escape(prefix)}[._](\d{{1,3}})", feature)
            if match and _width(dataset, feature) == 1:
                found[int(match[1])] = feature
    if len(found) < 2:
        return None
    missing = [number for number in range(max(found) + 1) if number not in found]
    if missing:
        raise DatasetError(f"{dataset.folder} has '{found[max(found)]}' but none with {missing[0]}", feature=key)
    features = tuple(found[number] for number in sorted(found))
    return Source(key, features, (1,) * len(features), (), ())


def _parts(dataset: Dataset, key: str) -> Source | None:
    """A feature a body part, as ``action.left_arm``; a joint that two of them have is read from the first."""
    for prefix in _PREFIXES[key]:
        features = [name for name in dataset.features if name.startswith(f"{prefix}.") and _width(dataset, name)]
        if prefix == "observation":
            features = [
                name for name in features if not name.startswith(("observation.images", "observation.environment"))
            ]
        columns = [column for name in features for column in _of_part(dataset, name, name.removeprefix(f"{prefix}."))]
        if not any(meaning(name, part).name for part, name, _ in columns):
            continue
        used, doubled = set(), []
        named = []
        for part, name, feature in columns:
            what = meaning(name, part).name
            if what and what in used:
                doubled.append(f"{feature}.{name}")
                named.append((DOUBLED, name))
            else:
                used.add(what)
                named.append((part, name))
        notes = (
            (f"{key}: {listed(doubled, 4)} are joints that another feature has too, which is read",) if doubled else ()
        )
        widths = tuple(_width(dataset, name) for name in features)
        parts, names = zip(*named, strict=True)
        return Source(key, tuple(features), widths, parts, names, notes)
    return None


def _of_part(dataset: Dataset, feature: str, part: str) -> list[tuple[str, str, str]]:
    """Part, name and feature of each column of a part."""
    width = _width(dataset, feature)
    named = parted_names(dataset.features[feature].get("names"))
    if len(named) != width or says_nothing([name for _, name in named], width):
        names = part_joints(part, width) or ((part,) if width == 1 else ())
        return [(part, names[i] if names else f"{part}_{i}", feature) for i in range(width)]
    return [(part, name, feature) for _, name in named]


def _width(dataset: Dataset, feature: str) -> int:
    """Columns of a feature of numbers; 0 if it is none."""
    about: Mapping = dataset.features[feature]
    shape = about.get("shape")
    if about["dtype"] not in _NUMBERS or feature in INDICES or not isinstance(shape, list | tuple) or len(shape) != 1:
        return 0
    return int(shape[0])
