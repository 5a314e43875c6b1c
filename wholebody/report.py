"""Verdicts as text for a terminal."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from wholebody.checker import Verdict, Violation

UNITS = {
    "out_of_reach": (1e3, "mm"),
    "tracking_error": (1e3, "mm"),
    "torque_limit": (1.0, "N m"),
    "joint_limit": (1.0, "rad"),
    "too_fast_for_balance": (1.0, "times"),
}
"""Factor and unit in which people read a violation; codes that are not here have no number."""


def lines(verdict: Verdict) -> list[str]:
    """The verdict first, then the worst violations, then how it went."""
    text = [f"{verdict.verdict.upper().replace('_', ' ')}  {verdict.name}"]
    text += [f"  {_violation(violation)}" for violation in verdict.violations]
    seconds = ", ".join(f"{name} {time:.1f} s" for name, time in verdict.seconds.items())
    text.append(
        f"  palm error {1e3 * verdict.rms_m:.2f} mm RMS, {1e3 * verdict.max_m:.1f} mm at most; "
        f"time factor {verdict.time_factor:.3f}; {seconds}"
    )
    return text


def _violation(violation: Violation) -> str:
    when = "" if violation.time is None else f" at {violation.time:.2f} s"
    text = f"{violation.code}: {violation.subject}{when}"
    if violation.code not in UNITS:
        return text
    factor, unit = UNITS[violation.code]
    return f"{text}, {factor * violation.value:.3g} {unit} (bound {factor * violation.bound:.3g} {unit})"


def table(verdicts: Sequence[Verdict]) -> None:
    """Print one row a motion."""
    from rich.console import Console
    from rich.table import Table

    rows = Table(box=None, pad_edge=False)
    for heading in ("motion", "fell", "demandable", "within 20 mm", "RMS mm", "max mm", "time factor", "seconds in"):
        rows.add_column(heading, justify="left" if heading in ("motion", "seconds in") else "right")
    for v in verdicts:
        seconds = " ".join(f"{name} {time:.1f}" for name, time in v.seconds.items())
        numbers = (
            f"{100 * v.demandable_share:.0f} %",
            f"{100 * v.within_20mm:.0f} %",
            f"{1e3 * v.demandable_rms_m:.1f}",
        )
        fell = "yes" if v.fell else "no"
        rows.add_row(
            Path(v.name).stem, fell, *numbers, f"{1e3 * v.demandable_max_m:.0f}", f"{v.time_factor:.2f}", seconds
        )
    Console(width=140).print(rows)
