"""Chunks planned one after the other, each from where the plan before leads, and what they come to."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from policy.chunk import ActionChunk
from policy.geometry.rotations import angle_between
from policy.joints import layout_robot
from wholebody.episode.result import EpisodeResult, Note, Refusal
from wholebody.episode.tracking_error import PalmErrors, demandable
from wholebody.execution.handover import ends_at_rest
from wholebody.planning.judgement.chunk_judge import Begin, ChunkJudge, ChunkJudgement
from wholebody.planning.judgement.limits import OF_NUMBERS, Limit, Margin
from wholebody.planning.plan import ChunkPlan
from wholebody.sim.limit_monitor import LimitExcess
from wholebody.types import Reason
from wholebody.verdict.calibration.quantities import is_news, quantities
from wholebody.verdict.input_steps import past_range, shortened
from wholebody.verdict.verdict import Verdict, blocked, too_hard, unheld, verdict_of


@dataclass(frozen=True)
class Suspect:
    """A chunk that is not followed as given.

    Attributes:
        chunk: As given. begin: Where it is begun, now [s].
        plan: What was planned for it.
    """

    chunk: ActionChunk
    begin: Begin
    now: float
    plan: ChunkPlan


@dataclass(frozen=True)
class Opening:
    """How an input begins.

    Attributes:
        start: When its first chunk was asked for [s]. fps: Its steps per second [Hz].
        jump: How far that begins from where the hands are: distance [m] and angle [rad].
        palms: Where the palm points are then, shape (2, 3), world [m].
        torque: Room of motors to hold the robot there; None where a plan leads it. placed: Whether it was put there.
    """

    start: float
    fps: float
    jump: tuple[float, float]
    palms: np.ndarray
    torque: Margin | None
    placed: bool


@dataclass(frozen=True)
class Planned:
    """What a plan says of a chunk.

    Attributes:
        margins: Room to every bound, times and steps since those of the input.
        previewed: Whether the cheap tests decided. slowed: How much slower it is [no unit]; when the chunk came [s].
        suspect: The chunk, where it is not followed as given. refusal: Why the plan is not followed, where it is not.
        quantities: Time since the start of the input [s] and what odds are made of, where they were collected.
    """

    margins: tuple[Margin, ...]
    previewed: bool
    slowed: tuple[float, float]
    suspect: Suspect | None
    refusal: Refusal | None
    quantities: tuple[float, dict[str, float]] | None


@dataclass(frozen=True)
class Played:
    """What one chunk adds to a run, which is a sequence of these.

    Attributes:
        opening: How the input begins.
        notes: What is told of the chunk.
        planned: What its plan says.
        steps: What is commanded at its steps that are due until the next one, compared with what is asked for.
        spent, travelled: Time on the plan, and chunk time that it covers [s].
    """

    opening: Opening
    notes: tuple[Note, ...]
    planned: Planned
    steps: PalmErrors
    spent: float
    travelled: float


@dataclass(frozen=True)
class RunState:
    """What the next chunk is planned after.

    Attributes:
        opening: How the input begins. begin: Where the next chunk is.
        judged: What was planned last.
        followed: What is followed; None before the first plan that can be. since: When that was begun [s].
        chunk: What it is a plan of; None where the plan of a later chunk was refused.
        looked_at: Time of the last step of which quantities were collected, or not worth it [s].
    """

    opening: Opening
    begin: Begin
    judged: ChunkJudgement
    followed: ChunkJudgement | None = None
    since: float = 0.0
    chunk: ActionChunk | None = None
    looked_at: float = -np.inf


JUDGED_AT_ONCE = OF_NUMBERS | {Limit.REACH, Limit.ORIENTATION, Limit.SCENE_DISTANCE, Limit.HAND_FORCE}
"""Bounds without a tolerance, of which any excess counts; the others are of a planned motion."""
RATES = tuple(one for one in Limit if one.name.startswith(("HAND_", "TURN_")))
"""Speeds, accelerations and jerks of hands."""


@dataclass(frozen=True)
class PlanRun:
    """Chunks planned one after the other, and what they come to; what was played is returned, none of it is kept.

    Attributes:
        judge: Plans and judges each chunk.
        free: Whether the orientation of the left and the right palm is free.
        by_path: Compare palms where the plan is on its path; at the steps' own times if not.
        at_once: The first chunk begins with its first step; where its plan does if not.
        end: Time of the last step that is asked for, since the first one [s]; then it is held.
        odds: Collect the quantities that odds are made of, which takes longer than most plans.
    """

    judge: ChunkJudge
    free: tuple[bool, bool]
    by_path: bool = field(default=False, kw_only=True)
    at_once: bool = field(default=False, kw_only=True)
    end: float = field(default=np.inf, kw_only=True)
    odds: bool = field(default=False, kw_only=True)

    def follow(
        self,
        chunk: ActionChunk,
        begin: Begin,
        now: float,
        until: float = np.inf,
        before: RunState | None = None,
        *,
        found: ChunkJudgement | None = None,
        notes: Iterable[str] = (),
    ) -> tuple[Played, RunState]:
        """Plan a chunk from where the robot is then, now [s], and follow it until a time [s]; where that leads.

        It comes after what was played ``before``, is not planned again where that was ``found``, and ``notes`` are told
        of it before its own.
        """
        chunk.validate(robot=layout_robot(self.judge.spec))
        planned, state = self._plan(chunk, begin, now, before, found)
        due = np.flatnonzero((chunk.times > now - 1e-9) & (chunk.times < until - 1e-9))
        steps, followed = self._compared(chunk, due, begin, state), state.followed
        if followed is not None and np.isfinite(until):
            begin = self.judge.later(followed.plan, until - state.since)
        spent, rate = (0.0, 0.0) if followed is None else (len(due) / chunk.fps, followed.plan.rate)
        told = tuple(Note(chunk.t_obs, text) for text in (*notes, *chunk.notes))
        return Played(state.opening, told, planned, steps, spent, spent * rate), replace(state, begin=begin)

    def _is_off(self, found: ChunkJudgement) -> bool:
        """Whether palms are commanded elsewhere, or turned otherwise, than is as given."""
        bounds, turned = self.judge.config.verdict, np.where(self.free, 0.0, found.turned)
        far, turn = found.moved.max(initial=0.0), turned.max(initial=0.0)
        return bool(far > bounds.palm_feasible or turn > bounds.turn_feasible)

    def _plan(
        self, chunk: ActionChunk, begin: Begin, now: float, before: RunState | None, known: ChunkJudgement | None
    ) -> tuple[Planned, RunState]:
        found = known or self.judge.judge(chunk, begin, now)
        opening = self._opening(chunk, begin, found) if before is None else before.opening
        state = RunState(opening, begin, found) if before is None else replace(before, judged=found)
        report, since, collected = found.plan.report, chunk.t_obs - opening.start, None
        margins = tuple(
            replace(one, time=one.time + since, step=one.step + round(since * chunk.fps))
            for one in self._room(chunk, found, opening)
        )
        if known is None and self.odds:
            if is_news(chunk, state.looked_at):
                collected = since, quantities(self.judge, chunk, begin, found)
            state = replace(state, looked_at=max(state.looked_at, float(chunk.times[-1])))
        held = opening.torque is None or opening.torque.share >= 0.0 or state.followed is not None
        as_given = report.safe and held and not (report.changes or found.exceeded or self._is_off(found))
        support = self.judge.planner.optimizer.body.footing.support
        if report.safe and ends_at_rest(found.plan, support, self.judge.config.safety.balance_margin):
            state, refusal = replace(state, followed=found, since=now, chunk=chunk), None
        else:
            state, refusal = replace(state, chunk=None), Refusal(now, Reason.NOT_JOINED, Reason.NOT_JOINED.sentence)
        suspect, slowed = None if as_given else Suspect(chunk, begin, now, found.plan), (report.slowdown, chunk.t_obs)
        return Planned(margins, found.previewed, slowed, suspect, refusal, collected), state

    def _opening(self, chunk: ActionChunk, begin: Begin, found: ChunkJudgement) -> Opening:
        (p, R), (at, turned) = self.judge.asked(chunk), self.judge.at(begin)
        torque = None if self.by_path else self.judge.start_torque(begin)
        # A chunk that comes at once begins with its first step, though its plan takes time.
        first = 0 if self.at_once else min(int(np.ceil(found.plan.start * chunk.fps - 1e-6)), len(chunk) - 1)
        jump = np.linalg.norm(at - p[first], axis=1).max(), angle_between(turned, R[first]).max()
        return Opening(chunk.t_obs, chunk.fps, (float(jump[0]), float(jump[1])), at, torque, begin.placed)

    def own(self, chunk: ActionChunk, opening: Opening) -> ActionChunk:
        """A chunk without what only holds the end of the input: to stop there is the plan's part, and no step's."""
        return shortened(chunk, self.end - (chunk.t_obs - opening.start))

    def _room(self, chunk: ActionChunk, found: ChunkJudgement, opening: Opening) -> Iterable[Margin]:
        """Room to every bound; to those of numbers, of the numbers that are the input's own."""
        if (own := self.own(chunk, opening)) is chunk:
            return found.margins
        room = {one.code: one for one in found.margins} | self.judge.of_numbers(own)
        return room.values()

    def _compared(self, chunk: ActionChunk, due: np.ndarray, begin: Begin, state: RunState) -> PalmErrors:
        """Steps of a chunk beside what is commanded then: by its plan, or by the one before."""
        times, followed, reasons = chunk.times[due], state.followed, list[Reason | None]()
        if followed is None:
            off, reasons = self._off(chunk, due, self.judge.at(begin)), [Reason.NOT_JOINED] * len(due)
            fair = np.zeros((len(due), 2), dtype=bool)
        else:
            plan = followed.plan
            s = plan.start + (1.0 if self.by_path else plan.rate) * (times - state.since)
            if chunk is state.chunk and len(followed.moved) and not self.by_path:
                off = followed.moved[due], followed.turned[due]
            else:
                off = self._off(chunk, due, self.judge.commanded(plan, np.minimum(s, plan.end + 10.0)))
            reasons, fair = [plan.report.moved_at(x) for x in s.tolist()], demandable(chunk, plan.report)[due]
        asked, fingers = self.judge.asked(chunk)[0][due], past_range(chunk, due, self.judge.spec)
        still = np.zeros_like(off[0])
        return PalmErrors(times, *off, *off, still, still, fair, reasons, fingers, asked=asked)

    def _off(
        self, chunk: ActionChunk, due: np.ndarray, commanded: tuple[np.ndarray, np.ndarray]
    ) -> tuple[np.ndarray, np.ndarray]:
        """How far palms are commanded from steps of a chunk [m], and how far turned [rad]."""
        p, R = self.judge.asked(chunk)
        return np.linalg.norm(commanded[0] - p[due], axis=-1), angle_between(commanded[1], R[due])

    def verdict(self, played: Sequence[Played], name: str = "", settings: dict | None = None) -> Verdict:
        """Verdict on chunks that were played, by the same rules as that of an episode."""
        opening, planned = played[0].opening, [one.planned for one in played]
        bounds, margins = self.judge.config.verdict, _tightest(planned)
        verdict = verdict_of(name, _result(played, planned, self.free), settings, bounds=bounds)
        if Limit.SCENE_DISTANCE in margins:
            verdict = blocked(verdict, margins[Limit.SCENE_DISTANCE], bounds)
        if Limit.HAND_FORCE in margins:
            verdict = too_hard(verdict, margins[Limit.HAND_FORCE])
        if opening.torque is not None:
            verdict = unheld(verdict, opening.torque)
        feasible, previewed = verdict.verdict == "feasible", all(one.previewed for one in planned)
        room = sorted((on_one_scale(one, feasible) for one in margins.values()), key=lambda one: one.share)
        return replace(verdict, method="fast", decided_by="preview" if previewed else "plan", margins=room)


