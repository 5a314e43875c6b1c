"""Plain data and arrays as MessagePack frames, byte for byte as openpi writes them; no pickle.

MessagePack has no arrays. openpi writes each as a map with four keys, all of the binary type:

========  ==========================================  ===============================================
key       array                                       scalar (``np.float32(1.0)`` and the like)
========  ==========================================  ===============================================
marker    ``b"__ndarray__"``: true                    ``b"__npgeneric__"``: true
data      ``b"data"``: bytes, C order                 ``b"data"``: the number
dtype     ``b"dtype"``: such as ``"<f4"``, ``"|u1"``  ``b"dtype"``: likewise
shape     ``b"shape"``: list of lengths               --
========  ==========================================  ===============================================

A frame may come from anywhere: types other than numbers, booleans and text are refused before numpy looks at the bytes
(an object array made of a peer's bytes would be pointers), and so is a shape that is not that of the bytes.

Source:
    ``openpi_client.msgpack_numpy`` 0.1.2.
"""

from __future__ import annotations

import re
from math import prod
from typing import Any

import numpy as np

from policy.errors import PolicyError

KINDS = "biufUS"
"""Kinds of numpy types that travel: booleans, integers, floating point, text."""
DTYPE = re.compile(rf"[<>|=][{KINDS}][0-9]{{1,6}}")
"""What ``dtype.str`` writes for those kinds."""
BUFFER = 16 * 2**20
"""Room for a frame to begin with [bytes]: three images of 1280 x 720 are packed in a third of the time."""
DIMENSIONS_MAX = 32
"""Most dimensions of an array."""
ENTRIES_MAX = 20_000
"""Most entries of the lists and maps of a frame, all together: each takes fifty times its room in the frame."""
TEXT_MAX = 2**20
"""Longest text of a frame [bytes]."""


class WireError(PolicyError, ValueError):
    """A frame that is malformed, or data that no frame can carry."""


def pack(value: Any) -> bytes:
    """Frame of plain data: None, bool, int, float, str, bytes, lists, maps, numpy arrays and scalars.

    Raises:
        WireError: If something else is in it.
    """
    import msgpack

    try:
        return msgpack.Packer(default=_to_map, buf_size=BUFFER).pack(value)
    except (TypeError, ValueError, OverflowError) as error:
        raise WireError(f"the data do not fit into a frame: {error}") from error


def unpack(frame: bytes) -> Any:
    """Data of a frame; arrays are read-only.

    Raises:
        WireError: If the frame is malformed or holds a type that is not allowed.
    """
    import msgpack

    budget = _Budget()
    try:
        return msgpack.unpackb(
            frame,
            object_hook=budget.map,
            ext_hook=_refuse_extension,
            max_array_len=ENTRIES_MAX,
            max_map_len=ENTRIES_MAX,
            max_str_len=TEXT_MAX,
            list_hook=budget.list,
        )
    except WireError:
        raise
    # msgpack has no exception of its own for everything: a nesting too deep and bad text are ValueError, a key that
    # cannot be one TypeError.
    except (ValueError, TypeError, msgpack.UnpackException) as error:
        what = str(error) or type(error).__name__
        raise WireError(f"a frame of {len(frame)} bytes is no MessagePack: {what}") from error


class _Budget:
    """Counts what a frame unpacks to while it does."""

    def __init__(self) -> None:
        self.left = ENTRIES_MAX

    def list(self, found: list) -> list:
        """A list, counted."""
        self._spend(len(found))
        return found

    def map(self, found: dict) -> Any:
        """A map, or the array in it, counted."""
        self._spend(len(found))
        return _from_map(found)

    def _spend(self, entries: int) -> None:
        self.left -= 1 + entries
        if self.left < 0:
            raise WireError(f"the frame has more than {ENTRIES_MAX} entries")


def _to_map(value: Any) -> dict[bytes, Any]:
    if not isinstance(value, np.ndarray | np.generic):
        raise TypeError(f"{type(value).__name__} is no plain data")
    if value.dtype.kind not in KINDS:
        raise ValueError(f"an array of {value.dtype} cannot be sent; numbers, booleans and text can")
    if isinstance(value, np.ndarray):
        return {
            b"__ndarray__": True,
            b"data": value.tobytes(),
            b"dtype": value.dtype.str,
            b"shape": value.shape,
        }
    return {b"__npgeneric__": True, b"data": value.item(), b"dtype": value.dtype.str}


def _from_map(found: dict) -> Any:
    if b"__ndarray__" in found:
        return _array(found)
    if b"__npgeneric__" in found:
        data = found.get(b"data")
        if not isinstance(data, bool | int | float | str | bytes):
            raise WireError(f"a scalar holds {type(data).__name__}; a number or text is expected")
        try:
            return _dtype(found).type(data)
        except (ValueError, OverflowError) as error:
            raise WireError(f"a scalar of {found[b'dtype']} holds {data!r:.40}: {error}") from error
    return found


def _array(found: dict) -> np.ndarray:
    dtype, data, shape = _dtype(found), found.get(b"data"), found.get(b"shape")
    lengths = isinstance(shape, list) and all(type(n) is int and n >= 0 for n in shape)
    if not lengths or len(shape) > DIMENSIONS_MAX:
        raise WireError(f"an array has the shape {shape!r:.60}; up to {DIMENSIONS_MAX} lengths are expected")
    if not isinstance(data, bytes):
        raise WireError(f"the data of an array are {type(data).__name__}; bytes are expected")
    expected = prod(shape) * dtype.itemsize
    if len(data) != expected:
        raise WireError(f"an array of {dtype.str} {tuple(shape)} has {len(data)} bytes; {expected} are expected")
    try:
        return np.ndarray(shape, dtype, data)
    except ValueError as error:
        # Lengths whose product is 0 can still be too large one by one.
        raise WireError(f"an array of {dtype.str} {tuple(shape)}: {error}") from error


def _dtype(found: dict) -> np.dtype:
    text = found.get(b"dtype")
    if not isinstance(text, str) or not DTYPE.fullmatch(text):
        raise WireError(f"an array is of the type {text!r:.40}; numbers, booleans and text travel, as in '<f4'")
    try:
        dtype = np.dtype(text)
    except TypeError as error:
        raise WireError(f"numpy knows no type '{text}'") from error
    if dtype.itemsize == 0:
        raise WireError(f"an array of '{text}' has no content")
    return dtype


def _refuse_extension(code: int, data: bytes) -> Any:
    raise WireError(f"the frame holds the MessagePack extension {code}; openpi has none")
