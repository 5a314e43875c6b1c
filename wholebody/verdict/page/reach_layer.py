"""Where each palm can be held, from the map of reachability: fields whose level 0 is the border."""

from __future__ import annotations

import numpy as np

from models.spec import RobotSpec
from wholebody.config import ControllerConfig
from wholebody.planning.reachability.pairs import (
    BOX_HIGH,
    BOX_LOW,
    LOAD_KNOWN,
    MIRROR,
    PALM_AT_REST,
    TURNS,
    Pairs,
    Turn,
)
from wholebody.planning.reachability.reach_map import basis, map_for

FIELD_SPACING = 0.05
"""Distance of two points of a field [m]; chosen: 50 kB a hand, and the border to a centimetre between them."""


def reach_fields(spec: RobotSpec, config: ControllerConfig) -> list[np.ndarray]:
    """Logarithm of the odds that a palm can be held, the other one at rest, however they are turned.

    Returns:
        Of the left and the right palm, shape (nz, ny, nx), in the box of `box`; none without a map for these settings.
    """
    found = map_for(basis(spec, config))
    if found is None:
        return []
    box = zip(BOX_LOW, BOX_HIGH, strict=True)
    axes = [np.linspace(low, high, 1 + round((high - low) / FIELD_SPACING)) for low, high in box]
    z, y, x = np.meshgrid(*reversed(axes), indexing="ij")
    left = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    rest = np.broadcast_to(PALM_AT_REST @ MIRROR, left.shape)
    turns, n = np.full(len(left), TURNS.index(Turn.ANY)), len(left)
    carried = np.clip((config.loads.left, config.loads.right), 0.0, LOAD_KNOWN)
    pairs = Pairs(np.stack([left, rest], axis=1), turns, np.tile(carried, (n, 1)))
    mirrored = Pairs(pairs.points, turns, np.tile(carried[::-1], (n, 1))).mirrored()
    # A field of the right palm goes from the right to the left, as y does.
    return [found.rooms(pairs).reshape(x.shape), found.rooms(mirrored).reshape(x.shape)[:, ::-1]]


def box(side: int) -> tuple[float, ...]:
    """Where the field of the left (0) or right (1) palm is: x, y and z from and to [m]."""
    low, high = BOX_LOW.copy(), BOX_HIGH.copy()
    if side:
        low[1], high[1] = -BOX_HIGH[1], -BOX_LOW[1]
    return tuple(float(end) for axis in zip(low, high, strict=True) for end in axis)
