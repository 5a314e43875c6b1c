"""Everything that is done to a chunk before the body is planned: out of the floor, without noise, within the limits."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from policy.chunk import ActionChunk
from policy.geometry.rotations import angle_between, matrix_to_rotvec, quaternion_to_matrix
from wholebody.config import START_MAX
from wholebody.planning.floor_projection import above_floor
from wholebody.planning.limit_projection import JUMP, continued
from wholebody.planning.smoothing import smoothed_chunk
from wholebody.reference import HandLimits, HandMotion, HandPath, time_scaled
from wholebody.robot.touch import LEAN_MAX, tipping_share
from wholebody.trajopt.kernels.dynamics_rows import PUSHED_MORE
from wholebody.trajopt.robot_tables import RobotTables

JOIN_SHARE = 0.6
"""Share of the usual speed, acceleration and jerk with which a chunk is joined that begins elsewhere; chosen: it does
not say how to get there."""


@dataclass(frozen=True)
class PreparedChunk:
    """A chunk that the hands can be led along.

    Attributes:
        chunk: With the fingers in their range, the hands out of the floor and without noise.
        limits: Of the left and the right hand.
        lift: How far a hand was lifted out of the floor at each step, shape (H,), [m].
        smoothed: Names of the parts of the chunk that scattered and were smoothed.
        moved: How far smoothing moved a hand at each step, shape (H,), [m].
        turned: How far it turned a hand, or moved a finger, shape (H,), [rad].
    """

    chunk: ActionChunk
    limits: tuple[HandLimits, ...]
    lift: np.ndarray
    smoothed: tuple[str, ...]
    moved: np.ndarray
    turned: np.ndarray

    @property
    def times(self) -> np.ndarray:
        """Path parameters of the steps, shape (H,), [s]."""
        return np.arange(len(self.chunk)) / self.chunk.fps

    @property
    def implausible(self) -> bool:
        """Whether its scatter is wider than any motion: what it means is a guess."""
        return bool(self.moved.max() > JUMP)

    def distance_at(self, now: float, commanded: HandMotion) -> float:
        """How far the farther hand is from where the chunk has it now, between two of its steps [m]."""
        chunk, s = self.chunk, now - self.chunk.t_obs
        hands = zip((chunk.T_world_lhand, chunk.T_world_rhand), commanded.p, strict=True)
        asked = [[np.interp(s, self.times, T[:, i, 3]) - p[i] for i in range(3)] for T, p in hands]
        return float(np.linalg.norm(asked, axis=1).max())

    def begins_elsewhere(self, now: float, commanded: HandMotion) -> bool:
        """Whether a hand would have to jump to where the chunk has it now."""
        chunk = self.chunk
        step = int(np.clip(round((now - chunk.t_obs) * chunk.fps), 0, len(chunk) - 1))
        T = np.stack([chunk.T_world_lhand[step], chunk.T_world_rhand[step]])
        distance = np.linalg.norm(T[:, :3, 3] - commanded.p, axis=1)
        turn = matrix_to_rotvec(np.swapaxes(quaternion_to_matrix(commanded.quat, "xyzw"), 1, 2) @ T[:, :3, :3])
        return bool(distance.max() > START_MAX[0] or np.linalg.norm(turn, axis=1).max() > START_MAX[1])

    def pushes(self, steps: np.ndarray, palms: np.ndarray, body: RobotTables) -> np.ndarray:
        """Forces on the left and the right palm that plans are to count on at K parameters [s], shape (K, 6), [N].

        They are those that the chunk tells, as far as a body can be leant against them. Past its end hands stay where
        they are, and what they touch does.

        Args:
            steps: The parameters, shape (K,), [s].
            palms: Where the chunk has the palms then, shape (K, 2, 3), [m].
            body: The robot.
        """
        chunk, tables = self.chunk, body.tables
        told = [np.zeros((len(chunk), 3)) if f is None else f for f in (chunk.f_world_lpalm, chunk.f_world_rpalm)]
        pushes = np.stack([np.interp(steps, self.times, force) for force in np.hstack(told).T], axis=1)
        com, weight = tables.com_stance, -tables.gravity[2] * tables.mass
        for k in np.flatnonzero(pushes.any(axis=1)):
            offsets, force = tables.zmp_offsets + LEAN_MAX, pushes[k].reshape(2, 3)
            most = tipping_share(force, palms[k], com, weight, tables.normals, offsets) / (1.0 + PUSHED_MORE)
            pushes[k] *= min(most, 1.0)
        return pushes

    def paths(self, now: float, commanded: HandMotion, slowdown: float) -> tuple[tuple[HandPath, ...], np.ndarray]:
        """Paths of both hands that go on from their present motion, and how far steps were moved to keep the limits.

        The limit projection depends on the speed: a chunk followed slower begins with more motion per path parameter.

        Args:
            now: Time [s].
            commanded: What the two hands are commanded to do now, rows (2, 40).
            slowdown: Factor by which the chunk is followed slower.

        Returns:
            The paths, and how far the steps that they go through are from the chunk's, shape (H,), [m].
        """
        chunk = self.chunk
        share = JOIN_SHARE if self.begins_elsewhere(now, commanded) else 1.0
        sources = ((chunk.T_world_lhand, chunk.q_lhand), (chunk.T_world_rhand, chunk.q_rhand))
        paths, projected = [], np.zeros(len(chunk))
        for (T, q), limits, row in zip(sources, self.limits, commanded.rows, strict=True):
            motion = time_scaled(HandMotion(row.copy()), slowdown, 0.0)
            path, moved = _joined(self.times, T, q, limits, share, motion, now - chunk.t_obs)
            paths.append(path)
            projected = np.maximum(projected, moved)
        return tuple(paths), projected


def prepare(chunk: ActionChunk, limits: tuple[HandLimits, ...], rise: float = 0.0) -> PreparedChunk:
    """Bring the fingers of a valid chunk into their range, lift its hands out of the floor, smooth what scatters.

    Args:
        chunk: A valid chunk.
        limits: Of the left and the right hand.
        rise: How high the floor is at most where hands come [m].
    """
    lifted, _ = above_floor(within_range(chunk, limits), rise)
    smooth, names = smoothed_chunk(lifted, limits)
    lift, (moved, turned) = _off(chunk, lifted)[0], _off(lifted, smooth)
    return PreparedChunk(smooth, limits, lift, names, moved, turned)


def within_range(chunk: ActionChunk, limits: tuple[HandLimits, ...]) -> ActionChunk:
    """The chunk with its fingers at the ends of their range where it asks them past these."""
    left, right = (limit.within(q) for q, limit in zip((chunk.q_lhand, chunk.q_rhand), limits, strict=True))
    return replace(chunk, q_lhand=left, q_rhand=right)


def most_near(times: np.ndarray, values: np.ndarray, knots: np.ndarray) -> np.ndarray:
    """The largest of the values (H,) at the times nearest to each of K evenly spaced knots; past the last time its."""
    most = np.interp(knots, times, values)
    spacing = knots[1] - knots[0] if len(knots) > 1 else np.inf
    k = np.round((times - knots[0]) / spacing).astype(int)
    inside = (k >= 0) & (k < len(knots))
    np.maximum.at(most, k[inside], values[inside])
    return most


def _off(these: ActionChunk, those: ActionChunk) -> tuple[np.ndarray, np.ndarray]:
    """How far the hands of two chunks are apart at each step [m], and how far turned, or a finger moved [rad], (H,)."""
    if these is those:
        return np.zeros(len(these)), np.zeros(len(these))
    pairs = ((these.T_world_lhand, those.T_world_lhand), (these.T_world_rhand, those.T_world_rhand))
    distances = [np.linalg.norm(a[:, :3, 3] - b[:, :3, 3], axis=1) for a, b in pairs]
    angles = [angle_between(a[:, :3, :3], b[:, :3, :3]) for a, b in pairs]
    fingers = [
        np.abs(a - b).max(axis=1, initial=0.0)
        for a, b in ((these.q_lhand, those.q_lhand), (these.q_rhand, those.q_rhand))
    ]
    return np.max(distances, axis=0), np.max(angles + fingers, axis=0)


def _joined(
    times: np.ndarray, T: np.ndarray, q: np.ndarray, limits: HandLimits, share: float, motion: HandMotion, s: float
) -> tuple[HandPath, np.ndarray]:
    """The path through a chunk's steps that goes on from a motion at ``s``, and how far each step was moved (H,) [m].

    Steps that no hand could follow are replaced by the nearest that one can. Both keep that share of the limits.
    """
    slow, moved = limits if share == 1.0 else limits.scaled(share), np.zeros(len(times))
    projected = continued(times, T, q, slow, motion, s) if len(times) > 1 else None
    if projected is None or not projected.changed:
        path = HandPath.through(times, T, q, limits).joined(motion, s, limits=slow)
        if projected is None or not path.join.rough:
            return path, moved
    path = HandPath.through(projected.times, projected.T, projected.q, limits).joined(motion, s, limits=slow)
    moved[len(times) - len(projected.moved) :] = projected.moved
    return path, moved
