"""Verdicts as text for a terminal and as JSON."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import takewhile
from pathlib import Path

import numpy as np

from wholebody.planning.judgement.limits import Margin
from wholebody.types import PalmCause, Reason
from wholebody.verdict.calibration.odds import Chance, Odds
from wholebody.verdict.causes import Tick
from wholebody.verdict.quantity import at, due, heated, quantity, size_text, stepped, when
from wholebody.verdict.summaries import GateSummary, Worlds
from wholebody.verdict.verdict import Verdict
from wholebody.verdict.violations import ELSEWHERE, Severity, Violation
from wholebody.verdict.why.headline import OF_A_HAND, below

_MOVED = "{subject} commanded {value} from where it was asked to be (bound {bound})"
PHRASES = {
    **dict.fromkeys(ELSEWHERE, _MOVED),
    PalmCause.ORIENTATION: "{subject} commanded {value} from how it was asked to be turned (bound {bound})",
    PalmCause.LOST: "{subject} {value} from where it was commanded to be (bound {bound})",
    Reason.TOO_FAST_FOR_BALANCE: "{subject} {value} (bound {bound})",
    PalmCause.WAITING: "{subject} {value} (bound {bound})",
    Reason.FAR_START: "{subject} {value} from where the hands were (bound {bound})",
    Reason.START_OFFSET: "{subject} {value} from where the hands were (bound {bound})",
    PalmCause.LATE: "{subject} {value} from where it was asked to be (bound {bound})",
    Reason.FINGER_LIMIT: "{subject} asked to be at {value} (bound {bound})",
    Reason.BALANCE_EDGE: "{subject} {value} inside the soles (bound {bound})",
    Reason.TORQUE_LIMIT: "{subject} asked for {value} (bound {bound})",
    Reason.JOINT_LIMIT: "{subject} at {value} (bound {bound})",
}
"""What a violation with a number and a bound says; one in seconds says how long, the others are their subject alone."""

WORTH_A_LINE = 5e-4
"""Distance below which a note on a hand is no line of its own [m]; chosen: rounding."""
SEARCH_FINDS = "no bound: a plan, or a search with more effort, finds a motion, once the hands are on the chunk"
MORE_CAUSES, NO_CAUSE_YET = "there may be more causes, and smaller changes that would do", "no cause was found yet"
ROWS = {
    "torque": "torque of {}",
    "friction": "friction",
    "balance": "balance",
    "distance": "distance of {}",
    "floor": "height of {}",
    "acceleration": "acceleration of a joint",
    "force": "load of the soles",
    "pelvis": "turn of the pelvis",
    "torso_link": "turn of the torso",
}
"""Bounds of the tick's program by what their rows' names begin with."""


def lines(verdict: Verdict) -> list[str]:
    """The verdict first, then what it means, then the worst violations, then how it went."""
    text = [str(verdict), *below(verdict)]
    text += [f"  because  {one.sentence}" for one in verdict.causes]
    if verdict.search_finds:
        text.append(f"  because  {SEARCH_FINDS}")
    if not verdict.why_complete:
        text.append(f"  the time for it ended: {MORE_CAUSES if verdict.causes else NO_CAUSE_YET}")
    if verdict.tick is not None:
        text.append(f"  {tick_line(verdict.tick)}")
    text += _violation_lines(verdict)
    if verdict.method == "fast":
        return text + _fast_lines(verdict)
    text.append(
        f"  palms    {1e3 * verdict.rms_m:.2f} mm RMS, {1e3 * verdict.max_m:.2f} mm at most, "
        f"{1e3 * verdict.end_m:.2f} mm at the end; turned by {np.rad2deg(verdict.turn_rms_rad):.2f} deg RMS, "
        f"{np.rad2deg(verdict.turn_max_rad):.2f} deg at most"
    )
    text.append(f"  time     factor {verdict.time_factor:.3f}; {_durations(verdict)}")
    text += _approach(verdict)
    if verdict.follow == "as_given":
        text.append("  as given without plans, filters or gate: the whole-body program alone")
    if verdict.gate is not None:
        text.append(f"  gate     {_gate(verdict.gate)}")
    if verdict.worlds is not None:
        text.append(f"  worlds   {_worlds(verdict.worlds)}")
    if verdict.robot != "true":
        text.append(f"  robot    {verdict.robot}")
    margin = verdict.pressure_margin_m
    room = "" if margin is None else f"centre of pressure at least {round(1e3 * margin)} mm inside the soles; "
    text.append(f"  balance  {room}feet slid {1e3 * verdict.creep_m:.1f} mm")
    text += [f"  steps    {stepped(verdict.steps)}"] if verdict.steps else []
    text += [f"  heat     {heated(verdict.heat)}"] if verdict.heat else []
    text.append(f"  chunks   {verdict.timing.text()}")
    if verdict.fast is not None:
        by = "a preview" if verdict.decided_by == "preview" else "its plan"
        text.append(f"  fast     {verdict.fast.replace('_', ' ')} by {by}, before anything was simulated")
    return text


def _violation_lines(verdict: Verdict) -> list[str]:
    """A line each, and for each cause one of what came of it, once a code."""
    text, violations = [], verdict.violations
    for k, cause in enumerate(violations):
        slight = cause.severity is Severity.NOTE and cause.unit == "m" and cause.value < WORTH_A_LINE
        if cause.came_of is not None or slight:
            continue
        text.append(f"  {violation_line(cause, verdict.fps)}")
        counts = Counter(map(_name, takewhile(lambda one: one.came_of is not None, violations[k + 1 :])))
        if counts:
            came = (f"{name} {n} times" if n > 1 else name for name, n in counts.items())
            text.append(f"    of which came {', '.join(came)}")
    return text


def _fast_lines(verdict: Verdict) -> list[str]:
    """What a verdict without a simulation has to say: how far palms are moved, how it was found, the least room."""
    text = [
        f"  palms    moved by {1e3 * verdict.moved_max_m:.1f} mm and {np.rad2deg(verdict.moved_turn_max_rad):.1f} deg "
        f"at most; time factor {verdict.time_factor:.3f}",
        f"  judged   by {'a preview' if verdict.decided_by == 'preview' else 'a search for a plan'}, nothing simulated",
    ]
    text += _approach(verdict)
    if verdict.odds is not None:
        text += odds_lines(verdict.odds)
    # Of what is done as given, bounds that are exceeded are those of the way to it.
    joined = np.inf if verdict.verdict == "feasible" else verdict.approach_s
    room = [one for one in verdict.margins if one.margin >= 0.0 or one.time >= joined]
    shown = (margin_line(one, verdict.fps) for one in room[:5])
    return text + [f"  {'room' if i == 0 else '':8s} {line}" for i, line in enumerate(shown)]


def odds_lines(odds: Odds) -> list[str]:
    """Probabilities for people, and in what the input is unlike those that they come from."""
    fall, followed = odds.fall_as_given, odds.followed
    when = [f" (chunk at {time:.1f} s)" if odds.chunks > 1 else "" for time in (odds.fall_s, odds.followed_s)]
    text = [
        f"  odds     falls as given {_chance(fall)}{when[0]}; followed within 20 mm {_chance(followed)}{when[1]}; "
        f"{odds.world} robot; fitted to {odds.fitted_to} chunks"
    ]
    if odds.unlike:
        text.append(f"  odds     a guess: unlike what they were fitted to in {', '.join(odds.unlike)}")
    return text


def _chance(chance: Chance) -> str:
    return f"{100 * chance.p:.0f} % ({100 * chance.low:.0f} to {100 * chance.high:.0f})"


def _approach(verdict: Verdict) -> Iterator[str]:
    """Where hands began that were not at the first row, and for how long they were on their way."""
    if verdict.approach_s or verdict.start_m > 1e-3:
        way = "which every row counts from"
        if verdict.approach_s:
            way = f"which are there after {verdict.approach_s:.2f} s; the palms above are from then on"
        yield f"  start    {1e3 * verdict.start_m:.0f} mm from the hands, {way}"


def margin_line(margin: Margin, fps: float = 0.0) -> str:
    """A margin for people: what, where, value and bound, of an input with so many rows a second [Hz]."""
    value, bound = (quantity(number, margin.unit) for number in (margin.value, margin.bound))
    return f"{margin.code}: {margin.subject} {value} (bound {bound}) at {due(margin.step, fps)}"


def tick_line(tick: Tick) -> str:
    """What the tick's program says, the bounds alone: what moves and what is asked for takes part in every proof."""
    bounds = [name for name in tick.rows if name.partition(".")[0] in ROWS]
    kinds = [ROWS[name.partition(".")[0]].format(name.partition(".")[2].replace(".", " and ")) for name in bounds]
    text = ", ".join(f"{kind} ({n} rows)" if n > 1 else kind for kind, n in Counter(kinds).most_common(5))
    if tick.proven:
        return f"proven   at {tick.time:.2f} s no acceleration takes the hands along: {text or 'whatever the bounds'}"
    return f"limits   at {tick.time:.2f} s hands fall short most, held back by {text or 'other tasks'}"


