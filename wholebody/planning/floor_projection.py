"""Targets in the floor: the hands are asked to stay above it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from policy.chunk import ActionChunk

CLEARANCE = 0.05
"""Least height of a hand over the floor [m]; chosen, no trial is on record."""
HAND_BOX = np.array([[x, y, z] for x in (-0.02, 0.22) for y in (-0.12, 0.12) for z in (-0.07, 0.07)])
"""Corners of a box around both hands' hulls in the axes of their wrists, fingers anywhere in their range [m]; derived
from the meshes of the URDF."""


def above_floor(chunk: ActionChunk, rise: float = 0.0) -> tuple[ActionChunk, float]:
    """The chunk with both hands lifted over the floor where it would have them in it, and by how much at most [m].

    Args:
        chunk: A valid chunk.
        rise: How high the floor is at most where hands come [m].
    """
    hands, most = [], 0.0
    for T in (chunk.T_world_lhand, chunk.T_world_rhand):
        lowest = T[:, 2, 3] + (T[:, 2, :3] @ HAND_BOX.T).min(axis=1)
        lift = np.maximum(CLEARANCE + rise - lowest, 0.0)
        most = max(most, float(lift.max()))
        T = T.copy()  # noqa: PLW2901
        T[:, 2, 3] += lift
        hands.append(T)
    return (chunk if most == 0.0 else replace(chunk, T_world_lhand=hands[0], T_world_rhand=hands[1])), most
