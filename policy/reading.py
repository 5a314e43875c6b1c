"""Reading what comes from outside: kind and size of a file before it is opened, depth of JSON before it is used.

Every reader of files goes through here, so that a pipe, a device or a folder in the place of a file is refused and not
waited for, and nothing is read, unpacked or nested beyond a bound that the message names (`docs/security.md`).
"""

from __future__ import annotations

import json
import stat
from collections.abc import Iterable
from math import isfinite
from pathlib import Path
from typing import Any

from policy.errors import PolicyError, printable

JSON_MAX = 64 * 2**20
"""Largest JSON file [bytes]: the statistics of a hundred thousand episodes."""
SPEC_MAX = 2**20
"""Largest JSON of a layout, a policy's configuration or a processor [bytes]; real ones have 30 kB at most."""
DEPTH_MAX = 32
"""Deepest nesting of JSON and YAML; real files have 6 levels."""
VALUES_MAX = 8_000_000
"""Most values of a JSON file, by its commas and brackets; chosen: of numbers they take 300 MB."""
INTEGER_MAX = 2**63 - 1
"""Largest whole number in JSON: what 64 bits hold."""
FPS_MIN, FPS_MAX = 0.1, 2000.0
"""Bounds of the rate of recordings, layouts and chunks [Hz]."""
STEPS_MAX = 200_000
"""Most steps of a recording: 1.8 hours at 30 Hz."""
HORIZON_MAX = 1000
"""Most steps of a single answer of a policy; known policies give 8 to 100."""


class ReadingError(PolicyError, ValueError):
    """Something that is not read: no regular file, too large, nested too deep, a number that no double holds."""


def require_file(path: str | Path, most: int) -> int:
    """Size of a file that may be opened [bytes].

    Args:
        path: The file; links are followed.
        most: Largest size [bytes].

    Raises:
        OSError: If there is none.
        ReadingError: If it is a folder, a pipe, a device or a socket, or larger.
    """
    found = Path(path).stat()
    if not stat.S_ISREG(found.st_mode):
        raise ReadingError(f"is {_kind(found.st_mode)}, which cannot be read; a regular file is expected")
    if found.st_size > most:
        raise ReadingError(f"has {found.st_size} bytes; at most {most} are read")
    return found.st_size


def read_text(path: str | Path, most: int) -> str:
    """Text of a file in UTF-8.

    Raises:
        OSError: If it cannot be read.
        ReadingError: As `require_file`, or if it is no text.
    """
    require_file(path, most)
    with Path(path).open("rb") as stream:
        # A file may grow after it was looked at.
        content = stream.read(most + 1)
    if len(content) > most:
        raise ReadingError(f"has more than {most} bytes; no more are read")
    try:
        return content.decode()
    except UnicodeDecodeError as error:
        raise ReadingError(f"is no text in UTF-8: {error.reason} at byte {error.start}") from error


def parse_json(text: str, *, finite: bool = False, integer_max: int = INTEGER_MAX) -> Any:
    """Data of a JSON text.

    Args:
        text: The text.
        finite: Refuse NaN and infinity, which Python writes and JSON does not have.
        integer_max: Largest whole number, either sign.

    Raises:
        ReadingError: If it is no JSON, is nested deeper than `DEPTH_MAX`, or has a number beyond a double's range or
            `integer_max`.
    """

    def integer(digits: str) -> int:
        if len(digits) > len(str(integer_max)) + 1 or abs(number := int(digits)) > integer_max:
            raise ReadingError(f"has a whole number of {len(digits)} digits; at most {integer_max:.3g} is read")
        return number

    # A short text can become many objects: they are counted before there are any.
    if (count := sum(map(text.count, ",[{"))) > VALUES_MAX:
        raise ReadingError(f"has about {count} values; at most {VALUES_MAX} are read")
    try:
        data = json.loads(text, parse_int=integer, parse_float=_float, parse_constant=_refused if finite else None)
    except RecursionError as error:
        raise ReadingError(f"is nested deeper than {DEPTH_MAX} levels") from error
    except json.JSONDecodeError as error:
        raise ReadingError(f"is no JSON: {error}") from error
    require_depth(data)
    return data


def read_json(path: str | Path, most: int = JSON_MAX, **limits: Any) -> Any:
    """Data of a JSON file, with the limits of `parse_json`.

    Raises:
        OSError: If it cannot be read.
        ReadingError: As `read_text` and `parse_json`.
    """
    return parse_json(read_text(path, most), **limits)


def require_depth(data: Any) -> None:
    """Refuse plain data that is nested deeper than `DEPTH_MAX`.

    Raises:
        ReadingError: If it is.
    """
    level, depth = [data], 0
    while level := [inner for value in level for inner in _inside(value)]:
        depth += 1
        if depth > DEPTH_MAX:
            raise ReadingError(f"is nested deeper than {DEPTH_MAX} levels")


def require_rate(what: str, fps: float) -> None:
    """Refuse a rate outside `FPS_MIN` to `FPS_MAX`, NaN too.

    Raises:
        ReadingError: If it is.
    """
    if not FPS_MIN <= fps <= FPS_MAX:
        raise ReadingError(f"{what} is {fps:.6g}; a positive rate of {FPS_MIN:g} to {FPS_MAX:g} Hz is expected")


def listed(names: Iterable[object], most: int = 8) -> str:
    """A few names in quotes, the rest counted."""
    names = [f"'{printable(name, 80)}'" for name in names]
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more


def _kind(mode: int) -> str:
    kinds = {
        stat.S_ISDIR: "a folder",
        stat.S_ISFIFO: "a pipe",
        stat.S_ISCHR: "a device",
        stat.S_ISBLK: "a device",
        stat.S_ISSOCK: "a socket",
    }
    return next((name for test, name in kinds.items() if test(mode)), "no file")


def _inside(value: Any) -> list[Any]:
    """Objects and lists directly within one."""
    inner = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    return [item for item in inner if isinstance(item, dict | list)]


def _float(digits: str) -> float:
    number = float(digits)
    if not isfinite(number):
        raise ReadingError(f"has the number {printable(digits, 40)}, which is beyond what a double holds")
    return number


def _refused(name: str) -> float:
    raise ReadingError(f"has the number {name}; finite numbers are expected")
