"""What speaks against an input, each with what it makes of the answer: from an episode to violations."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any

import numpy as np

from policy.action_spec.slot_values import CLIPPED, NOT_FOLLOWED, OUT_OF_RANGE
from policy.recorded.motion_csv import HANDS_ONLY
from policy.recorded.walked_motion import FAR_HANDS
from wholebody.config import START_MAX
from wholebody.config.verdict import VerdictConfig
from wholebody.episode.approach import approach_steps
from wholebody.episode.result import EpisodeResult
from wholebody.sim.limit_monitor import LimitExcess
from wholebody.types import PalmCause, Reason, Status

SLOWDOWN_FEASIBLE = 1.01
"""Time factor up to which a motion counts as unslowed; chosen, no trial is on record."""
TORQUE_TIME = 0.05
"""How long a motor may be asked for more than its limit [s]; chosen: less is a position loop's answer to a jolt."""
NOT_AS_GIVEN = (CLIPPED, NOT_FOLLOWED, OUT_OF_RANGE)
"""Words of notes on numbers that are not carried out as given."""
LISTED = 5
"""Violations of one kind that are listed: the worst."""
MOVING_REASONS = (
    Reason.OUT_OF_REACH, Reason.INTO_FLOOR, Reason.NOISY_CHUNK, Reason.STEPS_JUMP, Reason.POSTURE_INFEASIBLE,
)  # fmt: skip
"""Reasons for which a hand is commanded elsewhere than it was asked to be."""
ELSEWHERE = (*MOVING_REASONS, PalmCause.POSITION)
"""Kinds of violations in which a hand is commanded elsewhere than it was asked to be."""
HAND_REASONS = (*ELSEWHERE, PalmCause.ORIENTATION, PalmCause.LOST)
"""What hands are away from what they were asked or commanded: what is farthest past its bound comes first."""
FIRST = (Reason.FALL, Reason.REFUSED, Reason.NO_CHUNK, *ELSEWHERE, PalmCause.ORIENTATION, Reason.HAND_FORCE)
THEN = PalmCause.LOST, Reason.TOO_FAST_FOR_BALANCE, Reason.FAR_START, Reason.START_OFFSET, PalmCause.LATE
REST = (PalmCause.WAITING if reason is Reason.PALM_MISSED else reason for reason in Reason)
ORDER = tuple(dict.fromkeys((*FIRST, *THEN, *REST)))
"""Order of the kinds of violations that are equally severe: causes before what came of them."""
OF_THE_WHOLE = Reason.CHUNK_NOTE, Reason.CHANGED_NUMBERS, Reason.HANDS_ONLY
"""What is told of a recording when it is opened, and of any chunk."""
PALMS = ("left palm", "right palm")


class Severity(StrEnum):
    """What a violation makes of the answer; the worst one counts."""

    NOTE = "note"
    """Nothing: it is told."""
    REPAIR = "repair"
    """Done, but not as given."""
    INFEASIBLE = "infeasible"
    """Not done, or another motion was."""


REASON_SEVERITY = {
    None: Severity.NOTE,
    Status.TRACKING: Severity.NOTE,
    # What a slowed status does to the hands is measured.
    Status.SLOWED: Severity.NOTE,
    Status.HOLD: Severity.REPAIR,
    Status.STOP: Severity.REPAIR,
    Status.DAMPING: Severity.INFEASIBLE,
}
"""Severity of reasons that the controller had for a while, by the status that goes with them."""


@dataclass(frozen=True, kw_only=True)
class Violation:
    """One reason against an input.

    Attributes:
        code: Stable reason code.
        severity: What it makes of the answer.
        subject: Joint, body, hand or message that it is about.
        time: When first, or when worst, since the first row of the input [s]; None if it has no instant.
        step: The row of the input that is due then, from 0.
        value, bound: In SI units.
        unit: ``m``, ``rad``, ``N m``, ``s`` or empty.
        came_of: Code of the violation that it is a consequence of; None where it is none.
        cause: Why a palm was not where it was asked to be; None of what is about no palm.
    """

    code: Reason
    severity: Severity
    subject: str
    time: float | None = None
    step: int | None = None
    value: float = 0.0
    bound: float = 0.0
    unit: str = ""
    came_of: Reason | None = None
    cause: PalmCause | None = None

    @property
    def kind(self) -> Reason | PalmCause:
        """What it is told and ordered by: its cause, where it has one, or else its code."""
        return self.cause or self.code

    @property
    def margin(self) -> float:
        """Distance to the bound: negative, how far it was passed."""
        return -abs(self.value - self.bound)


