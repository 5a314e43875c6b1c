"""Temporal ensembling: what several chunks say about the same instant, averaged."""

from __future__ import annotations

import dataclasses

import numpy as np

from policy.chunk import ActionChunk
from policy.errors import ChunkError
from policy.geometry.se3 import make_transform
from policy.recorded.resample import resampled

DECAY_MAX = 10.0
"""Largest decay, either sign: beyond it all weight is on one chunk already."""
CHUNKS_MAX = 8
"""Most chunks that are averaged, the newest included."""
TAPER = 0.2
"""Time over which a chunk fades out before its last step, so that the average does not jump where it ends [s]."""
SPREAD_MAX = 0.1
"""Least size of the mean rotation matrix' second singular value: below it the rotations cancel out, as at 180 degrees
from each other, and have no mean."""


class TemporalEnsemble:
    """Averages each new chunk with those before it, at the same times.

    Weights are ACT's, ``w_i = exp(-decay i)`` with i = 0 for the oldest, but by chunk and not by control step, and
    faded out towards the end of a chunk. Positions and joints are averaged as numbers, rotations on SO(3): the rotation
    nearest to the weighted sum of the matrices.

    Args:
        decay: How much less a newer chunk counts; 0 counts all alike, negative favours the newest.

    Source:
        Zhao et al. 2023, "Learning Fine-Grained Bimanual Manipulation with Low-Cost Hardware" (0.01); the mean of
        rotations: Moakher 2002, "Means and Averaging in the Group of Rotations".
    """

    def __init__(self, decay: float = 0.01) -> None:
        if not abs(decay) <= DECAY_MAX:
            raise ValueError(f"decay is {decay}; a number from {-DECAY_MAX:g} to {DECAY_MAX:g} is expected")
        self.decay = float(decay)
        self.reset()

    def reset(self) -> None:
        """Forget every chunk."""
        self._chunks: list[ActionChunk] = []

    def add(self, chunk: ActionChunk) -> ActionChunk:
        """The average at the new chunk's times, with its number and time.

        Raises:
            ChunkError: If it is of another layout than the ones before.
        """
        if self._chunks and chunk.spec_id != self._chunks[-1].spec_id:
            raise ChunkError(f"a chunk of '{chunk.spec_id}' cannot be averaged with '{self._chunks[-1].spec_id}'")
        live = [old for old in self._chunks if old.times[-1] > chunk.t_obs]
        self._chunks = [*live, chunk][-CHUNKS_MAX:]
        if len(self._chunks) == 1:
            return chunk
        return _mean(self._chunks, self._weights(chunk.times))

    def drop_newest(self) -> None:
        """Take the last chunk back: it was refused."""
        self._chunks = self._chunks[:-1]

    def _weights(self, times: np.ndarray) -> np.ndarray:
        """Share of each chunk at each time, shape (chunks, H), columns sum to 1; the newest covers every time."""
        weights = np.exp(-self.decay * np.arange(len(self._chunks)))[:, None] * np.ones(len(times))
        for i, old in enumerate(self._chunks[:-1]):
            left = np.clip((old.times[-1] - times) / TAPER, 0.0, 1.0)
            # Minimum-jerk, so that position, velocity and acceleration of the average stay continuous.
            weights[i] *= left**3 * (10.0 - 15.0 * left + 6.0 * left**2)
        return weights / weights.sum(axis=0)


def _mean(chunks: list[ActionChunk], weights: np.ndarray) -> ActionChunk:
    newest = chunks[-1]
    grids = [resampled(chunk, newest.t_obs, len(newest), newest.fps).arrays() for chunk in chunks]
    arrays = {}
    for name, value in newest.arrays().items():
        if not all(name in grid for grid in grids):
            continue
        stack = np.stack([grid[name] for grid in grids])
        if value.ndim == 3:
            R = mean_rotation(stack[..., :3, :3], weights)
            arrays[name] = make_transform(R, np.einsum("ch,chi->hi", weights, stack[..., :3, 3]))
        else:
            arrays[name] = np.einsum("ch,ch...->h...", weights, stack)
    return dataclasses.replace(newest, **arrays)


def mean_rotation(R: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Weighted mean of rotations on SO(3).

    Args:
        R: Rotations, shape (n, H, 3, 3); the last of the n is the answer where they have no mean.
        weights: Shape (n, H), columns sum to 1.

    Returns:
        Shape (H, 3, 3), exactly orthonormal.
    """
    U, s, Vt = np.linalg.svd(np.einsum("nh,nhij->hij", weights, R))
    U[..., :, 2] *= np.linalg.det(U @ Vt)[..., None]
    mean = U @ Vt
    return np.where((s[..., 1] > SPREAD_MAX)[..., None, None], mean, R[-1])
