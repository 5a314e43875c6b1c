"""The answer about an input, and how an episode leads to it."""

from __future__ import annotations

import platform
from dataclasses import asdict, dataclass, field, replace
from functools import cache
from importlib.metadata import version
from math import isfinite
from typing import Literal

import numpy as np

from wholebody.config.verdict import VerdictConfig
from wholebody.episode.approach import approach_steps
from wholebody.episode.result import EpisodeResult
from wholebody.episode.timing import Timing, timing
from wholebody.planning.judgement.limits import Margin
from wholebody.sim.limit_monitor import StepMade
from wholebody.sim.motor_heat import MotorHeat
from wholebody.types import Reason
from wholebody.verdict.calibration.odds import Odds
from wholebody.verdict.causes import Tick, Why, WouldDo
from wholebody.verdict.consequences import folded
from wholebody.verdict.summaries import GateSummary, Worlds
from wholebody.verdict.violations import Severity, Violation, violations
from wholebody.verdict.why.headline import first_line, headline

Answer = Literal["feasible", "feasible_after_repair", "infeasible"]
Follow = Literal["planned", "gated", "as_given"]

ANSWERS: dict[Severity, Answer] = {
    Severity.INFEASIBLE: "infeasible",
    Severity.REPAIR: "feasible_after_repair",
    Severity.NOTE: "feasible",
}
"""The answer by the worst violation; without any, feasible."""
WITHIN_20_MM = 0.02
"""Palm error of `Verdict.within_20mm` [m]; definition."""
SCHEMA = 3
"""Version of a verdict as JSON; docs/verdict.md says what each one changed."""
PACKAGES = ("g1-wholebody", "mujoco", "pin", "placo", "daqp", "numpy")


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """The answer with its reasons.

    Attributes:
        name: Input.
        verdict: What the worst violation makes of it: ``feasible`` as given, ``feasible_after_repair``: slowed, or
            with a hand moved by at most the bound of repair, ``infeasible``: not executed, another motion, or a fall.
        fell: Whether the robot fell in simulation.
        fps: Rows a second of the input as it was given, which steps count [Hz]; 0 where no chunk came.
        violations: Worst first, each followed by what came of it.
        rms_m, max_m, end_m: Palm errors over all rows after the approach, and at the last one [m].
        turn_rms_rad, turn_max_rad, turn_end_rad: Errors of the palms' orientations, likewise [rad].
        moved_max_m, moved_turn_max_rad: Largest distance and angle of a commanded palm from what was asked at the
            step's own time, after the approach [m], [rad]; an orientation that is free counts here too.
        start_m, start_rad: How far the first step was from the hands [m], [rad].
        approach_s: Time until hands that were elsewhere had joined the first chunk [s].
        time_factor: Time taken over time asked for.
        seconds: Time per status [s].
        reasons: Time per reason code [s].
        demandable_share: Share of the steps that could be asked for (`wholebody.episode.tracking_error.demandable`).
        demandable_rms_m, demandable_max_m: Palm errors over those [m].
        within_20mm: Share of those within 20 mm.
        pressure_margin_m: Least distance of the centre of pressure from the edge of the soles [m].
        creep_m: How far a sole slid [m].
        steps: Feet that were set down; none where the robot stood, and by the fast check, which takes no step.
        heat: Motors that were heated most, an ankle first; none by the fast check.
        timing: Latency, starvation and seams.
        config: The controller's configuration.
        versions: Versions that the answer depends on.
        robot: Which robot was simulated: ``true``, or how it differed, with the seed.
        method: ``simulated``, or ``fast``: by plans alone.
        follow: How chunks were followed: ``planned``, ``gated``: those that the gate let through, or ``as_given``.
        gate: What the gate made of them; None without one.
        fast: Of a simulated one, what the fast check had said before; None where there was none.
        worlds: What became of it in realistic worlds, where it was asked for; else None.
        decided_by: By the fast check, whether previews told, or plans had to be searched for; else empty.
        margins: By the fast check, the least room to each kind of bound, the tightest first.
        odds: By the fast check, how likely a fall as given is, and that the supervisor follows; else None.
        causes: Where it was asked why: which bounds together forbid the first chunk that is not done as given.
        would_do: Single changes of that chunk, each of which makes it feasible by its plan.
        why_complete: Whether these two were looked for to the end, which the time for it did not cut short.
        search_finds: Where it was asked why and there is no cause: whether a plan, or a search with more effort than
            one has, finds a motion that does what was not done as given.
        tick: What the tick's program says of that chunk's hands as given; None where they lack nothing.
    """

    name: str
    verdict: Answer
    fell: bool
    fps: float = 0.0
    violations: list[Violation] = field(default_factory=list)
    rms_m: float = 0.0
    max_m: float = 0.0
    end_m: float = 0.0
    turn_rms_rad: float = 0.0
    turn_max_rad: float = 0.0
    turn_end_rad: float = 0.0
    moved_max_m: float = 0.0
    moved_turn_max_rad: float = 0.0
    start_m: float = 0.0
    start_rad: float = 0.0
    approach_s: float = 0.0
    time_factor: float = 1.0
    seconds: dict[str, float] = field(default_factory=dict)
    reasons: dict[str, float] = field(default_factory=dict)
    demandable_share: float = 1.0
    demandable_rms_m: float = 0.0
    demandable_max_m: float = 0.0
    within_20mm: float = 1.0
    pressure_margin_m: float | None = None
    creep_m: float = 0.0
    steps: list[StepMade] = field(default_factory=list)
    heat: list[MotorHeat] = field(default_factory=list)
    timing: Timing = field(default_factory=Timing)
    config: dict = field(default_factory=dict)
    versions: dict[str, str] = field(default_factory=dict)
    robot: str = "true"
    method: Literal["simulated", "fast"] = "simulated"
    follow: Follow = "planned"
    gate: GateSummary | None = None
    fast: Answer | None = None
    worlds: Worlds | None = None
    decided_by: Literal["", "preview", "plan"] = ""
    margins: list[Margin] = field(default_factory=list)
    odds: Odds | None = None
    causes: list[Why] = field(default_factory=list)
    would_do: list[WouldDo] = field(default_factory=list)
    why_complete: bool = True
    search_finds: bool = False
    tick: Tick | None = None

    def __str__(self) -> str:
        """The answer, the input, and one sentence about it, in two lines of a terminal."""
        return first_line(self, self.name)

    @property
    def headline(self) -> str:
        """One sentence that a person can act on, the same wherever a verdict is told."""
        return headline(self)

    def as_dict(self) -> dict:
        """Plain data for JSON, as `verdict.schema.json` describes it."""
        plain = asdict(replace(self, would_do=[replace(one, chunk=None) for one in self.would_do]))
        for one in plain["would_do"]:
            del one["chunk"]
        derived = {"violations": [asdict(v) | {"margin": v.margin} for v in self.violations], "headline": self.headline}
        return {"schema": SCHEMA} | plain | derived


