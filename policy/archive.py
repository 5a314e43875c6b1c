"""Arrays of an ``.npz`` archive, with every name and size looked at before anything is unpacked; no pickle."""

from __future__ import annotations

import struct
import zipfile
import zlib
from collections.abc import Collection
from pathlib import Path
from tokenize import TokenError
from typing import IO

import numpy as np

from policy.errors import did_you_mean, printable
from policy.reading import ReadingError, require_file

ARCHIVE_MAX = 64 * 2**20
"""Largest archive [bytes]."""
ARRAY_MAX = 64 * 2**20
"""Largest array, unpacked [bytes]: 200,000 steps of 32 numbers have 51 MB."""
DIRECTORY_MAX = 16 * 2**10
"""Largest table of contents of an archive [bytes]; that of seven arrays has 400."""
DIMENSIONS_MAX = 4
_KINDS = "biufcUS"
_END, _END_SIZE, _ZIP64 = b"PK\x05\x06", 22, b"PK\x06\x07"
UNREADABLE = (
    zipfile.BadZipFile,
    zipfile.LargeZipFile,
    zlib.error,
    struct.error,
    EOFError,
    TokenError,  # a damaged header of an array
    SyntaxError,
    RecursionError,
    MemoryError,  # what the parser of a header says of too many brackets
    OverflowError,
    TypeError,
    KeyError,
    AttributeError,
    RuntimeError,  # a password is required, or the compression is none that zipfile knows
)
"""What zipfile and numpy raise on an archive that they cannot read."""


def read_arrays(
    path: Path,
    known: Collection[str],
    *,
    wanted: Collection[str] | None = None,
    archive_max: int = ARCHIVE_MAX,
    array_max: int = ARRAY_MAX,
    total_max: int | None = None,
) -> dict[str, np.ndarray]:
    """Arrays by name.

    Args:
        path: The archive.
        known: Names that it may hold.
        wanted: Those that are unpacked; all if not given.
        archive_max: Largest archive [bytes].
        array_max: Largest array, unpacked [bytes].
        total_max: All arrays that are unpacked together [bytes].

    Raises:
        OSError: If it cannot be read.
        ReadingError: If it is no archive, holds something else, or more than is read.
    """
    require_file(path, archive_max)
    try:
        _require_small_directory(path)
        with zipfile.ZipFile(path) as archive:
            members = archive.infolist()
            _require_names([member.filename for member in members], known)
            chosen = {member.filename.removesuffix(".npy"): member for member in members}
            chosen = {name: member for name, member in chosen.items() if wanted is None or name in wanted}
            for member in chosen.values():
                if member.file_size > array_max:
                    text = f"claims {member.file_size} bytes in '{member.filename}'; at most {array_max} are unpacked"
                    raise ReadingError(text)
            total = sum(member.file_size for member in chosen.values())
            if total_max is not None and total > total_max:
                raise ReadingError(f"claims {total} bytes in all; at most {total_max} are unpacked")
            return {
                name: _array(archive.open(member), name, member.file_size, array_max) for name, member in chosen.items()
            }
    except UNREADABLE as error:
        text = f"is no .npz file, or a damaged or encrypted one ({error}); write it again with numpy.savez"
        raise ReadingError(text) from error
    except ReadingError:
        raise
    except ValueError as error:
        raise ReadingError(f"has an array that cannot be read: {error}") from error


def array_names(path: Path, archive_max: int = ARCHIVE_MAX) -> tuple[str, ...]:
    """Names of the arrays of an archive, without opening one.

    Raises:
        OSError: If it cannot be read.
        ReadingError: If it is no archive, or holds something else.
    """
    require_file(path, archive_max)
    try:
        _require_small_directory(path)
        with zipfile.ZipFile(path) as archive:
            files = [member.filename for member in archive.infolist()]
    except (*UNREADABLE, ValueError) as error:
        raise ReadingError(f"is no .npz file, or a damaged or encrypted one ({error})") from error
    names = tuple(file.removesuffix(".npy") for file in files if file.endswith(".npy"))
    if len(names) != len(files) or len(set(names)) != len(names):
        raise ReadingError("contains what is no array, or one twice")
    return names


