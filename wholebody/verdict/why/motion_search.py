"""Motions that do a chunk as given, searched for within some kinds of bounds alone."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from policy.chunk import ActionChunk
from policy.geometry.rotations import angle_between
from wholebody.config import TrajectoryConfig
from wholebody.planning.attempt import Targets
from wholebody.planning.judgement.chunk_judge import Begin, ChunkJudge
from wholebody.planning.judgement.limits import Limit
from wholebody.planning.preparation import prepare
from wholebody.planning.still_postures import scattered
from wholebody.planning.trajectory import centroidal_along, curve_through
from wholebody.trajopt.budget import SEARCH_MAX, Budget
from wholebody.trajopt.optimizer import KnotTrajectory

SPREAD = 0.3
"""Deviation of postures that are not the start, as a share of each joint's range; chosen, no trial is on record."""
APPROACH_MAX = 1.0
"""Time in which a hand that was elsewhere has to be where the chunk has it [s]; definition, as in the verdict."""
EASE = 10.0
"""Factor on the scales of what is only wanted, comfort and stillness, where a motion is searched for that need not be a
good one; chosen: bounds and palms alone are left."""
FIRM = 3.0
"""Factor on the scales of the palms where they pull a bound past its tolerance; chosen, as the planner's own."""

KINDS: tuple[tuple[Limit, ...], ...] = (
    (Limit.TILT,),
    (Limit.PELVIS_HEIGHT,),
    (Limit.JOINT_POSITION,),
    (Limit.WAIST_TORQUE, Limit.JOINT_TORQUE),
    (Limit.SELF_DISTANCE, Limit.FLOOR_DISTANCE),
    (Limit.BALANCE,),
    (Limit.LOAD,),
    (Limit.ZMP,),
    (Limit.CAPTURE_POINT,),
    (Limit.JOINT_ACCELERATION,),
    (Limit.JOINT_SPEED,),
    (Limit.FRICTION,),
)
"""Kinds of bounds that are enforced together, each under the name of its first."""
NAMES = {limit: kind[0] for kind in KINDS for limit in kind}
"""The name of the kind that a bound belongs to."""
EVERY = frozenset(NAMES.values())


@dataclass(frozen=True, eq=False)
class Witness:
    """A motion that was found, or the nearest to one; equal to none but itself.

    Attributes:
        knots: The motion.
        targets: What it was to follow.
        broken: Names of the kinds whose bounds it does not keep, worst first; not looked at where palms are elsewhere.
        worst: Largest distance of a palm, in terms of the bound of what is done as given, and where: knot and hand.
    """

    knots: KnotTrajectory
    targets: Targets
    broken: tuple[Limit, ...]
    worst: tuple[float, int, int]

    @property
    def near(self) -> bool:
        """Whether the palms are where they are asked to be, once the hands have joined the chunk."""
        return self.worst[0] <= 1.0

    def keeps(self, enforced: frozenset[Limit]) -> bool:
        """Whether it is a plan within the bounds of these kinds."""
        return self.near and not enforced & set(self.broken)


SearchBegin = tuple[np.ndarray | None, np.ndarray | None]
"""Posture (nq,), or knots (k, nq) of a motion, that a search begins with; the present posture if both are None."""


@dataclass
class Searched:
    """What one search came to.

    Attributes:
        found: A motion that does the chunk within the bounds, if one was found.
        near: All motions on the way there that do it, within whatever bounds.
        first: The first motion that was tried.
        missed: Knots, and postures near them, at which the last motion falls short; none where one was found.
        motions: How many were planned.
        work: What that took, as budgets count it.
    """

    found: Witness | None = None
    near: list[Witness] = field(default_factory=list)
    first: Witness | None = None
    missed: list[tuple[int, np.ndarray]] = field(default_factory=list)
    motions: int = 0
    work: float = 0.0


