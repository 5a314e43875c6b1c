"""A chunk as the planner's program, of which any kind of bound can be left out: is there a plan without it?"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from policy.chunk import ActionChunk
from policy.geometry.rotations import angle_between
from wholebody.config import TrajectoryConfig
from wholebody.planning.attempt import Targets
from wholebody.planning.judgement.chunk_judge import PALMS, Begin, ChunkJudge
from wholebody.planning.judgement.limits import Limit, Margin
from wholebody.planning.posture import FIRM as FIRM_BOUNDS
from wholebody.planning.posture import GENTLE_SCALES, PALM_SCALES
from wholebody.planning.preparation import prepare
from wholebody.planning.still_postures import Round, scattered
from wholebody.planning.trajectory import GRID, SampledTrajectory, centroidal_along, curve_through, track_along
from wholebody.planning.trajopt.budget import SEARCH_MAX, Budget
from wholebody.planning.trajopt.optimizer import KnotTrajectory
from wholebody.reference import HandMotion

STARTS = 5
"""Postures from which each search begins."""
NEAREST = 4
"""Motions that keep most of the bounds with which a thorough search begins, too; measured: with one, 3 of 323 sets had
a plan that the next search found."""
POSTURES = 6
"""Postures from which one at rest is searched."""
SPREAD = 0.3
"""Deviation of those that are not the start, as a share of each joint's range; chosen, no trial is on record."""
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
AT_REST = frozenset(name for name in EVERY if name.value in list(Limit)[: list(Limit).index(Limit.LOAD)])
"""Those that a posture at rest has to keep."""