def _require_small_directory(path: Path) -> None:
    """Refuse an archive with a hundred thousand entries before Python makes an object of each."""
    with path.open("rb") as stream:
        stream.seek(max(path.stat().st_size - 2**16 - 2 * _END_SIZE, 0))
        tail = stream.read()
    at = tail.rfind(_END)
    if at < 0:
        raise zipfile.BadZipFile("File is not a zip file")
    size = struct.unpack_from("<L", tail, at + 12)[0]
    if size > DIRECTORY_MAX or tail[max(at - 20, 0) : at].startswith(_ZIP64):
        raise ReadingError(f"has a table of contents of {size} bytes; at most {DIRECTORY_MAX} are read, and no zip64")


def _require_names(names: list[str], known: Collection[str]) -> None:
    for name in names:
        if not name.endswith(".npy"):
            raise ReadingError(f"contains '{printable(name, 80)}', which is no array")
        key = name.removesuffix(".npy")
        if key not in known:
            text = f"has the unknown array '{printable(key, 80)}'; {did_you_mean(key, known)}known: {', '.join(known)}"
            raise ReadingError(text)
        if names.count(name) > 1:
            raise ReadingError(f"has the array '{key}' twice")


def read_array(path: Path, most: int = ARRAY_MAX) -> np.ndarray:
    """The array of an ``.npy`` file of at most so many bytes.

    Raises:
        OSError: If it cannot be read.
        ReadingError: If it is no array of numbers or texts, or a larger one.
    """
    size = require_file(path, most)
    try:
        with path.open("rb") as stream:
            return _array(stream, "array", size, most)
    except ReadingError:
        raise
    except (*UNREADABLE, ValueError) as error:
        raise ReadingError(f"is no .npy file, or a damaged one ({error}); write it again with numpy.save") from error


def _array(stream: IO[bytes], name: str, held: int, most: int) -> np.ndarray:
    """An array whose header agrees with the bytes that are held, without objects; closes the stream."""
    with stream:
        version = np.lib.format.read_magic(stream)
        read_header = {
            (1, 0): np.lib.format.read_array_header_1_0,
            (2, 0): np.lib.format.read_array_header_2_0,
        }.get(version)
        if read_header is None:
            raise ReadingError(f"{name} is in the npy format {version}; 1.0 and 2.0 are read")
        shape, fortran, dtype = read_header(stream)
        if dtype.hasobject:
            raise ReadingError(f"{name} holds Python objects, which are never unpickled; save plain numbers or strings")
        if dtype.kind not in _KINDS or dtype.names or dtype.subdtype:
            raise ReadingError(f"{name} is of the type {printable(dtype, 60)}; numbers and strings are read")
        lengths = [int(n) for n in shape]
        if len(lengths) > DIMENSIONS_MAX or min(lengths, default=0) < 0:
            text = f"{name} has the shape {printable(shape, 60)}; at most {DIMENSIONS_MAX} lengths are expected"
            raise ReadingError(text)
        size = int(np.prod(lengths, dtype=object)) * dtype.itemsize
        if size > min(most, held) or max(lengths, default=0) > most:
            raise ReadingError(f"{name} claims {size} bytes; the file holds {held}, at most {most} are read")
        content = stream.read(size + 1)
    if len(content) != size:
        raise ReadingError(f"{name} has {len(content)} bytes; {size} are expected")
    # A text of no characters takes no bytes, however many there are.
    values = np.frombuffer(content, dtype) if size else np.zeros(int(np.prod(lengths)), dtype)
    return values.reshape(lengths, order="F" if fortran else "C").copy()
