"""HDF5 of robomimic (Isaac Lab Mimic's, too) and of ALOHA: a file of demonstrations, or a file an episode.

What the columns are such files seldom say: names are taken from the attributes ``joint_names`` or ``names`` of an array
or of the file, else ``--assume-spec`` has to. Pictures are left where they are.

Source:
    robomimic ``docs/datasets/overview``, Isaac Lab ``HDF5DatasetFileHandler``, ALOHA ``record_sim_episodes.py``.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from policy.dataset.format import ACTION, STATE, Dataset
from policy.dataset.forms.gathered import Recording, RecordingPlace, gathered
from policy.errors import DatasetError, printable
from policy.reading import JSON_MAX, ReadingError, parse_json, require_file

FORM, SUFFIXES = "HDF5", (".h5", ".hdf5")
PROGRAM = Path(__file__).with_name("hdf5_contents.py")
"""Reads a file in a process of its own."""
FILE_MAX = 2**37
"""Largest file [bytes]; chosen: pictures are in it, which are not read."""
SECONDS_MAX = 120.0
"""Time that reading a file's numbers may take [s]; chosen: a cold disk, and no loop without an end."""
OUTPUT_MAX = 2**29
"""Most bytes that the reading process may answer; definition: twice what it reads."""
_ACTIONS = ("action", "actions")
_STATES = ("observations/qpos", "observations/state", "obs/qpos", "obs/joint_pos", "obs/robot_joint_pos", "obs/state",
           "state", "qpos", "states/articulation/robot/joint_position")  # fmt: skip
_RATES = ("fps", "control_freq", "frequency", "hz")
_NAMES = ("joint_names", "names", "action_names")


@dataclass(frozen=True)
class _Contents:
    """Arrays (n,) or (n, D) and attributes by path; groups have attributes only."""

    arrays: Mapping[str, np.ndarray]
    attributes: Mapping[str, Mapping[str, object]]


def hdf5_files(path: Path) -> list[Path]:
    """The file, or the files of a folder; none of anything else."""
    if path.suffix.lower() in SUFFIXES and path.is_file():
        return [path]
    return sorted(one for one in path.iterdir() if one.suffix.lower() in SUFFIXES) if path.is_dir() else []


def read_hdf5(path: Path) -> Dataset:
    """A file of demonstrations or of an episode, or a folder of such files.

    Raises:
        DatasetError: If h5py is not installed, or nothing can be read.
    """
    if not find_spec("h5py"):
        raise DatasetError(f"{path}: HDF5 is read with h5py, which is not installed: pip install 'g1-wholebody[hdf5]'")
    places: list[RecordingPlace] = []
    for file in hdf5_files(path):
        try:
            places += [RecordingPlace(file, name) for name in _episodes(_contents(file))]
        except DatasetError:
            places.append(RecordingPlace(file))  # said when it is read
    return gathered(path, FORM, places, partial(_recording, path))


def _episodes(found: _Contents) -> list[str]:
    """Groups of a file that are an episode each, by their numbers; the file itself is called nothing."""
    groups = {
        path.rpartition("/")[0].removesuffix("/action").removesuffix("/actions")
        for path in found.arrays
        if path.split("/")[-1] in _ACTIONS or any(part in _ACTIONS for part in path.split("/")[-2:-1])
    }
    groups = {"" if group in _ACTIONS else group for group in groups}

    def number(name: str) -> tuple[int, str]:
        digits = "".join(c for c in name.rpartition("/")[2] if c.isdecimal())[:12]
        return (int(digits) if digits else 0), name

    return sorted(groups, key=number) or [""]


def _recording(source: Path, place: RecordingPlace) -> Recording:
    """An episode of what the user named."""
    found, within = _contents(place.file), f"{place.name}/" if place.name else ""
    columns: dict[str, np.ndarray] = {}
    names: dict[str, tuple[str, ...]] = {}
    for key, candidates in ((ACTION, _ACTIONS), (STATE, _STATES)):
        for feature, path in _features(found, within, key, candidates):
            values = found.arrays[path]
            columns[feature] = values[:, None] if values.ndim == 1 else values
            if given := _names(found, path, place.name, columns[feature].shape[1]):
                names[feature] = given
    if not any(key.startswith(ACTION) for key in columns):
        there = sorted(path.removeprefix(within) for path in found.arrays if path.startswith(within))
        raise DatasetError(f"{place} has no {' or '.join(_ACTIONS)}; it has {', '.join(there[:8]) or 'no numbers'}")
    return Recording(columns, _rate(found, place, source), names, _task(found, place))


