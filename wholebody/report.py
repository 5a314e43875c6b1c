"""Verdicts as text for a terminal and as JSON."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from wholebody.verdict import Verdict, Violation

FOR_PEOPLE = {"m": (1e3, "mm"), "rad": (1.0, "rad"), "N m": (1.0, "N m"), "s": (1.0, "s"), "": (1.0, "times")}
"""Factor and unit in which people read a value, by its SI unit."""
WITHOUT_NUMBER = ("fall", "refused", "self_contact", "scene_contact")


def lines(verdict: Verdict) -> list[str]:
    """The verdict first, then the worst violations, then how it went."""
    text = [f"{verdict.verdict.upper().replace('_', ' ')}  {verdict.name}"]
    text += [f"  {_violation(violation)}" for violation in verdict.violations]
    text.append(
        f"  palm error {1e3 * verdict.rms_m:.2f} mm RMS, {1e3 * verdict.max_m:.1f} mm at most, "
        f"{1e3 * verdict.end_m:.2f} mm at the end; time factor {verdict.time_factor:.3f}"
    )
    margin = verdict.pressure_margin_m
    room = "" if margin is None else f"; pressure at least {1e3 * margin:.0f} mm inside the soles"
    seconds = ", ".join(f"{name} {time:.1f} s" for name, time in verdict.seconds.items())
    text.append(f"  {seconds}{room}; feet slid {1e3 * verdict.creep_m:.1f} mm")
    return text


def to_json(verdicts: Sequence[Verdict]) -> str:
    """A JSON array of verdicts, as `verdict.schema.json` describes it; never with NaN or Infinity."""
    return json.dumps([verdict.as_dict() for verdict in verdicts], indent=2, allow_nan=False)


def _violation(violation: Violation) -> str:
    when = "" if violation.time is None else f" at {violation.time:.2f} s"
    if violation.step is not None:
        when += f" (step {violation.step})"
    text = f"{violation.code}: {violation.subject}{when}"
    if violation.code in WITHOUT_NUMBER:
        return text
    factor, unit = FOR_PEOPLE[violation.unit]
    return f"{text}, {factor * violation.value:.3g} {unit} (bound {factor * violation.bound:.3g} {unit})"


def table(verdicts: Sequence[Verdict]) -> None:
    """Print one row a motion, and a row for all."""
    from rich.console import Console
    from rich.table import Table

    rows = Table(box=None, pad_edge=False)
    for heading in HEADINGS:
        rows.add_column(heading, justify="left" if heading in ("motion", "seconds in") else "right", no_wrap=True)
    for verdict in verdicts:
        rows.add_row(*row(verdict))
    Console(width=160).print(rows)
    falls, damping = sum(v.fell for v in verdicts), sum(v.seconds.get("damping", 0.0) for v in verdicts)
    Console(width=160).print(f"{len(verdicts)} motions, {falls} falls, {damping:.1f} s damping")


HEADINGS = ("motion", "fell", "demandable", "within 20 mm", "RMS mm", "max mm", "time factor", "seconds in")


def row(v: Verdict) -> tuple[str, ...]:
    """Cells of a motion below `HEADINGS`; errors are over the demandable steps."""
    seconds = " ".join(f"{name} {time:.1f}" for name, time in v.seconds.items())
    shares = (f"{100 * share:.0f} %" for share in (v.demandable_share, v.within_20mm))
    errors = (f"{1e3 * v.demandable_rms_m:.1f}", f"{1e3 * v.demandable_max_m:.0f}")
    return (Path(v.name).stem, "yes" if v.fell else "no", *shares, *errors, f"{v.time_factor:.2f}", seconds)
