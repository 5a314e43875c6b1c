"""Where chunks meet in the commanded reference: how far it jumps, and what it will do next."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

from policy.chunk import ActionChunk
from policy.geometry.rotations import matrix_to_rotvec
from wholebody.execution.chunk_executor import ChunkExecutor


@dataclass(frozen=True)
class ChunkSeam:
    """Jump of the commanded palms where a chunk was taken over, the larger of both hands.

    Attributes:
        time: When [s].
        distance: |p(t+) - p(t-)| [m].
        angle: Angle between both orientations [rad].
        velocity: |v(t+) - v(t-)| [m/s].
        angular_velocity: |w(t+) - w(t-)| [rad/s].
    """

    time: float
    distance: float
    angle: float
    velocity: float
    angular_velocity: float


class SeamMeter:
    """Measures jumps in the commanded palm poses from nothing but the poses.

    Three poses before and three after a chunk is taken over are each taken as a parabola in time, and both parabolas
    are compared at that instant. Motion within the limits of the reference (400 m/s^3) shows as up to 0.003 mm and
    0.004 m/s.

    Args:
        dt: Control period [s].
    """

    def __init__(self, dt: float) -> None:
        self.dt = dt
        self.seams: list[ChunkSeam] = []
        self._past: deque[np.ndarray] = deque(maxlen=3)
        self._pending: list[tuple[float, list[np.ndarray]]] = []

    def add(self, poses: dict[str, np.ndarray]) -> None:
        """Palm poses commanded in this control period, 4x4, by side."""
        pose = np.stack([poses["left"], poses["right"]])
        self._past.append(pose)
        for time, samples in self._pending:
            samples.append(pose)
            if len(samples) == 6:
                self.seams.append(self._seam(time, samples))
        self._pending = [entry for entry in self._pending if len(entry[1]) < 6]

    def mark(self, time: float) -> None:
        """A chunk is taken over after the poses added last [s]; before any, there is nothing to compare with."""
        if self._past:
            first = [self._past[0]] * (3 - len(self._past))
            self._pending.append((time, [*first, *self._past]))

    def _seam(self, time: float, samples: list[np.ndarray]) -> ChunkSeam:
        x = np.stack([_offset(pose, samples[2]) for pose in samples])
        before = (3.0 * x[2] - 4.0 * x[1] + x[0]) / (2.0 * self.dt)
        after = (-5.0 * x[3] + 8.0 * x[4] - 3.0 * x[5]) / (2.0 * self.dt)
        jump, kick = 3.0 * x[3] - 3.0 * x[4] + x[5], after - before
        sizes = (np.linalg.norm(part, axis=1).max() for part in (jump[:, :3], jump[:, 3:], kick[:, :3], kick[:, 3:]))
        return ChunkSeam(time, *(float(size) for size in sizes))


def commanded_chunk(supervisor: ChunkExecutor, t_obs: float, steps: int, fps: float) -> ActionChunk | None:
    """Chunk that is commanded from a time on, slowed and bent as planned.

    Args:
        supervisor: After its last `step`.
        t_obs: Time of step 0 [s], near the present.
        steps: Number of steps; after the end of the plan its last pose is held.
        fps: Steps per second [Hz].

    Returns:
        None before the first chunk.
    """
    hands = supervisor.ahead(t_obs + np.arange(steps) / fps)
    if hands is None:
        return None
    (left, right), chunk = hands, supervisor.chunk
    poses = left.T_world_hand, right.T_world_hand
    given = (left, chunk.q_lhand), (right, chunk.q_rhand)
    fingers = [motion.q_finger[:, : q.shape[1]] for motion, q in given]
    return ActionChunk(chunk.spec_id, chunk.seq, t_obs, fps, *poses, *fingers)


def _offset(pose: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """Position and rotation vector of poses (2, 4, 4) against others, world axes, shape (2, 6)."""
    turn = matrix_to_rotvec(pose[:, :3, :3] @ np.swapaxes(reference[:, :3, :3], 1, 2))
    return np.hstack([pose[:, :3, 3] - reference[:, :3, 3], turn])
