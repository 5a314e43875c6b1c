"""Surfaces that hands have met: plans do not lead them further in."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from policy.chunk import ActionChunk
from policy.geometry.se3 import translated


@dataclass(frozen=True)
class Surface:
    """A plane that a palm is not to pass.

    Attributes:
        point: On it, in world, shape (3,), [m].
        into: Unit vector into what was met, shape (3,).
    """

    point: np.ndarray
    into: np.ndarray


def kept_out(chunk: ActionChunk, surfaces: Sequence[Surface | None], palm_offsets: np.ndarray) -> ActionChunk:
    """The chunk with its palms brought back to the surfaces that they would pass; what is along a surface stays.

    Args:
        chunk: A valid chunk.
        surfaces: Of the left and the right hand; None: nothing is in its way.
        palm_offsets: Palm points in the frames of the wrists, shape (2, 3), [m].
    """
    poses = []
    for given, surface, offset in zip((chunk.T_world_lhand, chunk.T_world_rhand), surfaces, palm_offsets, strict=True):
        T = given
        if surface is not None:
            palms = translated(T, offset)[:, :3, 3]
            beyond = np.maximum((palms - surface.point) @ surface.into, 0.0)
            T = T.copy()
            T[:, :3, 3] -= beyond[:, None] * surface.into
        poses.append(T)
    return replace(chunk, T_world_lhand=poses[0], T_world_rhand=poses[1])


def turned(into: np.ndarray, push: np.ndarray, keep: float) -> np.ndarray:
    """Direction (3,) turned towards that of a push (3,), of which it keeps a share; nothing was known if it is zero."""
    if (size := float(np.linalg.norm(push))) == 0.0:
        return into
    keep = keep if into.any() else 0.0
    mixed = keep * into + (1.0 - keep) * push / size
    # A push that turns round at once leaves no direction: then the one before stays.
    length = float(np.linalg.norm(mixed))
    return mixed / length if length > 0.0 else into
