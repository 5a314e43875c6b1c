"""Open a dataset of any form that is read: LeRobot's folders, JSON episodes of xr_teleoperate, HDF5."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from policy.dataset.format import EPISODES_MAX, Dataset, meta_file, read_json
from policy.dataset.forms.hdf5 import hdf5_files, read_hdf5
from policy.dataset.forms.v21 import read_v21
from policy.dataset.forms.v30 import read_v30
from policy.dataset.forms.xr_json import episode_files, read_xr_json
from policy.errors import DatasetError, printable
from policy.reading import FPS_MAX, FPS_MIN

INFO = Path("meta", "info.json")
"""What a LeRobot folder says of itself."""


def dataset_files(path: str | Path) -> list[Path]:
    """Files whose numbers a dataset is read from, without videos and pictures; none of what is no dataset."""
    path = Path(path)
    lerobot = [file for part in ("meta", "data") for file in (path / part).rglob("*")]
    return lerobot or episode_files(path) or hdf5_files(path)


def is_dataset(path: str | Path) -> bool:
    """Whether a path is a dataset of a form that is read."""
    return bool(Path(path, INFO).is_file() or episode_files(Path(path)) or hdf5_files(Path(path)))


def open_dataset(folder: str | Path) -> Dataset:
    """Read what a dataset says about itself; rows and videos are left where they are.

    Raises:
        DatasetError: If there is no dataset, it is of a format that is not read, or contradicts itself.
    """
    folder = Path(folder)
    if not (folder / INFO).is_file():
        if episode_files(folder):
            return read_xr_json(folder)
        if hdf5_files(folder):
            return read_hdf5(folder)
    info = read_json(meta_file(folder, "info.json"))
    version = info.get("codebase_version")
    readers = {"v3.0": read_v30, "v2.1": read_v21, "v2.0": read_v21}
    if not isinstance(version, str) or version not in readers:
        old = isinstance(version, str) and version.startswith("v1")
        cure = (
            "bring it up with LeRobot's own converters (lerobot.scripts.convert_dataset_*) first"
            if old
            else "write the one that it is there"
        )
        raise DatasetError(
            f"{folder}/meta/info.json has the codebase_version {version!r:.40}; {', '.join(readers)} are read: {cure}"
        )
    check_info(folder, info)
    dataset = readers[version](folder, info)
    if not dataset.episodes:
        raise DatasetError(f"{folder} has no episodes; record some, or download all of it")
    return dataset


def episode_numbers(text: str) -> tuple[int, ...]:
    """Episodes from ``0-3,7``.

    Raises:
        DatasetError: If the text is no such list.
    """
    numbers: list[int] = []
    for part in text.split(","):
        first, _, last = part.strip().partition("-")
        if (
            len(part) > 40
            or not first.isdecimal()
            or not (last or first).isdecimal()
            or int(last or first) < int(first)
        ):
            raise DatasetError(f"episodes '{text}' are no list of numbers and ranges such as 0-3,7")
        if int(last or first) - int(first) >= EPISODES_MAX or len(numbers) > EPISODES_MAX:
            raise DatasetError(f"episodes '{text:.60}' are more than {EPISODES_MAX}")
        numbers += range(int(first), int(last or first) + 1)
    return tuple(numbers)


def selected(dataset: Dataset, numbers: tuple[int, ...] | None) -> Dataset:
    """Dataset with some of its episodes; all if None.

    Raises:
        DatasetError: If there is no such episode, one is named twice, or none is.
    """
    if numbers is None:
        return dataset
    count = len(dataset.episodes)
    wrong = [number for number in numbers if not 0 <= number < count]
    if wrong or len(set(numbers)) != len(numbers) or not numbers:
        what = f"there is no episode {wrong[0]}" if wrong else "each may be named once, one at least"
        raise DatasetError(f"episodes {list(numbers)[:8]}: {what}; {dataset.folder} has 0 to {count - 1}")
    return dataclasses.replace(dataset, episodes=tuple(dataset.episodes[number] for number in sorted(numbers)))


def check_info(folder: Path, info: Mapping[str, Any]) -> None:
    """Refuse a ``meta/info.json`` that does not say where its files are.

    Raises:
        DatasetError: Saying what is wrong.
    """
    fps, features = info.get("fps"), info.get("features")
    if not isinstance(fps, (int, float)) or isinstance(fps, bool) or not FPS_MIN <= fps <= FPS_MAX:
        text = f"a positive rate in Hz is expected, {FPS_MIN:g} to {FPS_MAX:g}"
        raise DatasetError(f"{folder}/meta/info.json has fps {fps!r:.40}; {text}: write it there")
    if not isinstance(features, dict):
        raise DatasetError(f"{folder}/meta/info.json has no 'features', an object with dtype and shape of each")
    for key, feature in features.items():
        if not (isinstance(feature, dict) and isinstance(feature.get("dtype"), str) and "shape" in feature):
            text = f"{folder}/meta/info.json has the feature '{printable(key, 80)}' without dtype or shape"
            raise DatasetError(f"{text}: an object with both is expected of each in 'features'")
    if not all(_is_shape(feature["shape"]) for feature in features.values()):
        raise DatasetError(f"{folder}/meta/info.json has a feature whose shape is no list of whole numbers")
    chunks_size = info.get("chunks_size", 1)
    if type(chunks_size) is not int or chunks_size < 1:
        raise DatasetError(f"{folder}/meta/info.json has chunks_size {chunks_size!r}; a positive number is expected")
    for key in features:
        if "/" in key or "\\" in key or ".." in key:
            raise DatasetError(f"{folder}/meta/info.json has the feature '{key}', which is no name but a path")


def _is_shape(shape: object) -> bool:
    return isinstance(shape, list) and len(shape) <= 8 and all(type(size) is int and 0 < size < 2**20 for size in shape)
