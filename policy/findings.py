"""What a check of a checkpoint says, and the error made of it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

from policy.errors import PolicyError, printable

Level = Literal["ok", "warning", "error"]


@dataclass(frozen=True)
class Finding:
    """One line of a checklist.

    Attributes:
        check: Name of the check.
        level: ``ok``, ``warning`` or ``error``; a checkpoint with an error is not run.
        text: What was found, with values and bounds.
        cure: What would work; empty where all is well.
    """

    check: str
    level: Level
    text: str
    cure: str = ""

    def __post_init__(self) -> None:
        # What LeRobot or a hub says may have several lines, and a checkpoint anything.
        for name in ("text", "cure"):
            object.__setattr__(self, name, printable(" ".join(getattr(self, name).split())))

    @property
    def sentence(self) -> str:
        """Text and cure in one, on one line."""
        return f"{self.text}; {self.cure}" if self.cure else self.text


class CheckpointError(PolicyError, ValueError):
    """A checkpoint that must not be run.

    Attributes:
        findings: The checks that failed.
    """

    def __init__(self, findings: Iterable[Finding]) -> None:
        self.findings = tuple(findings)
        super().__init__(" | ".join(f"{finding.check}: {finding.sentence}" for finding in self.findings))


def fail(check: str, text: str, cure: str) -> CheckpointError:
    """Error of a single check, to raise where nothing after it can be looked at."""
    return CheckpointError([Finding(check, "error", text, cure)])


def require_no_error(findings: Iterable[Finding]) -> None:
    """Refuse what has errors.

    Raises:
        CheckpointError: With all of them.
    """
    errors = [finding for finding in findings if finding.level == "error"]
    if errors:
        raise CheckpointError(errors)
