"""Compile what the reference needs in the control tick, so that its first tick is as short as the others."""

from __future__ import annotations

import numpy as np

from wholebody.reference.hand_path import HandPath
from wholebody.reference.layout import rest_row
from wholebody.reference.smoother import ReferenceSmoother


def warm_up() -> None:
    """Compile, or load from numba's cache on disk, the look-up and the smoother: some 15 s once, then a second."""
    path = HandPath.from_knots(np.zeros(1), np.eye(4)[None], np.zeros((1, 7)))
    rows = np.stack([path.at(0.0), rest_row(np.eye(4))])
    ReferenceSmoother(rows).step(rows, 0.002)
