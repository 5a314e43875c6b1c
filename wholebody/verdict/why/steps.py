"""Steps that would do: from where the end of a chunk that is out of reach here is in reach."""

from __future__ import annotations

from dataclasses import replace

from policy.chunk import ActionChunk
from wholebody.config import ControllerConfig
from wholebody.errors import InputError
from wholebody.execution.feet.elsewhere import SPARE, base_of, ends
from wholebody.planning.judgement.chunk_judge import ChunkJudge
from wholebody.planning.reachability.standing_place import stand_for
from wholebody.types import Reason
from wholebody.verdict.causes import WouldDo
from wholebody.verdict.verdict import Verdict
from wholebody.verdict.violations import Severity


def with_steps(verdict: Verdict, chunk: ActionChunk, judge: ChunkJudge, config: ControllerConfig) -> Verdict:
    """A verdict with the steps that would do, found as a robot with ``steps: reach`` finds them.

    Args:
        verdict: On an input, with what else would do.
        chunk: The input, or its last chunk.
        judge: Says where the feet stand; what stands around the robot is not walked around.
        config: Of the robot and its bounds.
    """
    out = any(one.code is Reason.OUT_OF_REACH and one.severity is Severity.INFEASIBLE for one in verdict.violations)
    if not out or judge.scene is not None or any(chunk.pushes):
        return verdict
    try:
        place = stand_for(
            *ends(chunk), base_of(judge.planner.optimizer.body.footing.contacts.feet(), judge.spec), config, spare=SPARE
        )
    except InputError:  # there is no map of this robot
        return verdict
    if not place.reached or place.steps == 0:
        return verdict
    return replace(verdict, would_do=[*verdict.would_do, WouldDo("steps", steps=place.steps, base=place.base)])
