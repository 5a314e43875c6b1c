"""What became of an input of an audit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from typing import Any, Literal

Ending = Literal["judged", "malformed", "timed_out", "crashed"]


@dataclass(frozen=True, kw_only=True)
class AuditOutcome:
    """One line of a journal.

    Attributes:
        name: Input.
        ending: ``judged``, ``malformed``: it could not be read, ``timed_out``, or ``crashed``.
        verdict: `wholebody.verdict.verdict.Verdict` as plain data without settings and versions; None if not judged.
        message: Why it was not judged.
        motion_s: Length of its motion [s].
        slower: Factor on its time that makes it feasible by its plans; None if none was found, or none is needed.
        repair: What was changed to make it feasible: ``slower``, ``moved_m``, ``turned_rad``; None if nothing was.
        gaps: How measured joints follow commanded ones, `policy.suspicion.gaps.Gap` as plain data.
        stamp: Size and time of the file that was read, so that a changed one is judged again.
    """

    name: str
    ending: Ending
    verdict: dict[str, Any] | None = None
    message: str = ""
    motion_s: float = 0.0
    slower: float | None = None
    repair: dict[str, float] | None = None
    gaps: list[dict[str, Any]] = field(default_factory=list)
    stamp: list[int] = field(default_factory=list)

    @property
    def answer(self) -> str:
        """The verdict, or why there is none."""
        return self.verdict["verdict"] if self.verdict else self.ending

    def as_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return asdict(self)


Judging = Callable[[str], AuditOutcome]
"""Judges an input by its name."""