@dataclass(frozen=True)
class Witness:
    """A motion that was found, or the nearest to one.

    Attributes:
        knots: The motion.
        targets: What it was to follow.
        broken: Names of the kinds whose bounds it does not keep, worst first.
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


class ChunkProgram:
    """One chunk.

    Attributes:
        first: Knot from which the palms count: the hands have joined the chunk.
        searches: Motions searched for so far.

    Args:
        judge: Holds the robot.
        chunk: A valid chunk.
        begin: Where it is begun; at rest with the hands at its first step if not given.
        free: Whether nothing is asked of the left and the right palm's orientation.
        now: When it is begun, on the clock of its observation [s]; with its first step if not given.
    """

    def __init__(
        self,
        judge: ChunkJudge,
        chunk: ActionChunk,
        begin: Begin | None = None,
        free: tuple[bool, bool] = (False, False),
        now: float | None = None,
    ) -> None:
        self.judge, self.chunk, self.free = judge, chunk, np.array(free)
        planner = self._planner = judge.planner
        self.now = chunk.t_obs if now is None else now
        self.prepared = prepare(chunk, planner.hand_limits)
        self.begin = begin or judge.first_pose(self.prepared.chunk)
        self.targets = planner.targets(self.prepared, self.now, self.begin.hands, 1.0)
        joins = [path.join.s + path.join.duration for path in self.targets.paths if path.join is not None]
        joined = min(max(joins, default=0.0), self.targets.steps[0] + APPROACH_MAX)
        self.first = max(int(np.searchsorted(self.targets.steps, joined)), 1)
        posture = planner.config.posture
        self._weights = posture, replace(posture, **{name: EASE * getattr(posture, name) for name in EASED})
        self._firm = [replace(w, position=FIRM * w.position, orientation=FIRM * w.orientation) for w in self._weights]
        exact, gentle = (replace(posture, **scales) for scales in (PALM_SCALES, GENTLE_SCALES))
        self._rounds = Round(exact, 1.0, 25), Round(gentle, FIRM_BOUNDS, 40)
        self.searches = 0
        self._found: list[Witness] = []
        self._tried: dict[frozenset[Limit], int] = {}
        self._hard: list[tuple[int, np.ndarray]] = []
        self._at_rest: dict[tuple[int, frozenset[Limit]], bool] = {}
        self._nearest: Witness | None = None

    def find(self, enforced: frozenset[Limit], *, thorough: bool = False) -> Witness | None:
        """A motion that does the chunk as given within the bounds of these kinds alone, if one is found.

        Args:
            enforced: Names of the kinds.
            thorough: Search from `STARTS` starts. Else one has to do, and none is made where at a knot that was missed
                before no posture at rest keeps them: a posture of a plan would.
        """
        starts = STARTS if thorough else 1
        known = next((one for one in self._found if one.keeps(enforced)), None)
        missed = known is None and any(self._missed(less, starts) for less in self._tried if less <= enforced)
        if known is not None or missed or not (thorough or self._has_postures(enforced)):
            return known
        # What keeps most of these bounds may be near to what keeps all.
        best = sorted(self._found, key=lambda one: len(enforced & set(one.broken)))[: NEAREST if thorough else 0]
        for near in best:
            if (one := self._search(enforced, None, near.knots.q[1:])) is not None:
                return one
        for start in range(self._tried.get(enforced, 0), starts):
            if (one := self._search(enforced, self._scattered(start) if start else None)) is not None:
                return one
            self._tried[enforced] = start + 1
        return None

    def _missed(self, enforced: frozenset[Limit], starts: int) -> bool:
        """Whether so many starts found no plan within the bounds of these kinds, and none has been found since."""
        return self._tried[enforced] >= starts and not any(one.keeps(enforced) for one in self._found)

    def know(self, knots: KnotTrajectory) -> None:
        """Count a motion that was found elsewhere, at the chunk's own speed, among those that were found."""
        self._keep(Witness(knots, self.targets, self._broken(knots), self._worst(knots)))

    def _keep(self, one: Witness) -> Witness:
        if one.near:
            self._found.append(one)
        return one

    def _search(
        self, enforced: frozenset[Limit], seed: np.ndarray | None, last: np.ndarray | None = None
    ) -> Witness | None:
        """From the present posture, from another one (nq,), or from the knots (k, nq) of a motion."""
        rows, anew = self._rows(enforced), seed is None and last is None
        for weights, firm in list(zip(self._weights, self._firm, strict=True))[not anew :]:
            one = self._plan(rows, weights, seed, last)
            if enforced == EVERY and self._nearest is None:
                self._nearest = one
            if one.near and not one.keeps(enforced):
                # Palms that pull less leave more to the bounds.
                one = self._plan(rows, firm, seed, one.knots.q[1:])
            if one.keeps(enforced):
                return one
            last = one.knots.q[1:]
        self._hard += [(k, one.knots.q[k]) for k in {one.worst[1], max(int(one.knots.violation.argmax()), 1)}]
        return None

    def _scattered(self, start: int) -> np.ndarray:
        body, generator = self._planner.optimizer.body, np.random.default_rng(start)
        q = self.begin.body.q.copy()
        q[body.body] = scattered(body, q[body.body], SPREAD, generator)
        return q

    def nearest(self) -> Witness:
        """What the planner's own weights come to with every bound enforced."""
        if self._nearest is None:
            self._nearest = self._plan(self._rows(EVERY), self._weights[0], None, None)
        return self._nearest

    def nearest_track(self) -> tuple[SampledTrajectory, tuple[HandMotion, HandMotion]]:
        """The same as it would be followed, and the hands as given at its rows."""
        steps = self.targets.steps
        curve = curve_through(steps, self.nearest().knots.q, self.begin.body.v)
        end = steps[-1] + steps[1] - steps[0]
        track = track_along(curve, centroidal_along(curve, steps[0], end, self._planner.centroidal))
        times = np.minimum(track.start + GRID * np.arange(len(track.q)), steps[-1])
        return track, tuple(path.sample(times) for path in self.targets.paths)

    def raised(self, kind: Limit) -> Margin | None:
        """What the bounds of a kind would have to be for a plan that keeps all the others; None where none is found.

        It is the value that such a plan has, which is not the least one. One start has to do.
        """
        found = self.find(EVERY - {kind})
        if found is None:
            return None
        of_kind = (one for one in self.margins(found) if NAMES[one.code] == kind and one.margin < 0.0)
        return next(of_kind, None)

    def margins(self, witness: Witness) -> list[Margin]:
        """Least room that a motion leaves to every kind of bound, the tightest first."""
        problem = self._planner.optimizer.measured(witness.knots)
        return sorted(
            self.judge.measured(problem, self.chunk.fps, float(self.targets.steps[0])), key=lambda one: one.share
        )

    def reach(self, witness: Witness) -> Margin:
        """How far the palms of a motion are from where they are asked to be, at the worst."""
        share, k, side = witness.worst
        T, wanted, bound = witness.knots.T_palms[k, side], self.targets.T_palms[k, side], self.judge.config.verdict
        off = float(np.linalg.norm(T[:3, 3] - wanted[:3, 3]))
        turn, time = float(angle_between(T[:3, :3], wanted[:3, :3])), float(self.targets.steps[k])
        turned = off / bound.palm_feasible < share
        code, value, bound = (
            (Limit.ORIENTATION, turn, bound.turn_feasible) if turned else (Limit.REACH, off, bound.palm_feasible)
        )
        return Margin(
            code=code, subject=PALMS[side], time=time, step=max(round(time * self.chunk.fps), 0), value=value,
            bound=bound, unit=code.unit, margin=bound - value, share=(bound - value) / bound,
        )  # fmt: skip

    def rests(self) -> bool:
        """Whether postures at rest keep all bounds where motions missed: else it is in vain to go slower."""
        return self._has_postures(EVERY)

    def _has_postures(self, enforced: frozenset[Limit]) -> bool:
        """Whether postures at rest are found at the knots that were missed before, from `POSTURES` starts each."""
        return all(self._rests_at(k, near, enforced & AT_REST) for k, near in self._hard[-2:])

    def _rests_at(self, k: int, near: np.ndarray, enforced: frozenset[Limit]) -> bool:
        """The same at one knot; what is known of more or of fewer kinds is not searched for again."""
        for (knot, kinds), found in self._at_rest.items():
            if knot == k and (kinds >= enforced if found else kinds <= enforced):
                return found
        self._at_rest[k, enforced] = found = self._posture_at(k, near, enforced)
        return found

    def _posture_at(self, k: int, near: np.ndarray, enforced: frozenset[Limit]) -> bool:
        stills, body, generator = self.judge.stills, self._planner.optimizer.body, np.random.default_rng(0)
        stills.enforced[:] = self._rows(enforced)
        stance, T, bounds = body.tables.q_stance, self.targets.T_palms[k], self.judge.config.verdict
        for start in range(POSTURES):
            q = (near[body.body], stance)[start] if start < 2 else scattered(body, stance, SPREAD, generator)
            stills.search(T, q, self.targets.q_fingers[k], self._rounds)
            off = np.linalg.norm(stills.T_palms[1, :, :3, 3] - T[:, :3, 3], axis=1).max() <= bounds.palm_feasible
            turn = np.where(self.free, 0.0, angle_between(stills.T_palms[1, :, :3, :3], T[:, :3, :3]))
            if off and turn.max() <= bounds.turn_feasible and stills.excess()[1] <= 1.0:
                return True
        return False

    def _rows(self, enforced: frozenset[Limit]) -> np.ndarray:
        spans = self.judge.spans
        rows = np.zeros(sum(span.stop - span.start for span in spans.values()))
        for limit, span in spans.items():
            rows[span] = NAMES[limit] in enforced
        return rows

    def _plan(
        self, rows: np.ndarray, weights: TrajectoryConfig, seed: np.ndarray | None, last: np.ndarray | None
    ) -> Witness:
        self.searches += 1
        body, targets = self.begin.body, self.targets
        motion = body.q, body.v, targets.T_palms, targets.q_fingers
        knots = self._planner.optimizer.plan_with_less(rows, seed, *motion, last, weights, Budget(SEARCH_MAX))
        return self._keep(Witness(knots, targets, self._broken(knots), self._worst(knots)))

    def _worst(self, knots: KnotTrajectory) -> tuple[float, int, int]:
        reached, wanted, bounds = knots.T_palms, self.targets.T_palms, self.judge.config.verdict
        off = np.linalg.norm(reached[:, :, :3, 3] - wanted[:, :, :3, 3], axis=2) / bounds.palm_feasible
        turn = angle_between(reached[:, :, :3, :3], wanted[:, :, :3, :3]) / bounds.turn_feasible
        off = np.maximum(off, np.where(self.free, 0.0, turn))[self.first :]
        k, side = np.unravel_index(off.argmax(), off.shape)
        return float(off.max()), self.first + int(k), int(side)

    def _broken(self, knots: KnotTrajectory) -> tuple[Limit, ...]:
        """Names of the kinds whose bounds a motion does not keep, worst first, what the floor can give last."""
        excess, worst = self._planner.optimizer.measured(knots).excess().max(axis=0), {}
        for limit, span in self.judge.spans.items():
            worst[NAMES[limit]] = max(worst.get(NAMES[limit], 0.0), float(excess[span].max()))
        bound = self._planner.config.violation_max
        names = sorted((name for name, value in worst.items() if value > bound), key=lambda name: -worst[name])
        drift, deficit = self._floor(knots)
        names += [Limit.ZMP, Limit.CAPTURE_POINT] if drift > 1.0 else []
        names += [Limit.FRICTION] if deficit > 1.0 else []
        return tuple(dict.fromkeys(names))

    def _floor(self, knots: KnotTrajectory) -> tuple[float, float]:
        """Drift of the capture point and lack of friction between knots, in terms of what a plan may have."""
        planner, steps = self._planner, self.targets.steps
        curve = curve_through(steps, knots.q, self.begin.body.v)
        track = centroidal_along(curve, steps[0], steps[-1] + steps[1] - steps[0], planner.centroidal)
        drift = planner.contacts.capture_point_drift(track, 1.0) / planner.config.capture_point_drift_max
        return drift, planner.contacts.friction_impulse_deficit(track, 1.0) / planner.config.friction_deficit_max


EASED = (
    "com", "zmp", "torso", "pelvis", "height", "posture", "waist_torque", "slide", "smoothness", "stillness",
    "leg_stillness",
)  # fmt: skip
"""Names of the scales that `EASE` multiplies."""
