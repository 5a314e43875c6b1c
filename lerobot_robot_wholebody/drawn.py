"""What all tasks have that are elsewhere each time: their own numbers."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np


class Drawn(ABC):
    """A task that is drawn anew, by its own numbers or by somebody else's.

    Args:
        seed: Of its own.
    """

    def __init__(self, seed: int) -> None:
        self._rng = np.random.default_rng(seed)
        self.next()

    def next(self) -> None:
        """Draw another instance of it."""
        self.draw(self._rng)

    @abstractmethod
    def draw(self, rng: np.random.Generator) -> None:
        """Draw another instance of it from somebody's numbers."""
