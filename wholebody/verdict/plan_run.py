"""Chunks planned one after the other, each from where the plan before leads, and what they come to."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np

from policy.chunk import ActionChunk
from policy.geometry.rotations import angle_between
from policy.joints import layout_robot
from wholebody.episode.result import EpisodeResult, Note, Refusal
from wholebody.episode.tracking_error import FINGER_TOLERANCE, PalmErrors, demandable
from wholebody.execution.handover import ends_at_rest
from wholebody.planning.judgement.chunk_judge import Begin, ChunkJudge, ChunkJudgement
from wholebody.planning.judgement.limits import OF_NUMBERS, Limit, Margin
from wholebody.planning.plan import ChunkPlan
from wholebody.sim.limit_monitor import LimitExcess
from wholebody.types import Reason
from wholebody.verdict.calibration.quantities import quantities
from wholebody.verdict.verdict import Verdict, blocked, too_hard, unheld, verdict_of

MOVING = 0.05
"""Speed of a hand from which a chunk is begun in motion [m/s]; chosen: what stops within a few millimetres."""


@dataclass
class _Palms:
    """What is collected of the palms, a row a step."""

    times: list[float] = field(default_factory=list)
    moved: list[np.ndarray] = field(default_factory=list)
    turned: list[np.ndarray] = field(default_factory=list)
    asked: list[np.ndarray] = field(default_factory=list)
    fair: list[np.ndarray] = field(default_factory=list)
    reasons: list[Reason | None] = field(default_factory=list)
    fingers: dict[str, LimitExcess] = field(default_factory=dict)

    def errors(self) -> PalmErrors:
        moved, turned = np.reshape(self.moved, (-1, 2)), np.reshape(self.turned, (-1, 2))
        still, fair = np.zeros_like(moved), np.reshape(self.fair, (-1, 2)).astype(bool)
        return PalmErrors(
            np.array(self.times), moved, turned, moved, turned, still, still, fair, self.reasons, self.fingers,
            asked=np.reshape(self.asked, (-1, 2, 3)),
        )  # fmt: skip


@dataclass(frozen=True)
class Suspect:
    """A chunk that is not followed as given.

    Attributes:
        chunk: As given.
        begin: Where it is begun, now [s].
        plan: What was planned for it.
    """

    chunk: ActionChunk
    begin: Begin
    now: float
    plan: ChunkPlan


JUDGED_AT_ONCE = OF_NUMBERS | {Limit.REACH, Limit.ORIENTATION, Limit.SCENE_DISTANCE, Limit.HAND_FORCE}
"""Bounds without a tolerance, of which any excess counts; the others are of a planned motion."""
RATES = tuple(one for one in Limit if one.name.startswith(("HAND_", "TURN_")))
"""Speeds, accelerations and jerks of hands."""


class PlanRun:
    """Chunks planned one after the other, and what they come to.

    Args:
        judge: Plans and judges each chunk.
        free: Whether the orientation of the left and the right palm is free.
        by_path: Compare palms where the plan is on its path; at the steps' own times if not.
        at_once: The first chunk begins with its first step; where its plan does if not.
        end: Time of the last step that is asked for, since the first one [s]; then it is held.
        odds: Collect the quantities that odds are made of, which takes longer than most plans.
    """

    def __init__(
        self,
        judge: ChunkJudge,
        free: tuple[bool, bool],
        *,
        by_path: bool = False,
        at_once: bool = False,
        end: float = np.inf,
        odds: bool = False,
    ) -> None:
        self.judge, self.palms, self.result = judge, _Palms(), EpisodeResult(orientation_free=free)
        self._by_path, self._at_once, self._end, self._odds = by_path, at_once, end, odds
        self.margins: dict[Limit, Margin] = {}
        self.suspects: list[Suspect] = []
        self.followed: ChunkJudgement | None = None
        self.planned: ChunkJudgement | None = None
        self.quantities: list[tuple[float, dict[str, float]]] = []
        self.moving, self._looked_at, self.placed = False, -np.inf, True
        self._planned: ActionChunk | None = None
        self.start_torque: Margin | None = None
        self.previewed, self._since, self._spent, self._travelled = True, 0.0, 0.0, 0.0

    def follow(
        self, chunk: ActionChunk, begin: Begin, now: float, until: float, found: ChunkJudgement | None = None
    ) -> Begin:
        """Plan a chunk from where the robot is then, now [s], and follow it until a time [s]; where that leads.

        What was ``found`` of it is not planned again.
        """
        chunk.validate(robot=layout_robot(self.judge.spec))
        if found is None and self._goes_on(chunk):
            chunk = self._planned
        else:
            self._plan(chunk, begin, now, found)
        due = np.flatnonzero((chunk.times > now - 1e-9) & (chunk.times < until - 1e-9))
        self._score(chunk, due, begin)
        if self.followed is None or not np.isfinite(until):
            return begin
        return self.judge.later(self.followed.plan, until - self._since)

    def _is_off(self, found: ChunkJudgement) -> bool:
        """Whether palms are commanded elsewhere, or turned otherwise, than is as given."""
        bounds = self.judge.config.verdict
        turned = np.where(self.result.orientation_free, 0.0, found.turned)
        far, turn = found.moved.max(initial=0.0), turned.max(initial=0.0)
        return bool(far > bounds.palm_feasible or turn > bounds.turn_feasible)

    def _is_news(self, chunk: ActionChunk) -> bool:
        """Whether a chunk has steps that move, and that no chunk before it had."""
        new = chunk.times > self._looked_at + 1e-9
        self._looked_at = max(self._looked_at, float(chunk.times[-1]))
        if not self.quantities or not new.any():
            return not self.quantities
        return any(np.ptp(T[new], axis=0).max() > 0.0 for T in (chunk.T_world_lhand, chunk.T_world_rhand))

    def _goes_on(self, chunk: ActionChunk) -> bool:
        """Whether a chunk is the rest of the one before, whose plan does it as given: another one says nothing new."""
        last, found = self._planned, self.followed
        if last is None or found is None or found.exceeded or self._is_off(found):
            return False
        if found.plan.report.changes or found.plan.rate != 1.0:
            return False
        first = (chunk.t_obs - last.t_obs) * last.fps
        if chunk.fps != last.fps or abs(first - round(first)) > 1e-6:
            return False
        # What is asked for past the end of a recording is its last step.
        steps, before = np.minimum(round(first) + np.arange(len(chunk)), len(last) - 1), last.arrays()
        same = (np.array_equal(values, before[name][steps]) for name, values in chunk.arrays().items())
        return chunk.arrays().keys() == before.keys() and all(same)

    def _plan(self, chunk: ActionChunk, begin: Begin, now: float, found: ChunkJudgement | None) -> None:
        planned, found = found is None, found or self.judge.judge(chunk, begin, now)
        self.planned = found
        self._note(chunk, found, begin)
        if planned and self._odds and self._is_news(chunk):
            self.quantities.append((chunk.t_obs - self.result.start, quantities(self.judge, chunk, begin, found)))
            self.moving |= bool(np.linalg.norm(begin.hands.v, axis=1).max() > MOVING)
        report = found.plan.report
        held = self.start_torque is None or self.start_torque.share >= 0.0 or self.followed is not None
        if report.changes or not report.safe or found.exceeded or not held or self._is_off(found):
            self.suspects.append(Suspect(chunk, begin, now, found.plan))
        body, margin = self.judge.planner.optimizer.body, self.judge.config.safety.balance_margin
        if report.safe and ends_at_rest(found.plan, body.footing.support, margin):
            self.followed, self._since, self._planned = found, now, chunk
        else:
            self._planned = None
            self.result.refusals.append(Refusal(now, Reason.NOT_JOINED, Reason.NOT_JOINED.sentence))

    def _note(self, chunk: ActionChunk, found: ChunkJudgement, begin: Begin) -> None:
        result, report = self.result, found.plan.report
        result.notes += [Note(chunk.t_obs, text) for text in chunk.notes]
        if not result.fps:
            (p, R), (at, turned) = self.judge.asked(chunk), self.judge.at(begin)
            result.start, result.fps = chunk.t_obs, chunk.fps
            self.start_torque = None if self._by_path else self.judge.start_torque(begin)
            # A chunk that comes at once begins with its first step, though its plan takes time.
            first = 0 if self._at_once else min(int(np.ceil(found.plan.start * chunk.fps - 1e-6)), len(chunk) - 1)
            jump = np.linalg.norm(at - p[first], axis=1).max(), angle_between(turned, R[first]).max()
            result.start_jump, result.start_palms = (float(jump[0]), float(jump[1])), at
        self.previewed &= found.previewed
        if report.slowdown > result.slowdown:
            result.slowdown, result.slowed_time = report.slowdown, chunk.t_obs
        since = chunk.t_obs - result.start
        for one in self._room(chunk, found):
            moved = replace(one, time=one.time + since, step=one.step + round(since * chunk.fps))
            if one.code not in self.margins or one.share < self.margins[one.code].share:
                self.margins[one.code] = moved

    def own(self, chunk: ActionChunk) -> ActionChunk:
        """A chunk without what only holds the end of the input: to stop there is the plan's part, and no step's."""
        left = self._end - (chunk.t_obs - self.result.start)
        n = int(np.floor(min(left, len(chunk) / chunk.fps) * chunk.fps + 1e-6)) + 1
        if not 2 <= n < len(chunk):
            return chunk
        return replace(chunk, **{name: value[:n] for name, value in chunk.arrays().items()})

    def _room(self, chunk: ActionChunk, found: ChunkJudgement) -> Iterable[Margin]:
        """Room to every bound; to those of numbers, of the numbers that are the input's own."""
        if (own := self.own(chunk)) is chunk:
            return found.margins
        room = {one.code: one for one in found.margins} | self.judge.of_numbers(own)
        return room.values()

    def _score(self, chunk: ActionChunk, due: np.ndarray, begin: Begin) -> None:
        """Compare steps of a chunk with what is commanded then: by its plan, or by the one before."""
        palms, n, times, followed = self.palms, len(due), chunk.times[due], self.followed
        if followed is None:
            off, reasons = self._off(chunk, due, self.judge.at(begin)), [Reason.NOT_JOINED] * n
            palms.fair += list(np.zeros((n, 2), dtype=bool))
        else:
            plan = followed.plan
            s = plan.start + (1.0 if self._by_path else plan.rate) * (times - self._since)
            if chunk is self._planned and len(followed.moved) and not self._by_path:
                off = followed.moved[due], followed.turned[due]
            else:
                off = self._off(chunk, due, self.judge.commanded(plan, np.minimum(s, plan.end + 10.0)))
            reasons = [plan.report.moved_at(x) for x in s.tolist()]
            palms.fair += list(demandable(chunk, plan.report)[due])
            self._spent += n / chunk.fps
            self._travelled += n / chunk.fps * plan.rate
        palms.times += times.tolist()
        palms.moved += list(off[0])
        palms.turned += list(off[1])
        palms.asked += list(self.judge.asked(chunk)[0][due])
        palms.reasons += reasons
        self._look_at_fingers(chunk, due)

    def _off(
        self, chunk: ActionChunk, due: np.ndarray, commanded: tuple[np.ndarray, np.ndarray]
    ) -> tuple[np.ndarray, np.ndarray]:
        """How far palms are commanded from steps of a chunk [m], and how far turned [rad]."""
        p, R = self.judge.asked(chunk)
        return np.linalg.norm(commanded[0] - p[due], axis=-1), angle_between(commanded[1], R[due])

    def _look_at_fingers(self, chunk: ActionChunk, due: np.ndarray) -> None:
        spec, times = self.judge.spec, chunk.times[due]
        for tool, q in zip(spec.tools, (chunk.q_lhand[due], chunk.q_rhand[due]), strict=True):
            if not tool.finger_joints or not len(due):
                continue
            i = spec.indices(tool.finger_joints)
            inside = np.clip(q, spec.position_min[i], spec.position_max[i])
            excess = np.abs(q - inside)
            for joint in np.flatnonzero(excess.max(axis=0, initial=0.0) > FINGER_TOLERANCE).tolist():
                k, first = int(excess[:, joint].argmax()), int(np.argmax(excess[:, joint] > FINGER_TOLERANCE))
                one = LimitExcess(float(times[first]), 0.0, float(q[k, joint]), float(inside[k, joint]))
                self.palms.fingers.setdefault(tool.finger_joints[joint], one)

    def verdict(self, name: str, settings: dict) -> Verdict:
        """Verdict by the same rules as that of an episode."""
        result = self.result
        result.palms = self.palms.errors()
        result.time_factor = self._spent / self._travelled if self._travelled else 1.0
        verdict = verdict_of(name, result, settings, bounds=self.judge.config.verdict)
        if Limit.SCENE_DISTANCE in self.margins:
            verdict = blocked(verdict, self.margins[Limit.SCENE_DISTANCE], self.judge.config.verdict)
        if Limit.HAND_FORCE in self.margins:
            verdict = too_hard(verdict, self.margins[Limit.HAND_FORCE])
        if self.start_torque is not None:
            verdict = unheld(verdict, self.start_torque)
        feasible = verdict.verdict == "feasible"
        tightest = sorted((on_one_scale(one, feasible) for one in self.margins.values()), key=lambda one: one.share)
        return replace(verdict, method="fast", decided_by="preview" if self.previewed else "plan", margins=tightest)


def on_one_scale(one: Margin, feasible: bool) -> Margin:
    """A margin whose share is 0 at the most that is done as given, and negative beyond.

    A plan may exceed the bounds of a motion by their tolerances; what the chunk's own numbers exceed without moving a
    palm of a feasible input is at 0.
    """
    share = one.share if one.code in JUDGED_AT_ONCE else one.share + 1.0
    share = one.margin / one.bound if one.code in RATES and one.margin < 0.0 else share
    return replace(one, share=max(share, 0.0) if feasible else share)
