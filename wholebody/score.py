"""How well the hands followed: palm errors at the steps of the chunks, and which steps could be asked for."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from policy.chunk import ActionChunk
from wholebody.planner import PlanReport
from wholebody.supervisor import Supervisor
from wholebody.types import RobotState

DEMANDABLE_SPEED, DEMANDABLE_ACCELERATION, DEMANDABLE_DISTANCE = 1.1, 15.0, 0.005
"""What a recorded motion may ask of a wrist [m/s, m/s^2], and of the posture plan [m]."""


class Score:
    """Palm errors at the steps of the chunks, each step against the last chunk that covers it."""

    def __init__(self, supervisor: Supervisor) -> None:
        robot = supervisor.robot
        self._model, self._data = robot.model, robot.model.createData()
        self._palms = supervisor.planner.palm_ids
        self._offsets = [np.array(tool.palm_offset) for tool in supervisor.spec.tools]
        self._chunk: ActionChunk | None = None
        self._next = 0
        self._times: list[float] = []
        self._errors: list[list[float]] = []
        self._demandable: list[np.ndarray] = []

    def add(self, chunk: ActionChunk, report: PlanReport) -> None:
        """A chunk that was accepted, with its plan; it replaces the one before."""
        # A chunk that comes late is not scored for the steps that were over before it came.
        now = chunk.t_obs + report.steps[0]
        self._chunk, self._next = chunk, int(np.searchsorted(chunk.times, now - 1.0 / chunk.fps))
        self._fair = demandable(chunk, report)

    def measure(self, state: RobotState) -> None:
        """Score the step that has just become due, if one has."""
        chunk = self._chunk
        if chunk is None or self._next >= len(chunk) or state.time < chunk.times[self._next] - 1e-6:
            return
        k = self._next
        self._next += 1
        pin.framesForwardKinematics(self._model, self._data, state.q)
        wanted = [T[:3, :3] @ offset + T[:3, 3] for T, offset in zip(self._poses(k), self._offsets, strict=True)]
        reached = [self._data.oMf[frame].translation for frame in self._palms]
        self._times.append(float(chunk.times[k]))
        self._errors.append([float(np.linalg.norm(a - b)) for a, b in zip(wanted, reached, strict=True)])
        self._demandable.append(self._fair[k])

    def _poses(self, k: int) -> tuple[np.ndarray, np.ndarray]:
        return self._chunk.T_world_lhand[k], self._chunk.T_world_rhand[k]

    def table(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Times (n,), errors (n, 2) and demandable (n, 2)."""
        fair = np.array(self._demandable, dtype=bool).reshape(-1, 2)
        return np.array(self._times), np.array(self._errors).reshape(-1, 2), fair


def demandable(chunk: ActionChunk, report: PlanReport) -> np.ndarray:
    """Steps that a chunk may ask for: slow enough for the hands, and within reach of the posture plan.

    Returns:
        Shape (H, 2): wrist speed at most `DEMANDABLE_SPEED`, acceleration at most `DEMANDABLE_ACCELERATION`, posture
        plan within `DEMANDABLE_DISTANCE` at the step. Recordings contain glitches of 16 m/s, hence the definition.
    """
    fair = np.empty((len(chunk), 2), dtype=bool)
    for i, T in enumerate((chunk.T_world_lhand, chunk.T_world_rhand)):
        v = np.gradient(T[:, :3, 3], 1.0 / chunk.fps, axis=0)
        a = np.gradient(v, 1.0 / chunk.fps, axis=0)
        slow = np.linalg.norm(v, axis=1) <= DEMANDABLE_SPEED
        fair[:, i] = slow & (np.linalg.norm(a, axis=1) <= DEMANDABLE_ACCELERATION)
    nearest = np.searchsorted(report.steps, chunk.times - chunk.t_obs - 1e-9).clip(0, len(report.steps) - 1)
    return fair & (report.missed[nearest] <= DEMANDABLE_DISTANCE)
