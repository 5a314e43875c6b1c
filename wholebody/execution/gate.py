"""A gate between a chunk's plan and the control loop: what it does not clear is rejected."""

from __future__ import annotations

import logging
from collections.abc import Callable

from wholebody.errors import InputError, PlanningError
from wholebody.execution.background_planner import Compute, PlanAnswer, PlanRequest
from wholebody.execution.standing import is_hold
from wholebody.execution.statuses import refused
from wholebody.planning.plan import ChunkPlan
from wholebody.types import Reason, StatusReport

Gate = Callable[[PlanRequest, ChunkPlan], StatusReport | None]
"""Judges a chunk by its plan, before that is followed: why the chunk is rejected, or None where it is not."""

logger = logging.getLogger(__name__)


class RejectedError(PlanningError):
    """A gate rejects a chunk; ``report`` says why."""

    def __init__(self, report: StatusReport) -> None:
        super().__init__(report)
        self.report = report

    def __str__(self) -> str:
        return self.report.detail


def gated(compute: Compute, gate: Gate | None) -> Compute:
    """What plans, and hands out only what a gate lets through, where plans are computed: beside the control loop.

    It raises a `RejectedError` for what is rejected. Chunks that the supervisor makes to hold its position are not
    judged.
    """
    if gate is None:
        return compute

    def cleared(request: PlanRequest) -> ChunkPlan:
        plan = compute(request)
        if not is_hold(request.chunk) and (report := gate(request, plan)) is not None:
            raise RejectedError(report)
        return plan

    return cleared


def judged_elsewhere(request: PlanRequest, plan: ChunkPlan) -> None:
    """Gate of a supervisor whose plans are judged in the process that computes them: all that come are cleared."""


def why_not(answer: PlanAnswer) -> StatusReport:
    """Why there is no plan to follow; said in the log too where no gate says so."""
    error, chunk = answer.error, answer.request.chunk
    if isinstance(error, RejectedError):
        return error.report
    logger.warning("no plan for chunk %d of %.3f s", chunk.seq, chunk.t_obs, exc_info=error)
    known = isinstance(error, PlanningError | InputError)
    fault = f"a fault of the planner, not of the chunk: {type(error).__name__}: {error}".rstrip(": ")
    return refused(Reason.PLANNING_FAILED, str(error) if known else fault)
