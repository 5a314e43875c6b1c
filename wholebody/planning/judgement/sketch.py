"""Many chunks at once, roughly: how far palms stay from where each asks them to be, all in one call of the kernels.

Each chunk is a row of configurations a fifth of a second apart, found by inverse kinematics from row to row within the
bounds of a configuration, distances aside. It takes half a millisecond a chunk, and is no plan: what it says is how
likely one is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple, replace
from itertools import batched

import numpy as np

from policy.chunk import ActionChunk
from policy.geometry.rotations import angle_between, matrix_to_rotvec
from wholebody.planning.chunk_planner import ChunkPlanner
from wholebody.planning.judgement.chunk_judge import Begin
from wholebody.planning.judgement.limits import Limit
from wholebody.planning.limit_projection import DEMAND
from wholebody.planning.reachability.pairs import BOX_HIGH, BOX_LOW, LOAD_KNOWN, MIRROR, TURNS, Pairs, Turn
from wholebody.planning.reachability.reach_map import ODDS_SURE, ReachabilityMap
from wholebody.robot.palms import palm_points, palm_poses
from wholebody.trajopt.problem import TrajectoryProblem

ROW_SPACING = 0.2
"""Time from one row to the next [s]; chosen: three knots of a plan."""
PASSES = 2
"""Steps of inverse kinematics at a row [no unit]; measured: palms of what can be done are within millimetres then."""
CHUNKS_AT_ONCE = 16
"""Chunks of one call [no unit]; chosen: 20 MB of memory, and rows enough that calls take no time."""
JOIN_SPEED, JOIN_TIME = 1.0, 0.2
"""Speed [m/s] and time [s] with which hands that are elsewhere are thought to join a chunk; chosen: as plans do."""
MAPPED = 5
"""Steps of a chunk that the map is asked for [no unit]; chosen: palms go half a metre in a chunk."""
KINDS = (
    Limit.REACH, Limit.ORIENTATION, Limit.HAND_SPEED, Limit.HAND_ACCELERATION, Limit.HAND_JERK, Limit.TURN_SPEED,
    Limit.TURN_ACCELERATION, Limit.TURN_JERK,
)  # fmt: skip
"""What a sketch tells of a chunk, in this order, each in terms of the most that is done as given."""


class Sketches:
    """Sketches of chunks that begin alike.

    Args:
        planner: Holds robot, bounds, loads and where the feet stand.
        moved, turned: How far a palm may be off, and turned away [m], [rad].
    """

    def __init__(self, planner: ChunkPlanner, moved: float, turned: float) -> None:
        self._planner, self._scale = planner, (moved, turned)
        self._kept: tuple[tuple, TrajectoryProblem] | None = None

    def of(self, chunks: Sequence[ActionChunk], begin: Begin, free: tuple[bool, bool]) -> np.ndarray:
        """What each chunk lacks, shape (n, len(`KINDS`)), whatever the other chunks are.

        Args:
            chunks: Valid ones, in any number, of any lengths.
            begin: Where each is begun, with its first step.
            free: Whether the orientation of the left and of the right palm is free.
        """
        out, alike = np.zeros((len(chunks), len(KINDS))), {}
        for i, chunk in enumerate(chunks):
            alike.setdefault((chunk.fps, len(chunk)), []).append(i)
        for numbers in alike.values():
            for some in batched(numbers, CHUNKS_AT_ONCE):
                out[list(some)] = self._of_alike([chunks[i] for i in some], begin, free)
        return out

    def _of_alike(self, chunks: Sequence[ActionChunk], begin: Begin, free: tuple[bool, bool]) -> np.ndarray:
        """Sketches of at most `CHUNKS_AT_ONCE` chunks of as many steps at one rate."""
        planner, n, H, fps = self._planner, len(chunks), len(chunks[0]), chunks[0].fps
        T = np.stack([np.stack([one.T_world_lhand, one.T_world_rhand], axis=1) for one in chunks])
        T, stride = palm_poses(T, planner.offsets), max(round(ROW_SPACING * fps), 1)
        steps = np.unique(np.append(np.arange(stride, H, stride), H - 1))
        rows, body = 1 + len(steps), planner.optimizer.body
        begins, wanted, joined = self._asked(T, steps, fps, begin)
        problem = self._problem(len(begins), stride / fps)
        problem.enforced[:] = 1.0
        fingers = np.tile(begin.body.q[body.fingers], (len(begins), 1))
        problem.begin(wanted, fingers, np.zeros_like(body.rates_of(begin.body.v)))
        problem.now.q[:] = body.body_of(begin.body.q)
        problem.set_weights(planner.config.posture, 1.0)
        problem.follow_rows(begins, PASSES)
        own = slice(1, 1 + n * rows)
        palms, wanted, counts = problem.palms()[own], wanted[own], joined[own, None]
        off = counts * np.linalg.norm(palms[:, :, :3, 3] - wanted[:, :, :3, 3], axis=2) / self._scale[0]
        turned = counts * angle_between(palms[:, :, :3, :3], wanted[:, :, :3, :3]) / self._scale[1]
        turned[:, list(free)] = 0.0
        worst = [values.reshape(n, -1).max(axis=1) for values in (off, turned)]
        return np.stack([*worst, *self._rates(T, fps)], axis=1)

    def _asked(self, T: np.ndarray, steps: np.ndarray, fps: float, begin: Begin) -> tuple[np.ndarray, ...]:
        """Rows that begin a motion (K,), palms of each (K, 2, 4, 4), and whether the palms have to be there (K,).

        One row more leads the first motion in, so that all are alike; what is left of `CHUNKS_AT_ONCE` motions rests.
        """
        rows = 1 + len(steps)
        K = 1 + CHUNKS_AT_ONCE * rows
        begins, joined = np.ones(K, dtype=bool), np.zeros(K, dtype=bool)
        at = palm_poses(begin.hands.T_world_hand, self._planner.offsets)
        wanted = np.tile(at, (K, 1, 1, 1))
        for i, poses in enumerate(T):
            row = slice(2 + i * rows, 1 + (i + 1) * rows)
            begins[row], wanted[row] = False, poses[steps]
            away = at[:, :3, 3] - poses[0, :, :3, 3]
            time = np.linalg.norm(away, axis=1).max() / JOIN_SPEED + JOIN_TIME
            left = np.maximum(1.0 - steps / fps / time, 0.0)
            wanted[row, :, :3, 3] += left[:, None, None] * away
            joined[row] = left == 0.0
        return begins, wanted, joined

    def _rates(self, T: np.ndarray, fps: float) -> list[np.ndarray]:
        """Speed, acceleration, jerk of palm poses (n, H, 2, 4, 4), then of their turns, in terms of the bounds."""
        limits, out = self._planner.hand_limits[0], []
        turns = matrix_to_rotvec(np.swapaxes(T[:, :-1, :, :3, :3], -1, -2) @ T[:, 1:, :, :3, :3])
        for steps, bounds in ((np.diff(T[..., :3, 3], axis=1), limits.position), (turns, limits.orientation)):
            for order, (share, bound) in enumerate(zip(DEMAND, astuple(bounds), strict=True)):
                values = np.abs(np.diff(steps, order, axis=1)).reshape(len(T), -1)
                out.append(values.max(axis=1, initial=0.0) * fps ** (order + 1) / (share * bound))
        return out

    def _problem(self, K: int, dt: float) -> TrajectoryProblem:
        """Memory for so many rows, kept for the next time."""
        planner = self._planner
        key = K, dt, len(planner.optimizer.body.tables.normals)
        if self._kept is None or self._kept[0] != key:
            posture = replace(planner.config.posture, dt=dt)
            self._kept = key, TrajectoryProblem(planner.optimizer.body, posture, K)
        return self._kept[1]


def rooms(
    known: ReachabilityMap, chunks: Sequence[ActionChunk], offsets: np.ndarray, loads: Sequence[float]
) -> np.ndarray:
    """The least room that a map has for the palms of each chunk at `MAPPED` steps, however turned, shape (n,).

    Args:
        known: The map.
        chunks: Valid ones.
        offsets: Palm points in the axes of the wrists, shape (2, 3), [m].
        loads: Masses in the left and right hand [kg].

    Returns:
        Logarithms of odds, `ODDS_SURE` at most; of palms outside the box that it knows, those where they leave it.
    """
    T = np.empty((len(chunks), MAPPED, 2, 4, 4))
    for one, chunk in zip(T, chunks, strict=True):
        steps = np.linspace(0, len(chunk) - 1, MAPPED).round().astype(int)
        one[:, 0], one[:, 1] = chunk.T_world_lhand[steps], chunk.T_world_rhand[steps]
    points = palm_points(T, offsets).reshape(-1, 2, 3)
    for side, mirror in enumerate((np.eye(3), MIRROR)):
        points[:, side] = np.clip(points[:, side] @ mirror, BOX_LOW, BOX_HIGH) @ mirror
    n = len(points)
    carried = np.tile(np.minimum(loads, LOAD_KNOWN), (n, 1))
    pairs = Pairs(points, np.full(n, TURNS.index(Turn.ANY)), carried)
    return np.minimum(known.rooms(pairs), ODDS_SURE).reshape(len(chunks), MAPPED).min(axis=1)
