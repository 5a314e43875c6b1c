"""Everything that is done to a chunk before the body is planned: out of the floor, without noise, within the limits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from policy.chunk import ActionChunk
from policy.geometry.rotations import matrix_to_rotvec, quaternion_to_matrix
from wholebody.config import START_MAX
from wholebody.planning.floor_projection import above_floor
from wholebody.planning.limit_projection import JUMP, continued
from wholebody.planning.smoothing import smoothed_chunk
from wholebody.reference import HandLimits, HandMotion, HandPath, time_scaled

JOIN_SHARE = 0.6
"""Share of the usual speed, acceleration and jerk with which a chunk is joined that begins elsewhere: it does not
say how to get there."""


@dataclass(frozen=True)
class PreparedChunk:
    """A chunk that the hands can be led along.

    Attributes:
        chunk: With the hands out of the floor and without noise.
        limits: Of the left and the right hand.
        lift: How far a hand was lifted out of the floor at each step, shape (H,), [m].
        smoothed: Names of the parts of the chunk that scattered and were smoothed.
        moved: Largest distance by which smoothing moved a hand [m].
    """

    chunk: ActionChunk
    limits: tuple[HandLimits, ...]
    lift: np.ndarray
    smoothed: tuple[str, ...]
    moved: float

    @property
    def implausible(self) -> bool:
        """Whether its scatter is wider than any motion: what it means is a guess."""
        return self.moved > JUMP

    def lift_at(self, s: np.ndarray) -> np.ndarray:
        """The lift of the step nearest to each of these parameters [s]; past the end that of the last one."""
        steps = np.round(s * self.chunk.fps).astype(int)
        return self.lift[np.clip(steps, 0, len(self.chunk) - 1)]

    def begins_elsewhere(self, now: float, commanded: HandMotion) -> bool:
        """Whether a hand would have to jump to where the chunk has it now."""
        chunk = self.chunk
        step = int(np.clip(round((now - chunk.t_obs) * chunk.fps), 0, len(chunk) - 1))
        T = np.stack([chunk.T_world_lhand[step], chunk.T_world_rhand[step]])
        distance = np.linalg.norm(T[:, :3, 3] - commanded.p, axis=1)
        turn = matrix_to_rotvec(np.swapaxes(quaternion_to_matrix(commanded.quat, "xyzw"), 1, 2) @ T[:, :3, :3])
        return bool(distance.max() > START_MAX[0] or np.linalg.norm(turn, axis=1).max() > START_MAX[1])

    def paths(self, now: float, commanded: HandMotion, slowdown: float) -> tuple[tuple[HandPath, ...], float]:
        """Paths of both hands that go on from their present motion, and how far steps were moved to keep the limits.

        The limit projection depends on the speed: a chunk followed slower begins with more motion per path parameter.

        Args:
            now: Time [s].
            commanded: What the two hands are commanded to do now, rows (2, 40).
            slowdown: Factor by which the chunk is followed slower.

        Returns:
            The paths, and the largest distance [m] between the chunk's steps and those that the paths go through.
        """
        chunk = self.chunk
        share = JOIN_SHARE if self.begins_elsewhere(now, commanded) else 1.0
        sources = ((chunk.T_world_lhand, chunk.q_lhand), (chunk.T_world_rhand, chunk.q_rhand))
        times, paths, projected = np.arange(len(chunk)) / chunk.fps, [], 0.0
        for (T, q), limits, row in zip(sources, self.limits, commanded.rows, strict=True):
            motion = time_scaled(HandMotion(row.copy()), slowdown, 0.0)
            path, moved = _joined(times, T, q, limits, share, motion, now - chunk.t_obs)
            paths.append(path)
            projected = max(projected, moved)
        return tuple(paths), projected


def prepare(chunk: ActionChunk, limits: tuple[HandLimits, ...]) -> PreparedChunk:
    """Lift the hands of a valid chunk out of the floor, then smooth what scatters.

    Args:
        chunk: A valid chunk.
        limits: Of the left and the right hand.
    """
    lifted, _ = above_floor(chunk)
    smooth, names = smoothed_chunk(lifted, limits)
    pairs = ((lifted.T_world_lhand, smooth.T_world_lhand), (lifted.T_world_rhand, smooth.T_world_rhand))
    moved = max(float(np.linalg.norm(a[:, :3, 3] - b[:, :3, 3], axis=1).max()) for a, b in pairs)
    pairs = ((chunk.T_world_lhand, lifted.T_world_lhand), (chunk.T_world_rhand, lifted.T_world_rhand))
    lift = np.max([after[:, 2, 3] - before[:, 2, 3] for before, after in pairs], axis=0)
    return PreparedChunk(smooth, limits, lift, names, moved)


def _joined(
    times: np.ndarray, T: np.ndarray, q: np.ndarray, limits: HandLimits, share: float, motion: HandMotion, s: float
) -> tuple[HandPath, float]:
    """The path through a chunk's steps that goes on from a motion at ``s``, and how far steps were moved at most [m].

    Steps that no hand could follow are replaced by the nearest that one can. Both keep that share of the limits.
    """
    slow = limits.scaled(share)
    path = HandPath.from_knots(times, T, q, limits=limits).joined(motion, s, limits=slow)
    if len(times) < 2:
        return path, 0.0
    projected = continued(times, T, q, slow, motion, s)
    if not (path.join.rough or projected.changed):
        return path, 0.0
    path = HandPath.from_knots(projected.times, projected.T, projected.q, limits=limits).joined(motion, s, limits=slow)
    return path, projected.moved
