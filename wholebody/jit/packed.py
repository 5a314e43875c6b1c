"""Flat memory divided into named blocks, for compiled code that takes it whole."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np


class Arena:
    """One array and the table of its blocks.

    Args:
        shapes: Shape of each block by number, (rows, columns) or (n,); numbers not named get no room.
        count: Number of blocks.
        dtype: Of all of them.

    Attributes:
        memory: The array.
        table: ``start rows columns`` of each block, shape (count, 3).
    """

    def __init__(self, shapes: Mapping[int, tuple[int, ...]], count: int, dtype: type) -> None:
        self.table = np.zeros((count, 3), dtype=np.int64)
        start = 0
        for block in range(count):
            shape = shapes.get(block, (0,))
            rows, columns = shape if len(shape) == 2 else (1, shape[0])
            self.table[block] = start, rows, columns
            start += rows * columns
        self._shapes = shapes
        self.memory = np.zeros(start + 8, dtype=dtype)

    def span(self, first: int, last: int) -> np.ndarray:
        """Blocks from ``first`` to ``last``, which follow each other without gaps, as one vector."""
        start, rows, columns = self.table[last]
        return self.memory[self.table[first, 0] : start + rows * columns]

    def __getitem__(self, block: int) -> np.ndarray:
        """A block in its shape, sharing the memory."""
        start, rows, columns = self.table[block]
        return self.memory[start : start + rows * columns].reshape(self._shapes[block])