def _tightest(planned: Iterable[Planned]) -> dict[Limit, Margin]:
    """Least room to every bound, the first where several are as tight."""
    least: dict[Limit, Margin] = {}
    for one in (margin for plan in planned for margin in plan.margins):
        if one.code not in least or one.share < least[one.code].share:
            least[one.code] = one
    return least


def _result(played: Sequence[Played], planned: Iterable[Planned], free: tuple[bool, bool]) -> EpisodeResult:
    """What chunks that were played come to, in the terms of an episode."""
    opening, fingers, spent, travelled = played[0].opening, dict[str, LimitExcess](), 0.0, 0.0
    for one in played:
        fingers |= {name: excess for name, excess in one.steps.fingers.items() if name not in fingers}
        spent, travelled = spent + one.spent, travelled + one.travelled
    times, moved, turned, still, fair, asked = (
        np.concatenate([getattr(one.steps, name) for one in played])
        for name in ("times", "moved", "moved_turns", "lags", "demandable", "asked")
    )
    reasons = [reason for one in played for reason in one.steps.reasons]
    slowdown, slowed_time = max([(1.0, 0.0), *(one.slowed for one in planned)], key=lambda slowed: slowed[0])
    return EpisodeResult(
        palms=PalmErrors(times, moved, turned, moved, turned, still, still, fair, reasons, fingers, asked=asked),
        orientation_free=free, time_factor=spent / travelled if travelled else 1.0,
        refusals=[one.refusal for one in planned if one.refusal is not None],
        notes=[note for one in played for note in one.notes], slowdown=slowdown, slowed_time=slowed_time,
        start=opening.start, start_jump=opening.jump, start_palms=opening.palms, fps=opening.fps, placed=opening.placed,
    )  # fmt: skip


def on_one_scale(one: Margin, feasible: bool) -> Margin:
    """A margin whose share is 0 at the most that is done as given, and negative beyond.

    A plan may exceed the bounds of a motion by their tolerances; what the chunk's own numbers exceed without moving a
    palm of a feasible input is at 0.
    """
    share = one.share if one.code in JUDGED_AT_ONCE else one.share + 1.0
    share = one.margin / one.bound if one.code in RATES and one.margin < 0.0 else share
    return replace(one, share=max(share, 0.0) if feasible else share)
