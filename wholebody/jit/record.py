"""Records: numbers with names, behind one pointer."""

from __future__ import annotations

import numpy as np


def record(*fields: tuple) -> np.dtype:
    """A record of floats, ``(name,)`` or ``(name, shape)`` each; compiled and interpreted code read ``one.name``."""
    return np.dtype((np.record, [(name, float, *shape) for name, *shape in fields]))
