"""An input in several realistic worlds: in how many of them it held, and how sure that is."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import exp, lgamma, log

from wholebody.types import Reason
from wholebody.verdict.summaries import Worlds
from wholebody.verdict.verdict import Verdict
from wholebody.verdict.violations import Severity, Violation

LEVEL = 0.95
"""Confidence of the interval [no unit]; definition."""
HALVINGS = 50
"""Of an interval of shares; derived: 2 to the power of -50 is rounding."""


def binomial_interval(held: int, n: int, level: float = LEVEL) -> tuple[float, float]:
    """Shares between which that of all worlds lies with at least a level of confidence.

    Args:
        held: In how many worlds an input held.
        n: How many worlds there were, each drawn by itself.
        level: Confidence, 0 to 1.

    Source:
        Clopper and Pearson 1934, "The use of confidence or fiducial limits illustrated in the case of the binomial".
    """
    tail = 0.5 * (1.0 - level)
    low = 0.0 if held == 0 else _share(lambda p: sum(_chance(k, n, p) for k in range(held, n + 1)) < tail)
    high = 1.0 if held == n else _share(lambda p: sum(_chance(k, n, p) for k in range(held + 1)) >= tail)
    return low, high


def _share(below: Callable[[float], bool]) -> float:
    """The share up to which something is true, by bisection."""
    low, high = 0.0, 1.0
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if below(middle) else (low, middle)
    return 0.5 * (low + high)


def _chance(k: int, n: int, p: float) -> float:
    """Binomial probability of k successes in n trials, each with the chance p, 0 < p < 1."""
    return exp(lgamma(n + 1) - lgamma(k + 1) - lgamma(n - k + 1) + k * log(p) + (n - k) * log(1.0 - p))


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
        share=held / len(found), low=low, high=high, level=LEVEL, max_m=max(one.max_m for one in found),
    )  # fmt: skip
    if not fell:
        return replace(verdict, worlds=summary)
    first = next(one for one in found if one.fell).violations[0]
    said = f"in {len(fell)} of {len(found)} realistic worlds, seeds {', '.join(map(str, fell))}: {first.subject}"
    fall = Violation(code=Reason.FALL, severity=Severity.INFEASIBLE, subject=said, time=first.time, step=first.step)
    return replace(verdict, verdict="infeasible", violations=[fall, *verdict.violations], worlds=summary)
