"""Which violations came of which: causes first, what followed from them folded under them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from wholebody.types import Reason
from wholebody.verdict.violations import MOVING_REASONS, Severity, Violation

FALLING = 1.1
"""How long before a fall is seen what is asked of its motors comes of it [s]; derived: a pendulum of 0.7 m tips over
from 2 to 60 degrees in acosh(60 / 2) / sqrt(9.81 / 0.7)."""
ELSEWHERE = (*MOVING_REASONS, Reason.MOVED)
HANDS_LOST = Reason.HANDS_DROPPED, Reason.NOT_FOLLOWED, Reason.TRACKING_ERROR, Reason.TRACKING
OVERLOADED = (
    Reason.TORQUE_LIMIT, Reason.JOINT_LIMIT, Reason.SELF_CONTACT, Reason.SCENE_CONTACT, Reason.BALANCE_EDGE
)  # fmt: skip
FOLLOWS: dict[Reason, tuple[Reason, ...]] = {
    Reason.FALL: (Reason.STANDING_LOST, Reason.QP_FAILED, Reason.OFF_PLAN, *HANDS_LOST, *OVERLOADED),
    Reason.REFUSED: (Reason.STARVED, Reason.OFF_PLAN, Reason.MOVED, Reason.TURNED, *HANDS_LOST),
    Reason.OFF_PLAN: HANDS_LOST,
    Reason.QP_FAILED: (Reason.STANDING_LOST, *HANDS_LOST),
    Reason.TOO_FAST_FOR_BALANCE: (Reason.TRACKING_ERROR, Reason.TRACKING),
    **dict.fromkeys(ELSEWHERE, (Reason.TRACKING_ERROR, Reason.TURNED)),
}
"""What comes of what, if it begins after it."""


def folded(found: Sequence[Violation]) -> list[Violation]:
    """Violations, the worst first, each followed by what came of it.

    What is worse than its cause, or began before it, stands for itself; a fall begins `FALLING` before it is seen.
    """
    causes = {one.code: one for one in reversed(found)}
    of = [_cause(one, causes) for one in found]
    return list(_in_order(found, of))


def _in_order(found: Sequence[Violation], of: Sequence[Reason | None]) -> Iterator[Violation]:
    listed = set()
    for one, cause in zip(found, of, strict=True):
        if cause is not None:
            continue
        yield one
        if one.code not in listed:
            listed.add(one.code)
            yield from (replace(x, came_of=one.code) for x, y in zip(found, of, strict=True) if y is one.code)


def _cause(one: Violation, causes: dict[Reason, Violation]) -> Reason | None:
    """The first in the order of `FOLLOWS` that a violation can have come of, and that came of nothing itself."""
    severity = list(Severity)
    for code, effects in FOLLOWS.items():
        cause = causes.get(code)
        if one.code not in effects or cause is None or cause is one:
            continue
        as_bad = severity.index(cause.severity) >= severity.index(one.severity)
        after = one.time is not None and cause.time is not None and one.time >= cause.time - _before(code)
        if as_bad and after and _cause(cause, causes) is None:
            return code
    return None


def _before(code: Reason) -> float:
    return FALLING if code is Reason.FALL else 0.0
