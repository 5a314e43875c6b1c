"""A chunk as the planner's program, of which any kind of bound can be left out: is there a plan without it?"""

from __future__ import annotations

from collections.abc import Iterator
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
POSTURES = 12
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
_FLOOR_SHARES = {Limit.ZMP, Limit.CAPTURE_POINT}


@dataclass(frozen=True)
class Witness:
    """A motion that was found, or the nearest to one.

    Attributes:
        knots: The motion.
        targets: What it was to follow.
        near: Whether the palms are where they are asked to be, once the hands have joined the chunk.
        worst: Largest distance of a palm, in terms of the bound of what is done as given, and where: knot and hand.
    """

    knots: KnotTrajectory
    targets: Targets
    near: bool
    worst: tuple[float, int, int]


@dataclass(frozen=True)
class _Known:
    """What was found for a set of kinds before, and whether from every start."""

    witness: Witness | None
    thorough: bool


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
        eased = {name: EASE * getattr(posture, name) for name in EASED}
        self._weights = (
            posture,
            replace(posture, orientation=planner.config.orientation_free),
            replace(posture, **eased),
            replace(posture, position=FIRM * posture.position, orientation=FIRM * posture.orientation),
        )
        exact, gentle = (replace(posture, **scales) for scales in (PALM_SCALES, GENTLE_SCALES))
        self._rounds = Round(exact, 1.0, 25), Round(gentle, FIRM_BOUNDS, 40)
        self.searches = 0
        self._known: dict[frozenset[Limit], _Known] = {}

    def find(self, enforced: frozenset[Limit], *, thorough: bool = False) -> Witness | None:
        """A motion that does the chunk as given within the bounds of these kinds alone, from `STARTS` starts.

        Where the first search misses at a knot at which there is not even a posture at rest, from `POSTURES` starts,
        the others are left out unless it is to be thorough: a posture of a plan keeps the same bounds.
        """
        known = self._known.get(enforced)
        if known is not None and (known.witness is not None or known.thorough or not thorough):
            return known.witness
        witness, thorough = self._found(enforced, thorough=thorough)
        self._known[enforced] = _Known(witness, thorough)
        return witness

    def _found(self, enforced: frozenset[Limit], *, thorough: bool) -> tuple[Witness | None, bool]:
        """What `find` finds, and whether it looked everywhere."""
        rows, missed = self._rows(enforced), False
        plain, free, eased, firm = self._weights
        for seed, first in self._seeds(enforced):
            last = first
            for weights in (eased,) if missed else (plain, free, eased):
                one = self._witness(self._plan(rows, weights, seed, last))
                if one.near and not self._keeps(one.knots, enforced):
                    # Palms that pull less leave more to the bounds.
                    one = self._witness(self._plan(rows, firm, seed, one.knots.q[1:]))
                if one.near and self._keeps(one.knots, enforced):
                    return one, True
                if not (missed or thorough or self._has_posture(one, rows)):
                    return None, False
                last, missed = one.knots.q[1:], True
        return None, True

    def nearest(self) -> Witness:
        """What the planner's own weights come to with every bound enforced."""
        return self._witness(self._plan(self._rows(EVERY), self._weights[0], None, None))

    def nearest_track(self) -> tuple[SampledTrajectory, tuple[HandMotion, HandMotion]]:
        """The same as it would be followed, and the hands as given at its rows."""
        steps = self.targets.steps
        curve = curve_through(steps, self.nearest().knots.q, self.begin.body.v)
        end = steps[-1] + steps[1] - steps[0]
        track = track_along(curve, centroidal_along(curve, steps[0], end, self._planner.centroidal))
        times = np.minimum(track.start + GRID * np.arange(len(track.q)), steps[-1])
        left, right = (path.sample(times) for path in self.targets.paths)
        return track, (left, right)

    def raised(self, kind: Limit) -> Margin | None:
        """What the bounds of a kind would have to be for a plan that keeps all the others; None where none is found.

        It is the value that such a plan has, which is not the least one.
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

    def broken(self, witness: Witness) -> list[Limit]:
        """Names of the kinds whose bounds a motion does not keep, worst first."""
        names = [NAMES[one.code] for one in self.margins(witness) if one.share < -1.0]
        drift, deficit = self._floor(witness.knots)
        if drift > 1.0:
            names.append(Limit.ZMP)
        if deficit > 1.0:
            names.append(Limit.FRICTION)
        return list(dict.fromkeys(names))

    def _seeds(self, enforced: frozenset[Limit]) -> Iterator[tuple[np.ndarray | None, np.ndarray | None]]:
        """What searches begin with: a posture for inverse kinematics from knot to knot, or the knots of a motion."""
        yield None, None
        # What keeps most of these bounds and breaks others may be near to what keeps all.
        less = [kinds for kinds, one in self._known.items() if kinds < enforced and one.witness is not None]
        for kinds in sorted(less, key=len)[-1:]:
            yield None, self._known[kinds].witness.knots.q[1:]
        body, generator = self._planner.optimizer.body, np.random.default_rng(0)
        for _ in range(STARTS - 1):
            q = self.begin.body.q.copy()
            q[body.body] = scattered(body, q[body.body], SPREAD, generator)
            yield q, None

    def _has_posture(self, missed: Witness, rows: np.ndarray) -> bool:
        """Whether a posture at rest is found for the knots at which a motion is furthest from the palms or a bound."""
        knots = {missed.worst[1], max(int(missed.knots.violation.argmax()), 1)}
        return all(self._posture_at(k, missed.knots.q[k], rows) for k in knots)

    def _posture_at(self, k: int, near: np.ndarray, rows: np.ndarray) -> bool:
        stills, body, generator = self.judge.stills, self._planner.optimizer.body, np.random.default_rng(0)
        stills.enforced[:] = rows
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
    ) -> KnotTrajectory:
        self.searches += 1
        body, targets = self.begin.body, self.targets
        motion = body.q, body.v, targets.T_palms, targets.q_fingers
        return self._planner.optimizer.plan_with_less(rows, seed, *motion, last, weights, Budget(SEARCH_MAX))

    def _witness(self, knots: KnotTrajectory) -> Witness:
        reached, wanted, bounds = knots.T_palms, self.targets.T_palms, self.judge.config.verdict
        off = np.linalg.norm(reached[:, :, :3, 3] - wanted[:, :, :3, 3], axis=2) / bounds.palm_feasible
        turn = angle_between(reached[:, :, :3, :3], wanted[:, :, :3, :3]) / bounds.turn_feasible
        off = np.maximum(off, np.where(self.free, 0.0, turn))[self.first :]
        k, side = np.unravel_index(off.argmax(), off.shape)
        return Witness(knots, self.targets, bool(off.max() <= 1.0), (float(off.max()), self.first + int(k), int(side)))

    def _keeps(self, knots: KnotTrajectory, enforced: frozenset[Limit]) -> bool:
        """Whether a motion keeps the bounds enforced, and what the floor can give between its knots, where that is."""
        if knots.violation.max() > self._planner.config.violation_max:
            return False
        if not enforced & {Limit.ZMP, Limit.CAPTURE_POINT, Limit.FRICTION}:
            return True
        drift, deficit = self._floor(knots)
        pressed = not enforced & _FLOOR_SHARES or drift <= 1.0
        return pressed and (Limit.FRICTION not in enforced or deficit <= 1.0)

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
