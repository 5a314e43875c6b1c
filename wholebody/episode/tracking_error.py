"""How well the hands followed: errors at the steps of the chunks, and which steps could be asked for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pinocchio as pin

from models.spec import RobotSpec
from policy.chunk import ActionChunk
from wholebody.execution.supervisor import Supervisor
from wholebody.planning.plan import PlanReport
from wholebody.types import RobotState

DEMANDABLE_SPEED, DEMANDABLE_ACCELERATION, DEMANDABLE_DISTANCE = 1.1, 15.0, 0.005
"""What a recorded motion may ask of a wrist [m/s, m/s^2], and of the posture plan [m]."""


class TrackingError:
    """Errors of the palms at the steps of the chunks, each step against the last chunk that had come when it was due.

    Steps fall between control ticks; where the palms were at a step is interpolated between the two states around it.
    """

    def __init__(self, supervisor: Supervisor) -> None:
        robot = supervisor.robot
        self._model, self._data = robot.model, robot.model.createData()
        self._palms = supervisor.planner.palm_ids
        self._offsets = [np.array(tool.palm_offset) for tool in supervisor.spec.tools]
        self._chunk: ActionChunk | None = None
        self._before: RobotState | None = None
        self._next = 0
        self._times: list[float] = []
        self._errors: list[list[float]] = []
        self._turns: list[list[float]] = []
        self._lags: list[list[float]] = []
        self._demandable: list[np.ndarray] = []

    def follow(self, chunk: ActionChunk | None, report: PlanReport | None) -> None:
        """The chunk that is being followed; where it is another one than before, it counts from now on."""
        if chunk is not None and chunk is not self._chunk:
            self.add(chunk, report)

    def add(self, chunk: ActionChunk, report: PlanReport) -> None:
        """A chunk that was accepted, with its plan; it replaces the one before."""
        # Steps that were due before it came, or as it came, were the business of the chunk before.
        since = max([float(chunk.t_obs + max(report.steps[0], 0.0)), *self._times[-1:]])
        self._chunk, self._due = chunk, chunk.times
        self._next = int(np.searchsorted(self._due, since + 1e-6))
        self._fair = demandable(chunk, report)

    def measure(self, state: RobotState, commanded: Mapping[str, np.ndarray]) -> None:
        """Score the step that has become due since the last state, if one has.

        Args:
            state: True state.
            commanded: Palm poses (4, 4) that led to it, by side.
        """
        before, self._before = self._before or state, state
        chunk, k = self._chunk, self._next
        if chunk is None or k >= len(chunk) or state.time < self._due[k] - 1e-6:
            return
        self._next += 1
        time = float(self._due[k])
        since = (time - before.time) / max(state.time - before.time, 1e-9)
        share = min(max(since, 0.0), 1.0)
        wanted = zip(self._wanted(k), self._reached(before), self._reached(state), strict=True)
        errors = [goal.actInv(pin.SE3.Interpolate(first, second, share)) for goal, first, second in wanted]
        self._times.append(time)
        self._errors.append([float(np.linalg.norm(error.translation)) for error in errors])
        self._turns.append([float(np.linalg.norm(pin.log3(error.rotation))) for error in errors])
        self._demandable.append(self._fair[k])
        goals = (commanded[side][:3, 3] for side in ("left", "right"))
        lags = [goal - palm.translation for goal, palm in zip(goals, self._reached(state), strict=True)]
        self._lags.append([float(np.linalg.norm(lag)) for lag in lags])

    def _wanted(self, k: int) -> list[pin.SE3]:
        """Palm poses in world that a step asks for, left first."""
        return _palms(self._chunk, k, self._offsets)

    def _reached(self, state: RobotState) -> list[pin.SE3]:
        """Palm poses in world of a state, left first."""
        pin.framesForwardKinematics(self._model, self._data, state.q)
        return [self._data.oMf[frame].copy() for frame in self._palms]

    @property
    def empty(self) -> bool:
        """Whether no chunk has been added yet."""
        return self._chunk is None

    def table(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Times (n,), errors (n, 2) and demandable (n, 2)."""
        fair = np.array(self._demandable, dtype=bool).reshape(-1, 2)
        return np.array(self._times), np.array(self._errors).reshape(-1, 2), fair

    def turns(self) -> np.ndarray:
        """Angles between the palms' orientations and those asked for, shape (n, 2), [rad]."""
        return np.array(self._turns).reshape(-1, 2)

    def lags(self) -> np.ndarray:
        """Distances of the palms from where they were commanded to be, shape (n, 2), [m]."""
        return np.array(self._lags).reshape(-1, 2)


def start_jump(
    chunk: ActionChunk, now: float, commanded: Mapping[str, np.ndarray], spec: RobotSpec
) -> tuple[float, float]:
    """How far a chunk begins from where the palms are commanded to be.

    Args:
        chunk: A valid chunk.
        now: Present time [s].
        commanded: Palm poses (4, 4) by side.
        spec: The robot.

    Returns:
        Distance [m] and angle [rad], each the larger of both hands.
    """
    k = int(np.clip(np.searchsorted(chunk.times, now - 1e-6), 0, len(chunk) - 1))
    wanted = _palms(chunk, k, [np.array(tool.palm_offset) for tool in spec.tools])
    jumps = [pin.SE3(commanded[side]).actInv(T) for side, T in zip(("left", "right"), wanted, strict=True)]
    distances = [float(np.linalg.norm(jump.translation)) for jump in jumps]
    return max(distances), max(float(np.linalg.norm(pin.log3(jump.rotation))) for jump in jumps)


def _palms(chunk: ActionChunk, k: int, offsets: Sequence[np.ndarray]) -> list[pin.SE3]:
    """Palm poses in world that a step of a chunk asks for, left first."""
    poses = (chunk.T_world_lhand[k], chunk.T_world_rhand[k])
    return [pin.SE3(T[:3, :3], T[:3, :3] @ p + T[:3, 3]) for T, p in zip(poses, offsets, strict=True)]


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
    return fair & (report.tracking_error[nearest] <= DEMANDABLE_DISTANCE)