def to_json(verdicts: Sequence[Verdict]) -> str:
    """A JSON list of verdicts, one a line, as `verdict.schema.json` describes it."""
    return "[\n" + ",\n".join(map(json_line, verdicts)) + "\n]"


def json_line(verdict: Verdict) -> str:
    """A verdict as one line of JSON, never with NaN or Infinity."""
    return json.dumps(verdict.as_dict(), allow_nan=False)


def _worlds(worlds: Worlds) -> str:
    """Line that says in how many realistic worlds an input held."""
    n, seeds = len(worlds.seeds), worlds.seeds
    fell = f"; fell with seeds {', '.join(map(str, worlds.fell))}" if worlds.fell else "; none fell"
    return (
        f"{worlds.held} of {n} realistic worlds held, seeds {seeds[0]} to {seeds[-1]}: {100 * worlds.low:.1f} to "
        f"{100 * worlds.high:.1f} % of all, with {100 * worlds.level:.0f} % confidence{fell}; palms "
        f"{1e3 * worlds.max_m:.0f} mm off at most"
    )


def _gate(gate: GateSummary) -> str:
    """What the gate made of an input."""
    text = f"{gate.cleared} chunks cleared, {gate.repaired} repaired, {gate.rejected} rejected"
    if gate.repaired:
        text += f"; repairs: {size_text(gate.slower_max, gate.moved_max_m, gate.turned_max_rad)} at most"
    if gate.reasons:
        text += f"; {', '.join(f'{code} {count}' for code, count in gate.reasons.items())}"
    late = f"; {gate.late} came too late" if gate.late else ""
    return f"{text}{late}; judging took {1e3 * gate.seconds_max:.0f} ms at most"


