"""Steps that would do: from where a chunk that is out of reach here is feasible."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from policy.chunk import ActionChunk
from policy.geometry.se3 import inverse, make_transform
from wholebody.config import ControllerConfig
from wholebody.errors import InputError
from wholebody.execution.feet.carried import about_z
from wholebody.execution.feet.elsewhere import SPARE, base_of, ends
from wholebody.planning.judgement.chunk_judge import ChunkJudge
from wholebody.planning.reachability.standing_place import stand_for
from wholebody.types import Reason
from wholebody.verdict.causes import WouldDo
from wholebody.verdict.verdict import Verdict
from wholebody.verdict.violations import Severity


def with_steps(
    verdict: Verdict,
    chunk: ActionChunk,
    judge: ChunkJudge,
    config: ControllerConfig,
    check: Callable[[ActionChunk], Verdict],
) -> Verdict:
    """A verdict with the steps that would do: the place is found as a robot with ``steps: reach`` finds it.

    Args:
        verdict: On an input, with what else would do.
        chunk: The input, or its last chunk.
        judge: Says where the feet stand; what stands around the robot is not walked around.
        config: Of the robot and its bounds.
        check: Verdict on a chunk that begins at its own first step, with the feet where they stand.
    """
    out = any(one.code is Reason.OUT_OF_REACH and one.severity is Severity.INFEASIBLE for one in verdict.violations)
    if not out or judge.scene is not None or any(chunk.pushes):
        return verdict
    here = base_of(judge.planner.optimizer.body.footing.contacts.feet(), judge.spec)
    try:
        place = stand_for(*ends(chunk), here, config, spare=SPARE)
    except InputError:  # there is no map of this robot
        return verdict
    if not place.reached or place.steps == 0 or check(seen_from(place.base, here, chunk)).verdict != "feasible":
        return verdict
    return replace(verdict, would_do=[*verdict.would_do, WouldDo("steps", steps=place.steps, base=place.base)])


def seen_from(base: tuple[float, ...], here: tuple[float, ...], chunk: ActionChunk) -> ActionChunk:
    """A chunk for a robot that stands here, as it is for one at another base: x, y [m] and heading [rad] each."""
    frames = [make_transform(about_z(heading), np.array([x, y, 0.0])) for x, y, heading in (here, base)]
    T = frames[0] @ inverse(frames[1])
    return replace(chunk, T_world_lhand=T @ chunk.T_world_lhand, T_world_rhand=T @ chunk.T_world_rhand)
