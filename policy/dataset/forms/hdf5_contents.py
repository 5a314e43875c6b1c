"""Numbers of an HDF5 file on standard output; run as a program, because a damaged file may take its reader down.

The HDF5 library is written in C and trusts what it reads: this process has bounded memory and may die. What comes out
is a line of JSON, a list of ``[path, shape, attributes]``, and the numbers as doubles, in the same order.
"""

from __future__ import annotations

import json
import math
import sys
import time
from collections.abc import Callable

import h5py
import numpy as np

TOTAL_MAX, CHUNK_MAX = 2**28, 2**26
"""Most numbers of a file together, as doubles, and largest piece of one that is unpacked at once [bytes]; chosen: 60
hours of 43 joints, and past what writers choose."""
NODES_MAX, DEPTH_MAX, ATTRIBUTES_MAX, TEXT_MAX = 20_000, 16, 64, 2**20
"""Most groups and arrays of a file, deepest nesting, most attributes of each, longest text of one; chosen: robomimic's
files have 20 arrays a demonstration."""
FILTERS = {1, 2, 3, 4, 5, 6, 32000}
"""Compressions that the library has itself; another one would load a plugin. Source: HDF5 ``H5Zpublic.h``, and LZF."""
MEMORY_MAX = 2**30
"""Memory beyond what imports take [bytes]; definition: four times `TOTAL_MAX`."""

CPU_FIRST, CPU_NODE, CPU_BYTE = 2.0, 1e-3, 8.0 / TOTAL_MAX
"""Processor time of opening a file, of a group or array, and of a byte of numbers [s]; chosen: three times what h5py
and gzip take, so that a loop without an end in a small file ends soon."""


class RefusedError(Exception):
    """What is not read, and why."""


def contents(
    path: str, allow: Callable[[float], None] = lambda seconds: None
) -> tuple[list[tuple[str, list[int], dict]], list[np.ndarray]]:
    """Every array of numbers of one or two dimensions: path, shape and attributes, and its numbers as doubles.

    Args:
        path: The file.
        allow: Is told before each piece of work how long all of it may have taken when that is done [s].

    Raises:
        RefusedError: If the file holds more than is read.
        OSError: If it is no HDF5.
    """
    listed: list[tuple[str, list[int], dict]] = []
    arrays: list[np.ndarray] = []
    seen, total = [0], 0
    allow(CPU_FIRST)
    with h5py.File(path, "r") as file:
        for name, node in _nodes(file, "", 0, seen):
            allow(CPU_FIRST + CPU_NODE * seen[0] + CPU_BYTE * total)
            if isinstance(node, h5py.Group):
                listed.append((name, [], _attributes(node)))
                arrays.append(np.empty(0))
                continue
            if not _plain(node):
                continue
            total += 8 * int(np.prod(node.shape, dtype=object))
            if total > TOTAL_MAX:
                raise RefusedError(f"holds more than {TOTAL_MAX} bytes of numbers; split it")
            allow(CPU_FIRST + CPU_NODE * seen[0] + CPU_BYTE * total)
            listed.append((name, list(node.shape), _attributes(node)))
            arrays.append(np.asarray(node[()], dtype=float))
    return listed, arrays


def _nodes(group: h5py.Group, path: str, depth: int, count: list[int]):
    """Groups and arrays, themselves and not what other files or links lead to."""
    yield path, group
    if depth > DEPTH_MAX:
        raise RefusedError(f"is nested deeper than {DEPTH_MAX} groups")
    for name in group:
        count[0] += 1
        if count[0] > NODES_MAX:
            raise RefusedError(f"has more than {NODES_MAX} groups and arrays")
        if not isinstance(group.get(name, getlink=True), h5py.HardLink):
            continue
        node, place = group[name], f"{path}/{name}" if path else name
        if isinstance(node, h5py.Group):
            yield from _nodes(node, place, depth + 1, count)
        elif isinstance(node, h5py.Dataset):
            yield place, node


def _plain(node: h5py.Dataset) -> bool:
    """Whether an array is of plain numbers that lie in this file, one or two dimensions, in pieces of bounded size."""
    if node.dtype.kind not in "fiub" or node.shape is None or len(node.shape) not in (1, 2) or not node.size:
        return False
    plist = node.id.get_create_plist()
    if node.is_virtual or plist.get_external_count() or node.dtype.itemsize > 8:
        return False
    filters = [plist.get_filter(i)[0] for i in range(plist.get_nfilters())]
    if not set(filters) <= FILTERS:
        raise RefusedError(f"has '{node.name:.80}' in a compression of a plugin ({filters}); gzip and lzf are read")
    if node.chunks and int(np.prod(node.chunks, dtype=object)) * node.dtype.itemsize > CHUNK_MAX:
        raise RefusedError(f"has '{node.name:.80}' in pieces of more than {CHUNK_MAX} bytes")
    return True


def _attributes(node: h5py.HLObject) -> dict:
    """Attributes that are a number, a text or a list of texts."""
    found = {}
    for name in list(node.attrs)[:ATTRIBUTES_MAX]:
        about = node.attrs.get_id(name)
        if about.shape is None or int(np.prod(about.shape, dtype=object)) > 1024 or about.get_storage_size() > TEXT_MAX:
            continue
        value = node.attrs[name]
        if isinstance(value, np.ndarray) and value.dtype.kind in "OSU" and value.ndim == 1:
            found[name] = [_text(one) for one in value.tolist()]
        elif isinstance(value, str | bytes):
            found[name] = _text(value)
        elif np.ndim(value) == 0 and np.asarray(value).dtype.kind in "fiu":
            found[name] = float(value)
    return {name: value for name, value in found.items() if value is not None}


def _text(value: object) -> str | None:
    text = value.decode("utf-8", "replace") if isinstance(value, bytes) else value
    return text if isinstance(text, str) and len(text) <= TEXT_MAX else None


def _bound_time() -> Callable[[float], None]:
    """Function that bounds the processor time of all that follows, where the system can: this process ends with it."""
    begin = time.process_time()

    def allow(seconds: float) -> None:
        try:
            import resource

            hard = resource.getrlimit(resource.RLIMIT_CPU)[1]
            resource.setrlimit(resource.RLIMIT_CPU, (math.ceil(begin + seconds), hard))
        except (ImportError, OSError, ValueError):
            return

    return allow


def _bound_memory() -> None:
    """Bound what may still be allocated, where the system can."""
    try:
        import resource

        with open("/proc/self/status") as status:
            now = 1024 * next(int(line.split()[1]) for line in status if line.startswith("VmData"))
        resource.setrlimit(resource.RLIMIT_DATA, (now + MEMORY_MAX, now + MEMORY_MAX))
    except (ImportError, OSError, ValueError, StopIteration):
        return


def main() -> int:
    """Write the contents of the file that is named; 1 with a sentence on standard error if it is refused."""
    _bound_memory()
    try:
        listed, arrays = contents(sys.argv[1], _bound_time())
    except RefusedError as error:
        sys.stderr.write(str(error))
        return 1
    except Exception as error:  # noqa: BLE001 - h5py raises whatever it likes on what it cannot read
        sys.stderr.write(f"cannot be read as HDF5 ({type(error).__name__}: {error!s:.200})")
        return 1
    sys.stdout.buffer.write(json.dumps(listed).encode() + b"\n")
    for array in arrays:
        sys.stdout.buffer.write(np.ascontiguousarray(array, dtype="<f8").tobytes())
    return 0


if __name__ == "__main__":
    sys.exit(main())