def _features(found: _Contents, within: str, key: str, candidates: Sequence[str]) -> list[tuple[str, str]]:
    """Feature and path of the whole vector, or of each part of it."""
    for name in candidates:
        if within + name in found.arrays:
            return [(key, within + name)]
        parts = [path for path in found.arrays if path.startswith(f"{within}{name}/")]
        if parts:
            return [(f"{key}.{path.removeprefix(f'{within}{name}/').replace('/', '_')}", path) for path in parts]
    return []


def _above(found: _Contents, place: str) -> list[Mapping[str, object]]:
    """Attributes of a group and of those above it, the nearest first."""
    parts = place.split("/") if place else []
    return [found.attributes.get("/".join(parts[:n]), {}) for n in range(len(parts), -1, -1)]


def _names(found: _Contents, path: str, group: str, width: int) -> tuple[str, ...]:
    for stated in (found.attributes.get(path, {}), *_above(found, group)):
        for name in _NAMES:
            value = stated.get(name)
            if isinstance(value, list) and len(value) == width and all(isinstance(one, str) for one in value):
                return tuple(value)
    return ()


def _rate(found: _Contents, place: RecordingPlace, source: Path) -> float:
    for stated in _above(found, place.name):
        for name in _RATES:
            if isinstance(stated.get(name), float):
                return stated[name]
        if (rate := _of_environment(stated.get("env_args"))) is not None:
            return rate
    files = source if source == place.file else source / f"*{place.file.suffix}"
    raise DatasetError(
        f"{place.file} does not say its rate; write it in, such as ALOHA's 50 Hz: python -c \"import glob, h5py; "
        f"[h5py.File(f, 'a').attrs.create('fps', 50) for f in glob.glob('{files}')]\""
    )


def _of_environment(text: object) -> float | None:
    """Rate [Hz] by robomimic's ``env_args``: its own, or Isaac Lab's steps and how many of them an action lasts."""
    try:
        stated = parse_json(text) if isinstance(text, str) else {}
        settings, steps = stated.get("env_kwargs") or {}, stated.get("sim_args") or {}
        if "control_freq" in settings:
            return float(settings["control_freq"])
        return 1.0 / (float(steps["dt"]) * float(steps.get("decimation", 1)))
    except (ReadingError, AttributeError, KeyError, TypeError, ValueError, ZeroDivisionError, OverflowError):
        return None


def _task(found: _Contents, place: RecordingPlace) -> str:
    texts = (stated.get(name) for stated in _above(found, place.name) for name in ("task", "language_instruction"))
    return next((text for text in texts if isinstance(text, str)), "")


def _contents(file: Path) -> _Contents:
    try:
        require_file(file, FILE_MAX)
        modified_ns = file.stat().st_mtime_ns
        if refused := _refusal(file, modified_ns):
            raise ReadingError(refused)
        return _read(file, modified_ns)
    except OSError as error:
        raise DatasetError(f"{file} cannot be read: {error.strerror or error}") from error
    except ReadingError as error:
        raise DatasetError(f"{file} {error}") from error


@lru_cache(maxsize=4096)
def _refusal(file: Path, modified_ns: int) -> str:
    """Why a file is refused, empty if it is read: a dataset is opened often, and a refusal may take its time once."""
    try:
        _read(file, modified_ns)
    except ReadingError as error:
        return str(error)
    return ""


@lru_cache(maxsize=4)
def _read(file: Path, modified_ns: int) -> _Contents:
    """Numbers of a file; the last ones are kept, because the episodes are asked for one after the other."""
    command = [sys.executable, "-P", str(PROGRAM), str(file)]
    try:
        done = subprocess.run(command, capture_output=True, timeout=SECONDS_MAX, check=False)
    except subprocess.TimeoutExpired as error:
        raise ReadingError(f"takes longer than {SECONDS_MAX:g} s to read") from error
    if done.returncode:
        stated = printable(done.stderr.decode("utf-8", "replace").strip().splitlines()[-1:] or ["nothing"], 300)
        raise ReadingError(stated if done.returncode == 1 else f"is damaged: the HDF5 library fails on it ({stated})")
    header, mark, numbers = done.stdout.partition(b"\n")
    if not mark or len(header) > JSON_MAX or len(numbers) > OUTPUT_MAX:
        raise ReadingError("is not read as a list of arrays")
    return _parsed(parse_json(header.decode("ascii")), np.frombuffer(numbers, "<f8"))


def _parsed(listed: Sequence[tuple[str, list[int], dict]], numbers: np.ndarray) -> _Contents:
    arrays: dict[str, np.ndarray] = {}
    at = 0
    for path, shape, _ in listed:
        if not shape:
            continue
        size = int(np.prod(shape))
        arrays[path] = numbers[at : at + size].reshape(shape)
        at += size
    return _Contents(arrays, {path: attributes for path, _, attributes in listed})
