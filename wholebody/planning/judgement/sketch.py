"""Many chunks at once, roughly: how far palms stay from where each asks them to be, all in one call of the kernels.

Each chunk is a row of configurations a fifth of a second apart, found by inverse kinematics from row to row within the
bounds of a configuration, distances aside; at some of them bodies are then kept apart, too. It takes a millisecond a
chunk, and is no plan: what it says is how likely one is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple, dataclass, replace
from itertools import batched

import numpy as np

from policy.chunk import ActionChunk
from policy.geometry.rotations import angle_between, matrix_to_rotvec
from wholebody.config import TrajectoryConfig
from wholebody.planning.chunk_planner import ChunkPlanner
from wholebody.planning.judgement.chunk_judge import Begin
from wholebody.planning.judgement.limits import Limit
from wholebody.planning.limit_projection import DEMAND
from wholebody.planning.reachability.pairs import BOX_HIGH, BOX_LOW, LOAD_KNOWN, MIRROR, TURNS, Pairs, Turn
from wholebody.planning.reachability.reach_map import ODDS_SURE, ReachabilityMap
from wholebody.robot.palms import palm_points, palm_poses
from wholebody.trajopt.layout import COM_EDGE
from wholebody.trajopt.problem import TrajectoryProblem
from wholebody.trajopt.weights import tolerances

ROW_SPACING = 0.2
"""Time from one row to the next [s]; chosen: three knots of a plan."""
PASSES, APART = 3, 2
"""Steps of inverse kinematics at a row, and after those at one where bodies are kept apart, too [no unit]; measured:
with 2 steps 0.91 of pairs of an infeasible chunk and another one are in their order, with 3 and 2 it is 0.99."""
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


@dataclass(frozen=True)
class Reached:
    """Palms as chunks ask for them, and as near to that as the robot gets; n chunks, r rows.

    Attributes:
        steps: Which step of a chunk each row is, shape (r,).
        joined: Whether hands that begin elsewhere are thought to have joined by then, shape (n, r).
        wanted, palms: Poses of the palm points in world, shape (n, r, 2, 4, 4).
        excess: Over the bounds of a configuration, in the order of `wholebody.trajopt.layout` up to the edges of the
            support and in terms of their tolerances, positive where one is exceeded for the palms, shape (n, r, m).
    """

    steps: np.ndarray
    joined: np.ndarray
    wanted: np.ndarray
    palms: np.ndarray
    excess: np.ndarray

    def off(self, free: tuple[bool, bool]) -> tuple[np.ndarray, np.ndarray]:
        """How far palms stay off [m] and turned away [rad], shapes (n, r, 2); 0 before they have joined."""
        away = self.joined[..., None] * np.linalg.norm(self.palms[..., :3, 3] - self.wanted[..., :3, 3], axis=-1)
        turned = self.joined[..., None] * angle_between(self.palms[..., :3, :3], self.wanted[..., :3, :3])
        turned[..., list(free)] = 0.0
        return away, turned


class Sketches:
    """Sketches of chunks that begin alike.

    Args:
        planner: Holds robot, bounds, loads and where the feet stand.
        moved, turned: How far a palm may be off, and turned away [m], [rad].
        posture: What inverse kinematics weigh; as plans that turn palms first, if not given.
    """

    def __init__(
        self, planner: ChunkPlanner, moved: float, turned: float, posture: TrajectoryConfig | None = None
    ) -> None:
        self._planner, self._scale = planner, (moved, turned)
        # Palms turn sooner than they are moved, as in plans of what cannot be done as given.
        relaxed = replace(planner.config.posture, orientation=planner.config.orientation_relaxed)
        self._posture = posture or relaxed
        self._kept: dict[bool, tuple[tuple, TrajectoryProblem]] = {}

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
        for (fps, _), numbers in alike.items():
            for some in batched(numbers, CHUNKS_AT_ONCE):
                T = np.stack([np.stack([chunks[i].T_world_lhand, chunks[i].T_world_rhand], axis=1) for i in some])
                T = palm_poses(T, self._planner.offsets)
                away, turned = self.reached(T, fps, begin).off(free)
                worst = [values.reshape(len(some), -1).max(axis=1) for values in (away, turned)]
                lacks = [value / most for value, most in zip(worst, self._scale, strict=True)]
                out[list(some)] = np.stack([*lacks, *self._rates(T, fps)], axis=1)
        return out

    def reached(self, T_palms: np.ndarray, fps: float, begin: Begin, every: float | None = None) -> Reached:
        """Where the robot gets with its palms, at the middle and the last row, or at all rows some time apart.

        Args:
            T_palms: Poses of the palm points in world that chunks ask for, at most `CHUNKS_AT_ONCE` of them, shape
                (n, H, 2, 4, 4).
            fps: Steps a second [Hz].
            begin: Where each chunk is begun, with its first step.
            every: Time from one row to the next [s]; `ROW_SPACING`, and two rows are told of, if not given.
        """
        (n, H), stride = T_palms.shape[:2], max(round((every or ROW_SPACING) * fps), 1)
        steps = np.unique(np.append(np.arange(stride, H, stride), H - 1))
        begins, wanted, joined = self._asked(T_palms, steps, fps, begin)
        problem = self._problem(len(begins), stride / fps, first=True)
        self._begin(problem, wanted, begin)
        problem.now.q[:] = self._planner.optimizer.body.body_of(begin.body.q)
        problem.follow_rows(begins, PASSES)
        rows = np.arange(len(steps)) if every else np.unique([len(steps) // 2, len(steps) - 1])
        chosen = (2 + np.arange(n)[:, None] * (1 + len(steps)) + rows).ravel()
        near = self._problem(len(chosen), stride / fps, first=False)
        self._begin(near, wanted[chosen], begin)
        near.now.q[:] = problem.now.q[chosen]
        for _ in range(APART):
            near.evaluate_still()
            for k in range(len(chosen)):
                near.still_step(k)
        n_edges = len(self._planner.optimizer.body.tables.normals)
        palms, m = near.palms().copy(), COM_EDGE + n_edges
        excess = near.now.violation[:, :m] / tolerances(n_edges)[:m]
        shaped = [x.reshape(n, len(rows), *x.shape[1:]) for x in (joined[chosen], wanted[chosen], palms, excess)]
        return Reached(steps[rows], *shaped)

    def _begin(self, problem: TrajectoryProblem, wanted: np.ndarray, begin: Begin) -> None:
        """Ask for palms (K, 2, 4, 4), with all bounds."""
        body, config = self._planner.optimizer.body, self._posture
        fingers = np.tile(begin.body.q[body.fingers], (len(wanted), 1))
        problem.begin(wanted, fingers, np.zeros_like(body.rates_of(begin.body.v)))
        problem.set_weights(config, 1.0)

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

    def _problem(self, K: int, dt: float, *, first: bool) -> TrajectoryProblem:
        """Memory for so many rows, kept for the next time; another one for the first steps than for the others."""
        body = self._planner.optimizer.body
        key = K, dt, len(body.tables.normals)
        if first not in self._kept or self._kept[first][0] != key:
            self._kept[first] = key, TrajectoryProblem(body, replace(self._posture, dt=dt), K)
        return self._kept[first][1]


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