def with_why(verdict: Verdict, asked: Verdict) -> Verdict:
    """A verdict with what another one on the same input found when it was asked why; nothing where that is feasible."""
    names = "causes", "would_do", "why_complete", "search_finds", "tick"
    explained = replace(verdict, **{name: getattr(asked, name) for name in names})
    return replace(explained, search_finds=True) if asked.verdict == "feasible" else explained


def verdict_of(
    name: str, result: EpisodeResult, config: dict | None = None, *, bounds: VerdictConfig | None = None
) -> Verdict:
    """Verdict on an episode.

    Args:
        name: What to call the input.
        result: What happened.
        config: The controller's configuration as plain data, for the record.
        bounds: How far palms may be from what was asked.
    """
    bounds = bounds or VerdictConfig()
    found = folded(violations(result, bounds))
    palms, joined = result.palms, approach_steps(result, bounds)
    errors, turns, fair = palms.errors[joined:], palms.turns[joined:], palms.errors[palms.demandable]
    return Verdict(
        name=name,
        verdict=ANSWERS[found[0].severity] if found else "feasible",
        fell=result.fall is not None,
        fps=result.fps,
        violations=found,
        rms_m=_rms(errors),
        max_m=_largest(errors),
        end_m=_largest(errors[-1:]),
        turn_rms_rad=_rms(turns),
        turn_max_rad=_largest(turns),
        turn_end_rad=_largest(turns[-1:]),
        moved_max_m=_largest(palms.moved[joined:]),
        moved_turn_max_rad=_largest(palms.moved_turns[joined:]),
        start_m=result.start_jump[0],
        start_rad=result.start_jump[1],
        approach_s=float(palms.times[joined] - palms.times[0]) if joined else 0.0,
        time_factor=result.time_factor,
        seconds=dict(result.seconds),
        reasons=dict(result.reasons),
        demandable_share=float(palms.demandable.mean()) if palms.demandable.size else 1.0,
        demandable_rms_m=_rms(fair),
        demandable_max_m=_largest(fair),
        within_20mm=float((fair <= WITHIN_20_MM).mean()) if fair.size else 1.0,
        pressure_margin_m=result.margin if isfinite(result.margin) else None,
        creep_m=result.creep,
        steps=list(result.steps),
        heat=list(result.heat),
        timing=timing(result),
        config=config or {},
        versions=dict(_versions()),
    )


