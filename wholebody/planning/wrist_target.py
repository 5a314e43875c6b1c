"""Poses of the wrists that a posture is asked for, checked."""

from __future__ import annotations

import numpy as np

from policy.geometry.rotations import nearest_rotation, rotation_residual
from wholebody.errors import InputError

ROTATION_RESIDUAL_MAX = 1e-3
"""Largest `rotation_residual` of a target, whose nearest rotation counts [no unit]; chosen: above float32 rounding."""
LAST_ROW = (0.0, 0.0, 0.0, 1.0)
"""Of every rigid transform; definition."""


def wrist_target(T: np.ndarray, name: str) -> np.ndarray:
    """A pose (4, 4) with its nearest rotation.

    Raises:
        InputError: If it is no rigid transform; says what of it is wrong.
    """
    try:
        T = np.array(T, dtype=float)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} is a {type(T).__name__}, not numbers; give a pose (4, 4) of a wrist") from error
    if T.shape != (4, 4):
        raise InputError(f"{name} has shape {T.shape}; give a pose (4, 4) of a wrist in world")
    if not np.isfinite(T).all():
        row, column = np.argwhere(~np.isfinite(T))[0].tolist()
        raise InputError(f"{name}[{row}, {column}] is {T[row, column]}; give a finite pose (4, 4) of a wrist in world")
    if not np.allclose(T[3], LAST_ROW, atol=1e-9):
        raise InputError(f"{name} is no rigid transform: its last row is {T[3].tolist()}; [0, 0, 0, 1] is expected")
    residual = float(rotation_residual(T[:3, :3]))
    if not residual <= ROTATION_RESIDUAL_MAX:
        raise InputError(
            f"{name} is no rigid transform: its rotation {name}[:3, :3] is off by {residual:.2g}, at most "
            f"{ROTATION_RESIDUAL_MAX:g} is expected; give orthonormal columns that are right-handed (determinant 1)"
        )
    T[:3, :3] = nearest_rotation(T[:3, :3])
    return T
