"""An input in several realistic worlds: in how many of them it held, and how sure that is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from wholebody.types import Reason
from wholebody.verdict.summaries import Worlds
from wholebody.verdict.verdict import Verdict
from wholebody.verdict.violations import Severity, Violation

CONFIDENCE = 0.95
"""Confidence of the interval [no unit]; definition."""


def binomial_interval(held: int, n: int, level: float = CONFIDENCE) -> tuple[float, float]:
    """Clopper-Pearson confidence interval of the share of all worlds in which an input holds.

    Args:
        held: In how many worlds an input held.
        n: How many worlds there were, each drawn by itself.
        level: Confidence, 0 to 1.

    Source:
        Clopper and Pearson 1934, "The use of confidence or fiducial limits illustrated in the case of the binomial".
    """
    from scipy.stats import binomtest  # too slow to come with the package

    interval = binomtest(held, n).proportion_ci(level, "exact")
    return float(interval.low), float(interval.high)


def in_worlds(verdict: Verdict, seeds: Sequence[int], found: Sequence[Verdict]) -> Verdict:
    """A verdict with what became of the input in worlds; a fall in any of them makes it infeasible.

    Args:
        verdict: Of the robot that was asked for.
        seeds: Of the worlds.
        found: Their verdicts.
    """
    fell = [seed for seed, one in zip(seeds, found, strict=True) if one.fell]
    held = sum(one.verdict != "infeasible" for one in found)
    low, high = binomial_interval(held, len(found))
    summary = Worlds(
        seeds=tuple(seeds), verdicts=tuple(one.verdict for one in found), fell=tuple(fell), held=held,
        share=held / len(found), low=low, high=high, level=CONFIDENCE, max_m=max(one.max_m for one in found),
    )  # fmt: skip
    if not fell:
        return replace(verdict, worlds=summary)
    first = next(one for one in found if one.fell).violations[0]
    text = f"in {len(fell)} of {len(found)} realistic worlds, seeds {', '.join(map(str, fell))}: {first.subject}"
    fall = Violation(code=Reason.FALL, severity=Severity.INFEASIBLE, subject=text, time=first.time, step=first.step)
    return replace(verdict, verdict="infeasible", violations=[fall, *verdict.violations], worlds=summary)
