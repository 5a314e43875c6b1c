"""A chunk at other times."""

from __future__ import annotations

import dataclasses

import numpy as np

from policy.chunk import ActionChunk
from policy.geometry.se3 import bracket, interpolate


def resampled(chunk: ActionChunk, t_obs: float, steps: int, fps: float | None = None) -> ActionChunk:
    """Motion on another grid: straight in positions and joints, geodesic in rotations, held at both ends.

    Args:
        chunk: A valid chunk.
        t_obs: Time of the new step 0 [s].
        steps: Number of new steps.
        fps: Their rate; the chunk's own if None [Hz].
    """
    fps = chunk.fps if fps is None else fps
    at = t_obs + np.arange(steps) / fps
    arrays = {name: _values(value, chunk.times, at) for name, value in chunk.arrays().items()}
    return dataclasses.replace(chunk, t_obs=float(t_obs), fps=float(fps), **arrays)


def _values(values: np.ndarray, times: np.ndarray, at: np.ndarray) -> np.ndarray:
    if values.ndim == 3:
        return interpolate(values, times, at)
    if len(values) == 1:
        return np.repeat(values, len(at), axis=0)
    low, share = bracket(times, at)
    share = share.reshape(-1, *[1] * (values.ndim - 1))
    return values[low] + share * (values[low + 1] - values[low])