class MotionSearch:
    """Searches for motions that do one chunk; a search depends on none before it.

    Attributes:
        first: Knot from which the palms count: the hands have joined the chunk.

    Args:
        judge: Holds the robot.
        chunk: A valid chunk.
        begin: Where it is begun. now: When, on the clock of its observation [s].
        free: Whether the orientation of the left and of the right palm is free.
    """

    def __init__(self, judge: ChunkJudge, chunk: ActionChunk, begin: Begin, now: float, free: np.ndarray) -> None:
        self.judge, self.begin, self._free = judge, begin, free
        planner = self._planner = judge.planner
        self.targets = planner.targets(prepare(chunk, planner.hand_limits), now, begin.hands, 1.0)
        joins = [path.join.s + path.join.duration for path in self.targets.paths if path.join is not None]
        joined = min(max(joins, default=0.0), self.targets.steps[0] + APPROACH_MAX)
        self.first = max(int(np.searchsorted(self.targets.steps, joined)), 1)
        posture = planner.config.posture
        self._weights = posture, replace(posture, **{name: EASE * getattr(posture, name) for name in EASED})
        self._firm = [replace(w, position=FIRM * w.position, orientation=FIRM * w.orientation) for w in self._weights]

    def search(self, enforced: frozenset[Limit], seed: np.ndarray | None, last: np.ndarray | None = None) -> Searched:
        """A motion within the bounds of these kinds, from what `SearchBegin` says."""
        rows, anew, optimizer = self.rows(enforced), seed is None and last is None, self._planner.optimizer
        done, before = Searched(), optimizer.work
        for weights, firm in list(zip(self._weights, self._firm, strict=True))[not anew :]:
            one = self._plan(done, rows, weights, seed, last)
            if one.near and not one.keeps(enforced):
                # Palms that pull less leave more to the bounds.
                one = self._plan(done, rows, firm, seed, one.knots.q[1:])
            if one.keeps(enforced):
                done.found = one
                break
            last = one.knots.q[1:]
        else:
            worst = {one.worst[1], max(int(one.knots.violation.argmax()), 1)}
            done.missed = [(k, one.knots.q[k]) for k in worst]
        done.work = optimizer.work - before
        return done

    def scattered(self, start: int) -> np.ndarray:
        """A posture (nq,) about the present one, for the number of a start."""
        body, generator = self._planner.optimizer.body, np.random.default_rng(start)
        q = self.begin.body.q.copy()
        body.put(q, scattered(body, body.body_of(q), SPREAD, generator))
        return q

    def witness(self, knots: KnotTrajectory) -> Witness:
        """What a motion at the chunk's own speed comes to."""
        worst = self._worst(knots)
        return Witness(knots, self.targets, self._broken(knots) if worst[0] <= 1.0 else (), worst)

    def rows(self, enforced: frozenset[Limit]) -> np.ndarray:
        """Which inequalities of a knot belong to these kinds, as 0 or 1."""
        spans = self.judge.spans
        rows = np.zeros(sum(span.stop - span.start for span in spans.values()))
        for limit, span in spans.items():
            rows[span] = NAMES[limit] in enforced
        return rows

    def _plan(
        self,
        done: Searched,
        rows: np.ndarray,
        weights: TrajectoryConfig,
        seed: np.ndarray | None,
        last: np.ndarray | None,
    ) -> Witness:
        body, targets = self.begin.body, self.targets
        motion = body.q, body.v, targets.T_palms, targets.q_fingers
        pushes = body.counted(targets.pushes, self._planner.config.posture.dt)
        optimizer, budget = self._planner.optimizer, Budget(SEARCH_MAX)
        knots = optimizer.plan_with_less(rows, seed, *motion, last, weights, budget, pushes=pushes)
        one = self.witness(knots)
        done.motions += 1
        done.first = done.first or one
        done.near += [one] if one.near else []
        return one

    def _worst(self, knots: KnotTrajectory) -> tuple[float, int, int]:
        reached, wanted, bounds = knots.T_palms, self.targets.T_palms, self.judge.config.verdict
        off = np.linalg.norm(reached[:, :, :3, 3] - wanted[:, :, :3, 3], axis=2) / bounds.palm_feasible
        turn = angle_between(reached[:, :, :3, :3], wanted[:, :, :3, :3]) / bounds.turn_feasible
        off = np.maximum(off, np.where(self._free, 0.0, turn))[self.first :]
        k, side = np.unravel_index(off.argmax(), off.shape)
        return float(off.max()), self.first + int(k), int(side)

    def _broken(self, knots: KnotTrajectory) -> tuple[Limit, ...]:
        """Names of the kinds whose bounds a motion does not keep, worst first, what the floor can give last."""
        excess, worst = self._planner.optimizer.measured(knots).excess().max(axis=0), {}
        for limit, span in self.judge.spans.items():
            worst[NAMES[limit]] = max(worst.get(NAMES[limit], 0.0), float(excess[span].max()))
        bound = self._planner.config.violation_max
        names = sorted((name for name, value in worst.items() if value > bound), key=lambda name: -worst[name])
        drift, deficit, strain = self._between_knots(knots)
        names += [NAMES[Limit.JOINT_TORQUE]] if strain > 1.0 else []
        names += [Limit.ZMP, Limit.CAPTURE_POINT] if drift > 1.0 else []
        names += [Limit.FRICTION] if deficit > 1.0 else []
        return tuple(dict.fromkeys(names))

    def _between_knots(self, knots: KnotTrajectory) -> tuple[float, float, float]:
        """Drift of the capture point, lack of friction, and torques, in terms of what a plan may have."""
        planner, steps = self._planner, self.targets.steps
        curve = curve_through(steps, knots.q, self.begin.body.v)
        track = centroidal_along(curve, steps[0], steps[-1] + steps[1] - steps[0], planner.centroidal)
        track = track.pushed(steps, knots)
        drift = planner.balance.capture_point_drift(track, 1.0) / planner.config.capture_point_drift_max
        deficit = planner.balance.friction_impulse_deficit(track, 1.0) / planner.config.friction_deficit_max
        return drift, deficit, planner.effort.strain(track, 1.0, steps[1] - steps[0])


EASED = (
    "com", "zmp", "torso", "pelvis", "height", "posture", "waist_torque", "slide", "smoothness", "stillness",
    "leg_stillness",
)  # fmt: skip
"""Names of the scales that `EASE` multiplies."""
