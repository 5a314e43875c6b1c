"""A run as arrays: what a recording holds, and how one is read. ``docs/pictures.md`` has the same table."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from policy.archive import read_arrays
from policy.errors import FileFormatError
from policy.reading import ReadingError
from policy.recorded.chunk_file import KEYS
from wholebody.types import Reason, Status

VERSION = 2
"""Version of the format."""
FILE_MAX, ARRAY_MAX, TOTAL_MAX = 512 * 2**20, 128 * 2**20, 2**30
"""Largest recording, its largest array, and all that are unpacked together [bytes]: ten minutes of everything."""
ROWS_MAX, WIDTH_MAX = 2_000_000, 10_000
"""Most control periods, an hour of them, and most characters of a text."""
TEXT_MAX = 300
"""Most characters of a sentence that is recorded."""
NUMBER_MAX = 1e12
"""Largest number of a run, in any [unit]; chosen: what comes near it has long broken down."""
SIDES = ("left", "right")
MAY_BE_NAN = ("T_world_palms_asked", "pressure", "pressure_margin")
"""Columns in which NaN says that there is nothing."""


@dataclass(frozen=True)
class Column:
    """An array of a recording.

    Attributes:
        shape: Lengths: a number, or a letter that stands for the same number wherever it is.
        unit: Of its values; empty for names, numbers without a unit and text.
        meaning: What it holds.
        kind: ``f`` for numbers, ``i`` for whole ones, ``U`` for text.
    """

    shape: tuple[str | int, ...]
    unit: str
    meaning: str
    kind: str = "f"


PERIODS: dict[str, Column] = {
    "time": Column(("n",), "s", "beginning of the control period"),
    "q": Column(("n", "nq"), "m, rad", "true configuration: base position, quaternion xyzw, joints as `joint_names`"),
    "v": Column(("n", "nv"), "m/s, rad/s", "true velocity: base linear and angular in the base frame, joints likewise"),
    "q_command": Column(("n", "m"), "rad", "commanded positions, motors as `motor_names`"),
    "dq_command": Column(("n", "m"), "rad/s", "commanded speeds"),
    "tau_command": Column(("n", "m"), "N m", "commanded feed-forward torques"),
    "torque": Column(("n", "m"), "N m", "what the motors gave at the end of the period before"),
    "torque_asked": Column(("n", "m"), "N m", "most that the motors were asked for in the period before, unlimited"),
    "T_world_palms_asked": Column(
        ("n", 2, 4, 4), "m", "palm poses that the chunk asks for at this time, left first; "
        "its last ones when it is over, NaN before the first chunk"),
    "T_world_palms_commanded": Column(("n", 2, 4, 4), "m", "palm poses that the controller is given"),
    "T_world_palms_measured": Column(("n", 2, 4, 4), "m", "palm poses of the true state"),
    "com": Column(("n", 3), "m", "centre of mass"),
    "capture_point": Column(("n", 2), "m", "centre of mass plus its velocity over the pendulum's frequency"),
    "foot_force": Column(("n",), "N", "load of the floor on the feet"),
    "pressure": Column(("n", 2), "m", "centre of pressure; NaN in the air"),
    "soles": Column(("n", "c", 2), "m", "corners of both soles seen from above, those of the left one first"),
    "carries": Column(("n", "c"), "", "1 where the sole of a corner stands on the floor", "i"),
    "pressure_margin": Column(("n",), "m", "distance of the centre of pressure inside the soles that stand"),
    "capture_margin": Column(("n",), "m", "distance of the capture point inside the soles that stand"),
    "rate": Column(("n",), "", "speed along the plan, 1 at the chunk's own"),
    "planning_time": Column(("n",), "s", "CPU time that the last plan took; 0 before the first"),
    "status": Column(("n",), "", "status of the supervisor", "U"),
    "reason": Column(("n",), "", "reason code of the status, or nothing", "U"),
    "detail": Column(("n",), "", "which of `details` it said", "i"),
    "contacts": Column(("n",), "", "which of `contact_sets` touched", "i"),
    "objects": Column(("n", "k", 7), "m", "position and quaternion wxyz of the scene's bodies that move"),
}  # fmt: skip
"""Arrays with a row a control period."""

CONSTANTS: dict[str, Column] = {
    "version": Column((), "", f"of this format: {VERSION}", "i"),
    "scene": Column((), "", "scene of the run", "U"),
    "joint_names": Column(("j",), "", "joints of `q` and `v` after the base, Pinocchio's order", "U"),
    "motor_names": Column(("m",), "", "joints of the commands, motor order", "U"),
    "effort_max": Column(("m",), "N m", "effort limits of the motors"),
    "details": Column(("d",), "", "what the supervisor said, the first one nothing", "U"),
    "contact_sets": Column(("s",), "", "bodies that touched, as `first-second` joined by blanks, the first none", "U"),
    "orientation_free": Column((2,), "", "1 where nothing is asked of the left and right palm's orientation", "i"),
    "palm_bounds": Column((2,), "m", "`verdict.palm_feasible` and `palm_repair`"),
    "turn_bounds": Column((2,), "rad", "`verdict.turn_feasible` and `turn_repair`"),
    "balance_margin": Column((), "m", "`safety.balance_margin`, which the capture point is to keep"),
    "lead": Column((), "s", "`planning.lead`, the time that there is for a plan"),
}
"""Arrays that are the same all along."""

COLUMNS = PERIODS | CONSTANTS


@dataclass(frozen=True)
class Footprint:
    """A foot that stands.

    Attributes:
        side: Which one.
        begin, end: Control period in which it is set down, and the first in which it is up again.
        corners: Of its sole seen from above, shape (k, 2), [m].
    """

    side: str
    begin: int
    end: int
    corners: np.ndarray


@dataclass(frozen=True)
class Record:
    """A recording that was read, or a part of it.

    Attributes:
        arrays: Columns by name.
    """

    arrays: Mapping[str, np.ndarray]

    def __getitem__(self, name: str) -> np.ndarray:
        return self.arrays[name]

    def __len__(self) -> int:
        """Number of control periods."""
        return len(self.arrays["time"])

    def footprints(self) -> list[Footprint]:
        """Where each foot stood, in the order of time; two of a robot that makes no step."""
        found = []
        for foot, side in enumerate(SIDES):
            of = np.array_split(np.arange(self["soles"].shape[1]), len(SIDES))[foot]
            on = np.r_[False, self["carries"][:, of].all(axis=1), False]
            begins, ends = (np.flatnonzero(on[:-1] < on[1:]), np.flatnonzero(on[:-1] > on[1:]))
            found += [
                Footprint(side, begin, end, self["soles"][(begin + end) // 2, of])
                for begin, end in zip(begins.tolist(), ends.tolist(), strict=True)
            ]
        return sorted(found, key=lambda one: one.begin)

    def palm_errors(self, first: str = "asked", second: str = "measured") -> np.ndarray:
        """Distances between two of the palm poses, shape (n, 2), [m]; NaN before the first chunk."""
        a, b = (self[f"T_world_palms_{name}"] for name in (first, second))
        return np.linalg.norm(a[..., :3, 3] - b[..., :3, 3], axis=-1)

    def palm_turns(self, first: str = "asked", second: str = "measured") -> np.ndarray:
        """Angles between two of the palm poses, shape (n, 2), [rad]; NaN before the first chunk."""
        a, b = (self[f"T_world_palms_{name}"][..., :3, :3] for name in (first, second))
        # The chord |A - B| of two rotations is sqrt(8) sin(angle / 2).
        chord = np.linalg.norm(a - b, axis=(-2, -1))
        return 2.0 * np.arcsin(np.clip(chord / np.sqrt(8.0), 0.0, 1.0))


def read_record(path: str | Path, wanted: Collection[str] = COLUMNS) -> Record:
    """Columns of a recording, checked.

    Args:
        path: File written by `wholebody.sim.recorder.Recorder.save`.
        wanted: Names of the columns that are unpacked.

    Raises:
        OSError: If there is none.
        FileFormatError: If it is no recording, or is damaged.
    """
    path = Path(path)
    try:
        limits = {"archive_max": FILE_MAX, "array_max": ARRAY_MAX, "total_max": TOTAL_MAX}
        arrays = read_arrays(path, COLUMNS, wanted={*wanted, "version", "time"}, **limits)
        if "version" in arrays and arrays["version"].shape == () and arrays["version"] != VERSION:
            raise ReadingError(f"is a recording of format {arrays['version']}; {VERSION} is read: record the run again")
        _check(arrays, {*wanted, "version", "time"})
    except ReadingError as error:
        text = f"{error}"
        if _is_chunk(path):
            text = f"is a chunk file, and recordings are drawn: `wholebody run {path} --record run.npz` makes one of it"
        raise FileFormatError(text, path=str(path)) from error
    return Record(arrays)


def _is_chunk(path: Path) -> bool:
    """Whether it is what a recording is made of, and easily taken for one."""
    try:
        return "actions" in read_arrays(path, KEYS, wanted={"actions"})
    except ReadingError:
        return False


def _check(arrays: Mapping[str, np.ndarray], wanted: Collection[str]) -> None:
    """Columns that are all there, of the right kinds and shapes, and say what can be."""
    n = arrays["time"].shape[0] if np.ndim(arrays.get("time")) == 1 else 1
    if not 1 <= n <= ROWS_MAX:
        raise ReadingError(f"has {n} control periods; 1 to {ROWS_MAX} are read")
    missing = sorted(set(wanted) - set(arrays))
    if missing:
        text = f"has no column '{missing[0]}': is it a recording? `wholebody run --record FILE` writes one"
        raise ReadingError(text)
    lengths: dict[str, int] = {}
    for name, array in arrays.items():
        column = COLUMNS[name]
        kinds = {"f": "f", "i": "iu", "U": "U"}[column.kind]
        if array.dtype.kind not in kinds or (column.kind == "f" and array.dtype.itemsize != 8):
            raise ReadingError(f"has '{name}' of type {array.dtype}; {_KINDS[column.kind]} is expected")
        _check_shape(name, array.shape, column.shape, lengths)
        if array.dtype.kind == "U" and array.dtype.itemsize > 4 * WIDTH_MAX:
            raise ReadingError(f"has '{name}' of {array.dtype.itemsize // 4} characters; at most {WIDTH_MAX} are read")
        if column.kind == "f" and not _is_sound(array, may_be_nan=name in MAY_BE_NAN):
            raise ReadingError(f"has '{name}' that is not finite, or beyond {NUMBER_MAX:g} {column.unit}".rstrip())
    if not (np.diff(arrays["time"]) > 0.0).all():
        raise ReadingError("has times that do not increase")
    for name, known in (("status", {status.value for status in Status}), ("reason", {"", *Reason})):
        strange = sorted(set(arrays.get(name, np.array([], dtype=str)).tolist()) - known)
        if strange:
            raise ReadingError(f"has the unknown {name} '{strange[0][:40]}'")
    for name, table in (("detail", "details"), ("contacts", "contact_sets")):
        if name in arrays and table in arrays:
            index = arrays[name]
            if index.min() < 0 or index.max() >= len(arrays[table]):
                raise ReadingError(f"has '{name}' {index.max()}, and {len(arrays[table])} of '{table}'")


def _is_sound(array: np.ndarray, *, may_be_nan: bool) -> bool:
    """Whether all numbers are finite and of a run; the least and the largest of what has a NaN is one."""
    values = np.nan_to_num(array, posinf=np.inf, neginf=-np.inf) if may_be_nan else array
    return not array.size or bool(values.min() >= -NUMBER_MAX and values.max() <= NUMBER_MAX)


_KINDS = {"f": "a number of 64 bits", "i": "a whole number", "U": "text"}


def _check_shape(name: str, shape: tuple[int, ...], wanted: tuple[str | int, ...], lengths: dict[str, int]) -> None:
    text = f"has '{name}' of shape {shape}; ({', '.join(str(length) for length in wanted)}) is expected"
    if len(shape) != len(wanted):
        raise ReadingError(text)
    for length, letter in zip(shape, wanted, strict=True):
        known = letter if isinstance(letter, int) else lengths.setdefault(letter, length)
        if length != known:
            raise ReadingError(f"{text}, where {letter} is {known}")
