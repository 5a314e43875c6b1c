"""Verdicts as text for a terminal."""

from __future__ import annotations

from wholebody.checker import Verdict


def lines(verdict: Verdict) -> list[str]:
    """The verdict first, then the worst violations, then how it went."""
    text = [f"{verdict.verdict.upper().replace('_', ' ')}  {verdict.name}"]
    for v in verdict.violations:
        when = "" if v.time is None else f" at {v.time:.2f} s"
        text.append(f"  {v.code}: {v.subject}{when}, value {v.value:.3g}, bound {v.bound:.3g}")
    seconds = ", ".join(f"{name} {time:.1f} s" for name, time in verdict.seconds.items())
    text.append(
        f"  palm error {1e3 * verdict.rms_m:.2f} mm RMS, {1e3 * verdict.max_m:.1f} mm at most; "
        f"time factor {verdict.time_factor:.3f}; {seconds}"
    )
    return text