def blocked(verdict: Verdict, scene: Margin, bounds: VerdictConfig) -> Verdict:
    """A fast verdict of hands or a plan that go into the scene: no plan goes around it.

    A hand stays outside, as far off as it is asked inside; its bound is that of a palm as given, of anything else less.
    """
    if scene.value >= 0.0:
        return verdict
    severity = Severity.INFEASIBLE if scene.margin < 0.0 else Severity.NOTE
    if severity is Severity.INFEASIBLE and scene.bound <= -bounds.palm_feasible and scene.value >= -bounds.palm_repair:
        severity = Severity.REPAIR
    return _with(verdict, Reason.SCENE_CONTACT, severity, scene)


def too_hard(verdict: Verdict, force: Margin) -> Verdict:
    """A fast verdict of hands that are told to push harder than the robot can, with what would do."""
    if force.margin >= 0.0:
        return verdict
    softer = WouldDo("softer", force=force.bound, hand=force.subject, step=force.step)
    found = _with(verdict, Reason.HAND_FORCE, Severity.INFEASIBLE, force)
    return replace(found, would_do=[*found.would_do, softer])


def unheld(verdict: Verdict, still: Margin) -> Verdict:
    """A fast verdict of a robot whose motors do not hold it, with what it carries, where the input begins."""
    if still.share >= 0.0:
        return verdict
    severity = Severity.INFEASIBLE if still.share <= -1.0 else Severity.REPAIR
    return _with(verdict, Reason.TORQUE_LIMIT, severity, still)


def _with(verdict: Verdict, code: Reason, severity: Severity, one: Margin) -> Verdict:
    """Verdict with one more violation, made of a margin."""
    more = Violation(
        code=code, severity=severity, subject=one.subject, time=one.time, step=one.step, value=one.value,
        bound=one.bound, unit=one.unit,
    )  # fmt: skip
    worst = list(reversed(Severity))
    found = sorted([*verdict.violations, more], key=lambda x: worst.index(x.severity))
    return replace(verdict, violations=found, verdict=ANSWERS[found[0].severity])


@cache
def _versions() -> dict[str, str]:
    """Looked up once: each is a file to be read."""
    return {"python": platform.python_version()} | {package: version(package) for package in PACKAGES}


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2))) if values.size else 0.0


def _largest(values: np.ndarray) -> float:
    return float(values.max()) if values.size else 0.0
