"""The answer about an input, and how an episode leads to it."""

from __future__ import annotations

import platform
import re
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass, field, replace
from importlib.metadata import version
from math import isfinite
from typing import Literal

import numpy as np

from wholebody.config import START_MAX
from wholebody.episode.run import EpisodeResult
from wholebody.episode.timing import Timing, timing
from wholebody.sim.limit_monitor import LimitExcess
from wholebody.types import Reason

Answer = Literal["feasible", "feasible_after_repair", "infeasible"]

ERROR_FEASIBLE = 0.02
"""Largest palm error of a step that counts as reached [m]."""
BEND_MAX = 0.05
"""How far a hand may be moved for the motion to count as repaired; further away it is another motion [m]."""
SLOWDOWN_FEASIBLE = 1.01
"""Time factor up to which a motion counts as unslowed."""
TORQUE_TIME = 0.05
"""How long a motor may be asked for more than its limit; less is a position loop's answer to a jolt [s]."""
LISTED = 5
"""Violations of one kind that are listed: the worst."""
PACKAGES = ("g1-wholebody", "mujoco", "pin", "placo", "daqp", "numpy")


@dataclass(frozen=True, kw_only=True)
class Violation:
    """One reason against an input.

    Attributes:
        code: Stable reason code.
        subject: Joint, body, hand or message that it is about.
        time: When first, or when worst, in simulated time [s]; None if it has no instant.
        step: The same in steps of the input, from 0.
        value, bound: In SI units.
        unit: ``m``, ``rad``, ``N m``, ``s`` or empty.
    """

    code: Reason
    subject: str
    time: float | None = None
    step: int | None = None
    value: float = 0.0
    bound: float = 0.0
    unit: str = ""

    @property
    def margin(self) -> float:
        """Distance to the bound: negative, how far it was passed."""
        return -abs(self.value - self.bound)


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """The answer with its reasons.

    Attributes:
        name: Input.
        verdict: ``feasible`` as given; ``feasible_after_repair``: slowed, or a hand moved by at most `BEND_MAX`;
            ``infeasible``: falls, is refused, would have to be another motion, or the hands lose what they are
            commanded by more than `BEND_MAX`.
        fell: Whether the robot fell in simulation.
        violations: Worst first.
        rms_m, max_m, end_m: Palm errors over all steps, and at the last one [m].
        turn_rms_rad, turn_max_rad, turn_end_rad: Errors of the palms' orientations, likewise [rad].
        time_factor: Time taken over time asked for.
        seconds: Time per status [s].
        reasons: Time per reason code [s].
        demandable_share: Share of the steps that could be asked for (`wholebody.episode.tracking_error.demandable`).
        demandable_rms_m, demandable_max_m: Palm errors over those [m].
        within_20mm: Share of those within 20 mm.
        pressure_margin_m: Least distance of the centre of pressure from the edge of the soles [m].
        creep_m: How far a sole slid [m].
        timing: Latency, starvation and seams.
        config: The controller's configuration.
        versions: Versions that the answer depends on.
    """

    name: str
    verdict: Answer
    fell: bool
    violations: list[Violation] = field(default_factory=list)
    rms_m: float = 0.0
    max_m: float = 0.0
    end_m: float = 0.0
    turn_rms_rad: float = 0.0
    turn_max_rad: float = 0.0
    turn_end_rad: float = 0.0
    time_factor: float = 1.0
    seconds: dict[str, float] = field(default_factory=dict)
    reasons: dict[str, float] = field(default_factory=dict)
    demandable_share: float = 1.0
    demandable_rms_m: float = 0.0
    demandable_max_m: float = 0.0
    within_20mm: float = 1.0
    pressure_margin_m: float | None = None
    creep_m: float = 0.0
    timing: Timing = field(default_factory=Timing)
    config: dict = field(default_factory=dict)
    versions: dict[str, str] = field(default_factory=dict)

    def as_dict(self) -> dict:
        """Plain data for JSON, as `verdict.schema.json` describes it."""
        return asdict(self) | {"violations": [asdict(v) | {"margin": v.margin} for v in self.violations]}


def judge(name: str, result: EpisodeResult, config: dict | None = None) -> Verdict:
    """Verdict on an episode.

    Args:
        name: What to call the input.
        result: What happened.
        config: The controller's configuration as plain data, for the record.
    """
    errors, turns, fair = result.errors, result.turns, result.errors[result.demandable]
    return Verdict(
        name=name,
        verdict=_answer(result),
        fell=result.fall is not None,
        violations=_violations(result),
        rms_m=result.rms,
        max_m=_largest(errors),
        end_m=_largest(errors[-1:]),
        turn_rms_rad=_rms(turns),
        turn_max_rad=_largest(turns),
        turn_end_rad=_largest(turns[-1:]),
        time_factor=result.time_factor,
        seconds=dict(result.seconds),
        reasons=dict(result.reasons),
        demandable_share=float(result.demandable.mean()) if result.demandable.size else 1.0,
        demandable_rms_m=_rms(fair),
        demandable_max_m=_largest(fair),
        within_20mm=float((fair <= ERROR_FEASIBLE).mean()) if fair.size else 1.0,
        pressure_margin_m=result.margin if isfinite(result.margin) else None,
        creep_m=result.creep,
        timing=timing(result),
        config=config or {},
        versions={"python": platform.python_version()} | {package: version(package) for package in PACKAGES},
    )


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2))) if values.size else 0.0