def _durations(verdict: Verdict) -> str:
    return ", ".join(f"{name} {time:.1f} s" for name, time in verdict.seconds.items()) or "nothing was run"


def violation_line(violation: Violation, fps: float = 0.0) -> str:
    """A violation for people: code, what, how much, when; of an input with so many rows a second [Hz]."""
    if violation.unit == "s":
        begun = when(violation.time, violation.step, fps)
        begun = begun and f", from {begun} on"
        return f"{_name(violation)}: {violation.subject}, for {quantity(violation.value, 's')} in all{begun}"
    held = violation.kind in OF_A_HAND and violation.step is not None and fps > 0.0
    place = f" at {due(violation.step, fps)}" if held else at(violation.time, violation.step, fps)
    if violation.kind not in PHRASES:
        return f"{_name(violation)}: {violation.subject}{place}"
    value, bound = (quantity(number, violation.unit) for number in (violation.value, violation.bound))
    phrase = PHRASES[violation.kind].format(subject=violation.subject, value=value, bound=bound)
    if violation.bound == 0.0 and violation.severity is Severity.NOTE:
        phrase = phrase.removesuffix(f" (bound {bound})")  # nothing is exceeded, it is told all the same
    return f"{_name(violation)}: {phrase}{place}"


def _name(violation: Violation) -> str:
    """Code of a violation, and its cause where it has one."""
    return violation.code if violation.cause is None else f"{violation.code} ({violation.cause})"


HEADINGS = ("motion", "fell", "demandable", "within 20 mm", "RMS mm", "max mm", "time factor", "seconds in")
_WIDTHS = tuple(len(heading) for heading in HEADINGS)


def row(v: Verdict) -> tuple[str, ...]:
    """Cells of a motion below `HEADINGS`; errors are over the demandable steps."""
    seconds = " ".join(f"{name} {time:.1f}" for name, time in v.seconds.items())
    shares = (f"{100 * share:.0f} %" for share in (v.demandable_share, v.within_20mm))
    errors = (f"{1e3 * v.demandable_rms_m:.1f}", f"{1e3 * v.demandable_max_m:.0f}")
    return (Path(v.name).stem, "yes" if v.fell else "no", *shares, *errors, f"{v.time_factor:.2f}", seconds)


def table_line(cells: Sequence[str], width: int) -> str:
    """A line of the table of motions.

    Args:
        cells: `HEADINGS`, or what `row` gives.
        width: Of the longest name.
    """
    name, *numbers, seconds = cells
    middle = (f"{cell:>{size}}" for cell, size in zip(numbers, _WIDTHS[1:-1], strict=True))
    return "  ".join([f"{name:<{max(width, _WIDTHS[0])}}", *middle, seconds])


def table_summary(verdicts: Sequence[Verdict]) -> str:
    """What stands below the table."""
    falls, damping = sum(v.fell for v in verdicts), sum(v.seconds.get("damping", 0.0) for v in verdicts)
    motions, fell = (f"{n} {word}{'' if n == 1 else 's'}" for n, word in ((len(verdicts), "motion"), (falls, "fall")))
    robots = ", ".join(dict.fromkeys(v.robot for v in verdicts)) or "none"
    return (
        f"{motions}, {fell}, {damping:.1f} s damping\n"
        f"robot: {robots}\n"
        "demandable: steps slow enough and within reach; within 20 mm, RMS and max: of those, each at its own time"
    )