def violations(result: EpisodeResult, bounds: VerdictConfig) -> list[Violation]:
    """Violations of an episode, worst first: by severity, then of hands by how far past the bound, else in `ORDER`."""
    found = [
        *_ends(result),
        *_moved(result, bounds),
        *_lost(result, bounds),
        *_slowed(result),
        *_start(result, bounds),
        *_limits(result),
        *_contacts(result),
        *_notes(result),
    ]
    kinds = {violation.kind for violation in found} | {refusal.reason for refusal in result.refusals}
    found += _reasons(result, kinds)
    found.sort(key=_rank)
    return [_of_input(violation, result) for violation in found]


def _rank(one: Violation) -> tuple[int, int, float, int]:
    """Where a violation is listed: distances and angles are compared by what share of their bound they are."""
    severity, place = list(reversed(Severity)).index(one.severity), ORDER.index(one.kind)
    if one.kind not in HAND_REASONS or one.bound <= 0.0:
        return severity, place, 0.0, place
    return severity, min(map(ORDER.index, HAND_REASONS)), -one.value / one.bound, place


def _ends(result: EpisodeResult) -> Iterator[Violation]:
    """Falls, refusals, and an input of which nothing was executed."""
    if result.fall is not None:
        subject, time = result.fall.cause, result.fall.time
        yield Violation(code=Reason.FALL, severity=Severity.INFEASIBLE, subject=subject, time=time)
    for first, times in _first_of_each((refusal.reason, refusal) for refusal in result.refusals):
        subject = f"{first.reason}{times}: {first.detail}"
        yield Violation(code=Reason.REFUSED, severity=Severity.INFEASIBLE, subject=subject, time=first.time)
    if not result.times.size:
        text = "no step of the input was executed"
        yield Violation(code=Reason.NO_CHUNK, severity=Severity.INFEASIBLE, subject=text, time=result.start)
    yield from _starved(result)


def _starved(result: EpisodeResult) -> Iterator[Violation]:
    """Time between chunks in which there was nothing to follow: none had come, or it was still being planned."""
    report, (first, seconds) = result.execution, result.palms.uncovered
    if report is not None and report.starved > seconds:
        first = next((event.time for event in report.events if event.code == Reason.STARVED), None)
        seconds = report.starved
    if seconds > 0.0:
        settings = {"subject": "chunks were over before the next ones came", "time": first, "value": seconds}
        yield Violation(code=Reason.STARVED, severity=Severity.REPAIR, **settings, unit="s")


def _moved(result: EpisodeResult, bounds: VerdictConfig) -> Iterator[Violation]:
    """Palms commanded elsewhere than asked, or turned away, at the steps' own times: the worst of each reason."""
    palms, first = result.palms, approach_steps(result, bounds)
    why = [reason if reason in MOVING_REASONS else PalmCause.POSITION for reason in palms.reasons]
    limits = bounds.palm_feasible, bounds.palm_repair
    for kind in ELSEWHERE:
        at = np.array([k for k in range(first, len(why)) if why[k] is kind], dtype=int)
        if at.size:
            worst = _worst(kind, palms.moved[at], palms.times[at], limits, "m")
            yield from () if worst.cause and worst.severity is Severity.NOTE else (worst,)
    turns = np.where(result.orientation_free, 0.0, palms.moved_turns)[first:]
    if turns.size:
        limits = bounds.turn_feasible, bounds.turn_repair
        worst = _worst(PalmCause.ORIENTATION, turns, palms.times[first:], limits, "rad")
        yield from () if worst.severity is Severity.NOTE else (worst,)


