"""Which violations came of which: causes first, what followed from them folded under them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from wholebody.types import PalmCause, Reason
from wholebody.verdict.violations import ELSEWHERE, Severity, Violation

Kind = Reason | PalmCause

FALLING = 1.1
"""How long before a fall is seen what is asked of its motors comes of it [s]; derived: a pendulum of 0.7 m tips over
from 2 to 60 degrees in acosh(60 / 2) / sqrt(9.81 / 0.7)."""
LOST = Reason.DESCENDING, Reason.STANDING_LOST
HANDS_LOST = Reason.HANDS_DROPPED, PalmCause.LOST, PalmCause.LATE, PalmCause.WAITING
OVERLOADED = (
    Reason.TORQUE_LIMIT, Reason.JOINT_LIMIT, Reason.SELF_CONTACT, Reason.SCENE_CONTACT, Reason.BALANCE_EDGE
)  # fmt: skip
FOLLOWS: dict[Kind, tuple[Kind, ...]] = {
    Reason.FALL: (*LOST, Reason.QP_FAILED, Reason.OFF_PLAN, *HANDS_LOST, *OVERLOADED),
    Reason.REFUSED: (Reason.STARVED, Reason.OFF_PLAN, PalmCause.POSITION, PalmCause.ORIENTATION, *HANDS_LOST),
    Reason.OFF_PLAN: HANDS_LOST,
    Reason.QP_FAILED: (*LOST, *HANDS_LOST),
    Reason.TOO_FAST_FOR_BALANCE: (PalmCause.LATE, PalmCause.WAITING),
    **dict.fromkeys(ELSEWHERE, (PalmCause.LATE, PalmCause.ORIENTATION)),
}
"""What comes of what, if it begins after it."""


def folded(found: Sequence[Violation]) -> list[Violation]:
    """Violations, the worst first, each followed by what came of it.

    What is worse than its cause, or began before it, stands for itself; a fall begins `FALLING` before it is seen.
    """
    causes = {one.kind: one for one in reversed(found)}
    of = [_cause(one, causes) for one in found]
    return list(_in_order(found, of))


def _in_order(found: Sequence[Violation], of: Sequence[Kind | None]) -> Iterator[Violation]:
    listed = set()
    for one, cause in zip(found, of, strict=True):
        if cause is not None:
            continue
        yield one
        if one.kind not in listed:
            listed.add(one.kind)
            yield from (replace(x, came_of=one.code) for x, y in zip(found, of, strict=True) if y is one.kind)


def _cause(one: Violation, causes: dict[Kind, Violation]) -> Kind | None:
    """The first in the order of `FOLLOWS` that a violation can have come of, and that came of nothing itself."""
    severity = list(Severity)
    for kind, effects in FOLLOWS.items():
        cause = causes.get(kind)
        if one.kind not in effects or cause is None or cause is one:
            continue
        as_bad = severity.index(cause.severity) >= severity.index(one.severity)
        after = one.time is not None and cause.time is not None and one.time >= cause.time - _before(kind)
        if as_bad and after and _cause(cause, causes) is None:
            return kind
    return None


def _before(kind: Kind) -> float:
    return FALLING if kind is Reason.FALL else 0.0
