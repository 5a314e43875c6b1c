"""The gate of `wholebody run --gate`: chunks pass as given, pass as repaired by their plan, or are rejected."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from time import thread_time
from typing import Literal

from wholebody.config import ControllerConfig
from wholebody.execution.background_planner import PlanRequest
from wholebody.execution.statuses import refused
from wholebody.planning.judgement.chunk_judge import Begin
from wholebody.planning.plan import ChunkPlan
from wholebody.types import Reason, StatusReport
from wholebody.verdict.fast import FastChecker
from wholebody.verdict.summaries import GateSummary
from wholebody.verdict.verdict import Verdict
from wholebody.verdict.why.headline import headline

Passed = Literal["cleared", "repaired", "rejected"]
ANSWERS: dict[str, Passed] = {"feasible": "cleared", "feasible_after_repair": "repaired", "infeasible": "rejected"}
"""What becomes of a chunk, by the verdict on its plan."""


@dataclass(frozen=True, kw_only=True)
class Decision:
    """What a gate made of a chunk.

    Attributes:
        time: When its plan is to take over [s].
        seq: Its number.
        answer: ``cleared`` as given, ``repaired``: slowed down or bent by its plan, within the bounds of a repair, or
            ``rejected``: that would be another motion.
        reason: Code of the worst violation, or None.
        text: The reason in words.
        slower: How many times slower it is planned.
        moved, turned: How far a palm is commanded from where it is asked to be at most, after the approach [m], [rad].
        seconds: CPU time that judging took, the plan left out [s].
    """

    time: float
    seq: int
    answer: Passed
    reason: Reason | None
    text: str
    slower: float
    moved: float
    turned: float
    seconds: float


class ChunkGate:
    """Judges each chunk by the plan that would be followed; see `wholebody.execution.gate`.

    The plan is the repair: it slows down first, shifts the body second, and bends the path of the hands last. What
    that comes to is judged by the bounds of a verdict, from where the robot will be, for the steps still to come.

    Args:
        checker: Judges by plans.
        orientation_free: Whether the orientation of the left and of the right palm does not matter.
        by_layout: The same by the id of a layout, where chunks of several come.

    Attributes:
        decisions: All since the last `begin`.
    """

    def __init__(
        self,
        checker: FastChecker,
        orientation_free: tuple[bool, bool] = (False, False),
        by_layout: Mapping[str, tuple[bool, bool]] | None = None,
    ) -> None:
        self._checker, self._by_layout = checker, dict(by_layout or {})
        self.begin(orientation_free)

    def begin(self, orientation_free: tuple[bool, bool]) -> None:
        """Begin another input, and forget the decisions about the one before."""
        self.orientation_free = orientation_free
        self.decisions: list[Decision] = []

    def __call__(self, request: PlanRequest, plan: ChunkPlan) -> StatusReport | None:
        """Why a chunk is rejected, or None; also None where no plan is balanced: the chunk is planned again."""
        if request.contacts is not None:
            self._checker.judge.stand_on(request.contacts)
        begin, since = Begin(request.start.body, request.start.hands), thread_time()
        free = self._by_layout.get(request.chunk.spec_id, self.orientation_free)
        verdict = self._checker.of_plan(request.chunk, plan, begin, request.due, free)
        decision = _decision(request, verdict, plan.report.slowdown, thread_time() - since)
        self.decisions.append(decision)
        rejected = decision.answer == "rejected" and decision.reason is not Reason.NOT_JOINED
        return refused(Reason.NOT_CLEARED, decision.text) if rejected else None

    def summary(self, late: int = 0) -> GateSummary:
        """Counts of cleared, repaired and rejected chunks since the last `begin`, and of plans that came too late."""
        last = list({decision.seq: decision for decision in self.decisions}.values())
        count = Counter(decision.answer for decision in last)
        repaired = [decision for decision in last if decision.answer == "repaired"]
        return GateSummary(
            cleared=count["cleared"],
            repaired=count["repaired"],
            rejected=count["rejected"],
            late=late,
            reasons=dict(Counter(str(one.reason) for one in last if one.answer != "cleared")),
            slower_max=max((one.slower for one in repaired), default=1.0),
            moved_max_m=max((one.moved for one in repaired), default=0.0),
            turned_max_rad=max((one.turned for one in repaired), default=0.0),
            seconds_max=max((one.seconds for one in self.decisions), default=0.0),
        )


def gate_of(config: ControllerConfig, by_layout: Mapping[str, tuple[bool, bool]], scene: str = "floor") -> ChunkGate:
    """Gate made in another process, from settings, palms with free orientation by layout, and a scene."""
    return ChunkGate(FastChecker(config, scene), by_layout=by_layout)


def _decision(request: PlanRequest, verdict: Verdict, slower: float, seconds: float) -> Decision:
    reason = None if verdict.verdict == "feasible" else verdict.violations[0].code
    reason = Reason.NOT_JOINED if reason is Reason.REFUSED else reason
    return Decision(
        time=request.due, seq=request.chunk.seq, answer=ANSWERS[verdict.verdict], reason=reason, text=headline(verdict),
        slower=slower, moved=verdict.moved_max_m, turned=verdict.moved_turn_max_rad, seconds=seconds,
    )  # fmt: skip