def _worst(
    kind: Reason | PalmCause, values: np.ndarray, times: np.ndarray, limits: tuple[float, float], unit: str
) -> Violation:
    """The largest of values (n, 2), with what it makes of the answer by the bounds of feasible and of repair."""
    if not values.size:
        return Violation(**_named(kind), severity=Severity.NOTE, subject=PALMS[0], unit=unit)
    step, side = np.unravel_index(values.argmax(), values.shape)
    value, (feasible, repair) = float(values.max()), limits
    if not value <= repair:
        severity, bound = Severity.INFEASIBLE, repair
    elif value > feasible:
        severity, bound = Severity.REPAIR, feasible
    else:
        severity, bound = Severity.NOTE, 0.0
    settings = {"subject": PALMS[int(side)], "time": float(times[step]), "value": value, "bound": bound}
    return Violation(**_named(kind), severity=severity, **settings, unit=unit)


def _named(kind: Reason | PalmCause) -> dict[str, Any]:
    """Code and cause of a violation of a kind."""
    return {"code": kind.code, "cause": kind} if isinstance(kind, PalmCause) else {"code": kind}


def _lost(result: EpisodeResult, bounds: VerdictConfig) -> Iterator[Violation]:
    """Palms measured elsewhere than commanded, and than asked."""
    palms, first, free = result.palms, approach_steps(result, bounds), result.orientation_free
    lag_turns, turns = (np.where(free, 0.0, x) for x in (palms.lag_turns, palms.turns))
    followed, asked = (PalmCause.LOST, Severity.INFEASIBLE, 0), (PalmCause.LATE, Severity.REPAIR, first)
    for (cause, severity, k), values, bound, unit in (
        (followed, palms.lags, bounds.palm_repair, "m"),
        (followed, lag_turns, bounds.turn_repair, "rad"),
        (asked, palms.errors, bounds.palm_feasible, "m"),
        (asked, turns, bounds.turn_feasible, "rad"),
    ):
        worst = _worst(cause, values[k:], palms.times[k:], (bound, bound), unit)
        if worst.severity is Severity.INFEASIBLE:
            yield replace(worst, severity=severity)


def _slowed(result: EpisodeResult) -> Iterator[Violation]:
    if result.slowdown > 1.0:
        settings = {"subject": "slow-down factor", "time": result.slowed_time, "value": result.slowdown, "bound": 1.0}
        yield Violation(code=Reason.TOO_FAST_FOR_BALANCE, severity=Severity.REPAIR, **settings)
    elif result.time_factor > SLOWDOWN_FEASIBLE:
        time, _ = result.first_reasons.get(Reason.PALM_MISSED, (None, ""))
        settings = {"subject": "time factor", "time": time, "value": result.time_factor, "bound": SLOWDOWN_FEASIBLE}
        yield Violation(**_named(PalmCause.WAITING), severity=Severity.REPAIR, **settings)


def _start(result: EpisodeResult, bounds: VerdictConfig) -> Iterator[Violation]:
    """A first step elsewhere than the hands: far, or a little."""
    distance, angle = result.start_jump
    turned = 0.0 if all(result.orientation_free) else angle
    for value, far, little, unit in (
        (distance, START_MAX[0], bounds.palm_feasible, "m"),
        (turned, START_MAX[1], bounds.turn_feasible, "rad"),
    ):
        settings = {"subject": "first step", "time": result.start, "value": value, "unit": unit}
        if value > far:
            yield Violation(code=Reason.FAR_START, severity=Severity.REPAIR, **settings, bound=far)
        elif value > little:
            yield Violation(code=Reason.START_OFFSET, severity=Severity.NOTE, **settings, bound=little)


def _limits(result: EpisodeResult) -> Iterator[Violation]:
    yield from _excesses(Reason.FINGER_LIMIT, Severity.REPAIR, result.palms.fingers, "rad")
    if result.edge is not None:
        edge = {"pressure": result.edge}
        (violation,) = _excesses(Reason.BALANCE_EDGE, Severity.NOTE, edge, "m")
        yield replace(violation, subject="centre of pressure")
    lasting = {joint: excess for joint, excess in result.torques.items() if excess.seconds > TORQUE_TIME}
    yield from _excesses(Reason.TORQUE_LIMIT, Severity.REPAIR, lasting, "N m")
    yield from _excesses(Reason.JOINT_LIMIT, Severity.NOTE, result.positions, "rad")