def _largest(values: np.ndarray) -> float:
    return float(values.max()) if values.size else 0.0


def _answer(result: EpisodeResult) -> Answer:
    other_motion = max(result.clamped, _largest(result.lags)) > BEND_MAX
    if result.fall is not None or result.refusals or other_motion:
        return "infeasible"
    slowed = result.slowdown > 1.0 or result.time_factor > SLOWDOWN_FEASIBLE
    missed = _largest(result.errors) > ERROR_FEASIBLE
    if result.clamped > 0.0 or slowed or missed or result.contacts or _lasting(result.torques):
        return "feasible_after_repair"
    return "feasible"


def _violations(result: EpisodeResult) -> list[Violation]:
    """From what ends a motion to what only marks it; within a kind the worst first."""
    found = []
    if result.fall is not None:
        found.append(Violation(code=Reason.FALL, subject=result.fall.cause, time=result.fall.time))
    found += _refusals(result)
    found += _plan_violations(result)
    found += _palm_violations(Reason.TRACKING_ERROR, result.errors, result.times, ERROR_FEASIBLE)
    if result.edge is not None:
        edge = result.edge
        found.append(_metres(Reason.BALANCE_EDGE, "centre of pressure", edge.first, edge.worst, edge.bound))
    found += _excesses(Reason.TORQUE_LIMIT, _lasting(result.torques), "N m")
    found += _excesses(Reason.JOINT_LIMIT, result.positions, "rad")
    for code, contacts in ((Reason.SELF_CONTACT, result.contacts), (Reason.SCENE_CONTACT, result.scene_contacts)):
        first = sorted(contacts.items(), key=lambda item: item[1])[:LISTED]
        found += [Violation(code=code, subject=" - ".join(pair), time=time) for pair, time in first]
    found += _notes(result)
    return [_with_step(violation, result) for violation in found]


def _refusals(result: EpisodeResult) -> Iterator[Violation]:
    """The first of every reason, with how many there were: a policy that fails is asked again four times a second."""
    for first, times in _first_of_each((refusal.reason, refusal) for refusal in result.refusals):
        yield Violation(code=Reason.REFUSED, subject=f"{first.reason}{times}: {first.detail}", time=first.time)


def _notes(result: EpisodeResult) -> Iterator[Violation]:
    """The first of all notes that differ in their numbers only, with how many there were."""
    for note, times in _first_of_each((re.sub(r"[\d.]+", "", note.text), note) for note in result.notes):
        yield Violation(code=Reason.CHUNK_NOTE, subject=f"{note.text}{times and f',{times}'}", time=note.time)


def _first_of_each[T](pairs: Iterable[tuple[str, T]]) -> Iterator[tuple[T, str]]:
    """The first item of each kind, at most `LISTED`, and ``" n times"`` if there were several."""
    kinds: dict[str, list[T]] = {}
    for kind, item in pairs:
        kinds.setdefault(kind, []).append(item)
    for items in list(kinds.values())[:LISTED]:
        yield items[0], f" {len(items)} times" if len(items) > 1 else ""


def _plan_violations(result: EpisodeResult) -> Iterator[Violation]:
    if result.clamped > 0.0:
        bound = BEND_MAX if result.clamped > BEND_MAX else 0.0
        yield _metres(Reason.OUT_OF_REACH, f"{result.clamped_hand} hand", result.clamped_time, result.clamped, bound)
    yield from _palm_violations(Reason.NOT_FOLLOWED, result.lags, result.times, BEND_MAX)
    if result.slowdown > 1.0:
        subject, time = "slow-down factor", result.slowed_time
        yield Violation(code=Reason.TOO_FAST_FOR_BALANCE, subject=subject, time=time, value=result.slowdown, bound=1.0)
    for value, bound, unit in zip(result.start_jump, START_MAX, ("m", "rad"), strict=True):
        if value > bound:
            settings = {"subject": "first step", "time": result.start, "value": value, "bound": float(bound)}
            yield Violation(code=Reason.FAR_START, **settings, unit=unit)


def _palm_violations(code: Reason, errors: np.ndarray, times: np.ndarray, bound: float) -> Iterator[Violation]:
    """The worst of both palms, if it is past the bound."""
    if _largest(errors) > bound:
        step, side = np.unravel_index(errors.argmax(), errors.shape)
        yield _metres(code, ("left palm", "right palm")[int(side)], float(times[step]), _largest(errors), bound)


def _lasting(torques: dict[str, LimitExcess]) -> dict[str, LimitExcess]:
    return {joint: excess for joint, excess in torques.items() if excess.seconds > TORQUE_TIME}


def _excesses(code: Reason, found: dict[str, LimitExcess], unit: str) -> Iterator[Violation]:
    worst = sorted(found.items(), key=lambda item: -abs(item[1].worst - item[1].bound))
    for joint, e in worst[:LISTED]:
        yield Violation(code=code, subject=joint, time=e.first, value=e.worst, bound=e.bound, unit=unit)


def _metres(code: Reason, subject: str, time: float, value: float, bound: float) -> Violation:
    return Violation(code=code, subject=subject, time=time, value=value, bound=bound, unit="m")


def _with_step(violation: Violation, result: EpisodeResult) -> Violation:
    if violation.time is None or result.fps <= 0.0 or violation.time < result.start:
        return violation
    return replace(violation, step=round((violation.time - result.start) * result.fps))
