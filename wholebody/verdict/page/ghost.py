"""The repaired motion of a run: of the first chunk that is not done as given, from where the robot was."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from policy.base import Policy
from policy.chunk import ActionChunk
from policy.observation import Observation
from wholebody.episode.result import EpisodeResult
from wholebody.planning.trajectory import GRID
from wholebody.sim.record import Record
from wholebody.types import RobotState
from wholebody.verdict.fast import FastChecker
from wholebody.verdict.page.frames import FPS
from wholebody.verdict.quantity import size_text
from wholebody.verdict.verdict import Verdict
from wholebody.verdict.violations import Severity


class Watched:
    """A policy whose chunks are kept; else as it was.

    Attributes:
        chunks: In the order of their answers.
    """

    def __init__(self, policy: Policy) -> None:
        self._policy, self.chunks = policy, list[ActionChunk]()

    def __getattr__(self, name: str) -> object:
        value = getattr(self._policy, name)
        return self._held if name == "held" else value

    def _held(self, seconds: float) -> Watched:
        """A recording after its first step was held; its chunks are kept in the same place."""
        longer = Watched(self._policy.held(seconds))
        longer.chunks = self.chunks
        return longer

    def reset(self, task: str = "") -> None:
        """Reset the policy, and forget the chunks."""
        self.chunks.clear()
        self._policy.reset(task)

    def infer(self, observation: Observation) -> ActionChunk:
        """The policy's chunk."""
        chunk = self._policy.infer(observation)
        self.chunks.append(chunk)
        return chunk


@dataclass(frozen=True)
class Ghost:
    """A motion beside the one that was.

    Attributes:
        times: When, shape (n,), [s].
        q: Configurations, shape (n, nq).
        words: What was changed.
    """

    times: np.ndarray
    q: np.ndarray
    words: str


def repaired(
    checker: FastChecker, chunks: Sequence[ActionChunk], record: Record, verdict: Verdict, result: EpisodeResult
) -> Ghost | None:
    """The repaired motion of the chunk in which the first violation is that counts; None if there is none."""
    free = result.orientation_free
    times = [one.time for one in verdict.violations if one.severity is not Severity.NOTE and one.time is not None]
    if not times or not chunks:
        return None
    first = result.start + min(times)
    chunk = next((one for one in reversed(chunks) if one.t_obs <= first + 1e-9), chunks[0])
    row = int(np.searchsorted(record["time"], chunk.t_obs - 1e-9).clip(max=len(record) - 1))
    begin = checker.judge.present(RobotState(float(record["time"][row]), record["q"][row], record["v"][row]))
    change = checker.repairer(chunk, begin, free).repaired()
    if change is None:
        return None
    plan = checker.judge.judge(change.chunk, begin).plan
    rows = np.arange(0, len(plan.trajectory.q), max(round(plan.rate / FPS / GRID), 1))
    s = plan.trajectory.start + GRID * rows
    return Ghost(
        chunk.t_obs + (s - plan.start) / plan.rate,
        plan.trajectory.q[rows],
        size_text(change.slower, change.moved, change.turned),
    )