def _excesses(code: Reason, severity: Severity, found: dict[str, LimitExcess], unit: str) -> Iterator[Violation]:
    worst = sorted(found.items(), key=lambda item: -abs(item[1].worst - item[1].bound))
    for name, e in worst[:LISTED]:
        settings = {"subject": name, "time": e.first, "value": e.worst, "bound": e.bound}
        yield Violation(code=code, severity=severity, **settings, unit=unit)


def _contacts(result: EpisodeResult) -> Iterator[Violation]:
    own = Reason.SELF_CONTACT, Severity.REPAIR, result.contacts
    for code, severity, contacts in (own, (Reason.SCENE_CONTACT, Severity.NOTE, result.scene_contacts)):
        for pair, time in sorted(contacts.items(), key=lambda item: item[1])[:LISTED]:
            yield Violation(code=code, severity=severity, subject=" - ".join(pair), time=time)


def _notes(result: EpisodeResult) -> Iterator[Violation]:
    """The first of all notes that differ in their numbers only, with how many there were."""
    for note, times in _first_of_each((re.sub(r"[\d.]+", "", note.text), note) for note in result.notes):
        if note.text.startswith(HANDS_ONLY):
            yield Violation(code=Reason.HANDS_ONLY, severity=Severity.REPAIR, subject=note.text, time=note.time)
            continue
        subject = f"{note.text}{times and f',{times}'}"
        changed = any(words in note.text for words in NOT_AS_GIVEN)
        code, severity = (Reason.CHANGED_NUMBERS, Severity.REPAIR) if changed else (Reason.CHUNK_NOTE, Severity.NOTE)
        severity = Severity.INFEASIBLE if note.text.startswith(FAR_HANDS) else severity
        yield Violation(code=code, severity=severity, subject=subject, time=note.time)


def _reasons(result: EpisodeResult, known: set[Reason | PalmCause]) -> Iterator[Violation]:
    """Reasons of the controller that no other violation covers: for how long, when first, with which detail.

    Before the first chunk there is nothing to follow, and after the last one nothing is starved of anything.
    """
    for reason, seconds in result.reasons.items():
        kind = PalmCause.WAITING if reason is Reason.PALM_MISSED else reason
        if kind in known or reason in (Reason.NO_CHUNK, Reason.STARVED):
            continue
        time, detail = result.first_reasons.get(reason, (None, reason.sentence))
        # What is said of a slowed status is about the whole plan.
        detail = kind.sentence if reason.status is Status.SLOWED else detail
        if reason in (Reason.WALKING, Reason.RECOVERING):
            what, mark, then = detail.partition(";")
            count = len(result.steps)
            detail = f"{what} in {count} step{'' if count == 1 else 's'}{mark}{then}"
        # A run that ends before the robot is down has no fall yet.
        severity = Severity.INFEASIBLE if reason is Reason.DESCENDING else REASON_SEVERITY[reason.status]
        yield Violation(**_named(kind), severity=severity, subject=detail, time=time, value=seconds, unit="s")


def _first_of_each[T](pairs: Iterable[tuple[str, T]]) -> Iterator[tuple[T, str]]:
    """The first item of each kind, at most `LISTED`, and ``" n times"`` if there were several."""
    kinds: dict[str, list[T]] = {}
    for kind, item in pairs:
        kinds.setdefault(kind, []).append(item)
    for items in list(kinds.values())[:LISTED]:
        yield items[0], f" {len(items)} times" if len(items) > 1 else ""


def _of_input(violation: Violation, result: EpisodeResult) -> Violation:
    """A violation in the time and the rows of the input; what is told of its first chunk is about all of it."""
    if violation.time is None or (violation.code in OF_THE_WHOLE and violation.time <= result.start + 1e-9):
        return replace(violation, time=None)
    time = violation.time - result.start
    time = 0.0 if abs(time) < 1e-9 else time
    return replace(violation, time=time, step=round(time * result.fps) if result.fps > 0.0 and time >= 0.0 else None)
