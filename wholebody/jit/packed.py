"""Arrays by name on one memory, for compiled code that takes all of them as one argument.

A kernel says ``tick.H`` and ``tick.n_contacts``; compiled, that is a pointer and a table look-up (`packed_type`), and
interpreted, an array of numpy::

    tick = Packed({"H": (4, 4), "g": (4,), "tolerance": ()}, {"rows": (8,), "n_rows": ()})
    tick.H[0, 0] = 1.0
    tick.n_rows = 3

One argument instead of a hundred: a call then costs no more than the arithmetic in it.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import prod
from typing import Any

import numpy as np

Shape = tuple[int, ...]

TABLE_ROW = 4
"""Numbers of the table for each field: where it begins in the memory, and up to three lengths."""


class Packed:
    """Fields of float64 and of int64 on one memory, zero at first.

    Args:
        reals: Shape of each field of reals by name; ``()`` is a scalar. They follow each other without gaps.
        ints: The same for integers.

    Attributes:
        memory: All of it, float64; the table of the fields first.
        fields: Name, kind (``f`` or ``i``) and number of dimensions of each field: what compiled code is compiled for.

    Raises:
        ValueError: If a field has more than three dimensions, or a name stands twice.
    """

    memory: np.ndarray
    fields: tuple[tuple[str, str, int], ...]
    _views: dict[str, np.ndarray]
    _starts: dict[str, tuple[int, int]]

    def __init__(self, reals: Mapping[str, Shape], ints: Mapping[str, Shape]) -> None:
        named = [(name, "f", shape) for name, shape in reals.items()] + [(n, "i", shape) for n, shape in ints.items()]
        names = [name for name, _, _ in named]
        twice = {name for name in names if names.count(name) > 1}
        if twice or any(len(shape) > 3 for _, _, shape in named):
            raise ValueError(f"fields have different names and at most three dimensions; twice: {sorted(twice)}")
        sizes = [prod(shape) for _, _, shape in named]
        starts = TABLE_ROW * len(named) + np.cumsum([0, *sizes])
        memory = np.zeros(int(starts[-1]))
        integers, views = memory.view(np.int64), dict[str, np.ndarray]()
        for k, ((name, kind, shape), start, size) in enumerate(zip(named, starts.tolist(), sizes, strict=False)):
            integers[TABLE_ROW * k] = start
            integers[TABLE_ROW * k + 1 : TABLE_ROW * k + 1 + len(shape)] = shape
            views[name] = (memory if kind == "f" else integers)[start : start + size].reshape(shape)
        store = self.__dict__
        store["memory"], store["_views"] = memory, views
        store["fields"] = tuple((name, kind, len(shape)) for name, kind, shape in named)
        store["_starts"] = dict(zip(names, zip(starts.tolist(), starts[1:].tolist(), strict=False), strict=True))

    def __getattr__(self, name: str) -> Any:
        """A field in its shape, an array that shares the memory; a scalar as a number."""
        view: np.ndarray | None = self.__dict__.get("_views", {}).get(name)
        if view is None:
            raise AttributeError(f"there is no field '{name}'")
        return view if view.ndim else view.item()

    def __setattr__(self, name: str, value: float) -> None:
        """Set a scalar; arrays are written in place."""
        view = self._views.get(name)
        if view is None or view.ndim:
            raise AttributeError(f"'{name}' is not a scalar field; an array is written in place, `.{name}[:] = ...`")
        view[()] = value

    def shape(self, shapes: Mapping[str, Shape]) -> None:
        """Give fields other lengths, within the memory that they were made with; what is in them is without meaning.

        Compiled code reads lengths from the table: kernels follow without a word. Views that were taken before keep
        theirs.

        Raises:
            ValueError: If a field has no memory for so much, or another number of dimensions.
        """
        integers, place = self.memory.view(np.int64), {name: k for k, (name, _, _) in enumerate(self.fields)}
        for name, shape in shapes.items():
            (start, end), (_, kind, ndim) = self._starts[name], self.fields[place[name]]
            if len(shape) != ndim or start + prod(shape) > end:
                raise ValueError(f"'{name}' has memory for {end - start} numbers in {ndim} dimensions, not {shape}")
            at = TABLE_ROW * place[name] + 1
            integers[at : at + ndim] = shape
            memory = self.memory if kind == "f" else integers
            self._views[name] = memory[start : start + prod(shape)].reshape(shape)

    def span(self, first: str, last: str) -> np.ndarray:
        """Fields of reals from ``first`` to ``last`` in the order in which they were declared, as one vector."""
        return self.memory[self._starts[first][0] : self._starts[last][1]]
