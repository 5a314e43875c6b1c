"""What one tick of a controller did."""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum

from wholebody.qp.formulation import WholeBodySolution
from wholebody.qp.problem import QPSolution


class TickLevel(IntEnum):
    """How much of its program a tick could keep."""

    FULL = 0
    """Everything."""
    NO_HANDS = 1
    """All but the hands; joint bounds are wide, so that the arms give way."""
    FAILED = 2
    """No solution: the last torques are held."""


class TickReport:
    """What one tick did.

    Args:
        solution: Accelerations, forces and torques; None if no program had an acceptable solution; or a function that
            gives them when they are asked for.
        qp: The last solver answer, or such a function.
        level: How much of the program was kept.
    """

    __slots__ = ("_qp", "_solution", "level")

    def __init__(
        self,
        solution: WholeBodySolution | Callable[[], WholeBodySolution] | None,
        qp: QPSolution | Callable[[], QPSolution],
        level: TickLevel,
    ) -> None:
        self._solution, self._qp, self.level = solution, qp, level

    @property
    def solution(self) -> WholeBodySolution | None:
        """Accelerations, forces and torques, or None."""
        if callable(self._solution):
            self._solution = self._solution()
        return self._solution

    @property
    def qp(self) -> QPSolution:
        """The last solver answer."""
        if callable(self._qp):
            self._qp = self._qp()
        return self._qp
