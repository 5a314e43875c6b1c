"""The palm points of the hands, from the poses of their wrists."""

from __future__ import annotations

import numpy as np

from models.spec import RobotSpec


def palm_offsets(spec: RobotSpec) -> np.ndarray:
    """Palm points in the axes of the wrists, left first, shape (2, 3), [m]."""
    return np.array([tool.palm_offset for tool in spec.tools])


def palm_points(T_wrists: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """Palm points (..., 2, 3) [m] of wrists at poses (..., 2, 4, 4); with ``-offsets`` the wrists of palms."""
    return T_wrists[..., :3, 3] + np.einsum("...hij,hj->...hi", T_wrists[..., :3, :3], offsets)


def palm_poses(T_wrists: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """Poses at the palm points in the axes of the wrists, both (..., 2, 4, 4); with ``-offsets`` the way back."""
    T = T_wrists.copy()
    T[..., :3, 3] = palm_points(T_wrists, offsets)
    return T
