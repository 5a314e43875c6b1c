"""What a target may say: wrist poses, fingers, and the forces that palms are to meet."""

from __future__ import annotations

import numpy as np

from policy.chunk import MAGNITUDE_MAX, ActionChunk
from policy.errors import ChunkError
from policy.geometry.rotations import rotation_residual

SHAPES = {
    "lhand": (4, 4), "rhand": (4, 4), "q_lhand": (7,), "q_rhand": (7,), "f_lpalm": (3,), "f_rpalm": (3,),
}  # fmt: skip
"""Parts of a target by name: wrist poses in world, fingers in motor order [rad], and the forces that the world is
expected to put on the palms, in world axes [N]."""
FORCES = ("f_lpalm", "f_rpalm")
"""Parts that are forces."""
ROTATION_TOLERANCE = 1e-3
"""Largest residual of a target's rotation; chosen: above float32 rounding, below any real fault."""
SAME = {"lhand": 1e-3, "rhand": 1e-3, "q_lhand": 0.02, "q_rhand": 0.02, "f_lpalm": 0.5, "f_rpalm": 0.5}
"""Difference up to which a part says nothing new: position [m], finger [rad], force [N]; chosen: a fifth of what
streams are followed to, and of what a press is off."""
SAME_TURN = 0.01
"""The same of an orientation [rad]."""


def rows_of(chunk: ActionChunk) -> dict[str, np.ndarray]:
    """Parts of a target at each step of a chunk, by name, (H, ...); no force is a force of 0."""
    none = np.zeros((len(chunk), 3))
    forces = (none if force is None else force for force in (chunk.f_world_lpalm, chunk.f_world_rpalm))
    rows = (chunk.T_world_lhand, chunk.T_world_rhand, chunk.q_lhand, chunk.q_rhand, *forces)
    return dict(zip(SHAPES, rows, strict=True))


def checked(name: str, value: np.ndarray) -> np.ndarray:
    """A part of a target as an array.

    Raises:
        ChunkError: With its name.
    """
    if name not in SHAPES:
        raise ChunkError(f"a target has no '{name}'; it may say {', '.join(SHAPES)}", slot=name)
    value, shape = np.array(value, dtype=float), SHAPES[name]
    if value.shape != shape:
        raise ChunkError(f"{name} has shape {value.shape}; {shape} is expected", slot=name)
    bad = ~(np.abs(value) <= MAGNITUDE_MAX)
    if bad.any():
        index = [int(i) for i in np.argwhere(bad)[0]]
        raise ChunkError(f"{name} is {value[tuple(index)]} at {index}; finite numbers are expected", slot=name)
    if len(shape) == 2 and not rotation_residual(value[:3, :3]) <= ROTATION_TOLERANCE:
        residual = float(rotation_residual(value[:3, :3]))
        raise ChunkError(f"{name} has no rotation: residual {residual:.2g}, at most {ROTATION_TOLERANCE}", slot=name)
    return value


def differs(name: str, rows: np.ndarray, step: float, value: np.ndarray) -> bool:
    """Whether rows (H, ...) of a part are elsewhere at a step, a fraction of one too; before the first they are there.

    Args:
        name: Of the part.
        rows: A chunk's.
        step: Of the chunk.
        value: What is compared.
    """
    step = min(max(step, 0.0), len(rows) - 1.0)
    k = min(int(step), len(rows) - 2)
    off = rows[k] + (step - k) * (rows[k + 1] - rows[k]) - value
    if value.ndim == 1:
        return bool(np.abs(off).max() > SAME[name])
    # Of two rotations that are near, the angle is the size of their difference over the root of two.
    return bool(np.linalg.norm(off[:3, 3]) > SAME[name] or np.linalg.norm(off[:3, :3]) > np.sqrt(2.0) * SAME_TURN)
