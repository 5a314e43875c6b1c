"""How well the hands followed: errors at the steps of the chunks, and which steps could be asked for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import pinocchio as pin

from models.spec import RobotSpec
from policy.chunk import ActionChunk
from wholebody.execution.chunk_executor import ChunkExecutor
from wholebody.planning.plan import PlanReport
from wholebody.robot.palms import palm_offsets
from wholebody.sim.limit_monitor import LimitExcess
from wholebody.types import Reason, RobotState

DEMANDABLE_SPEED, DEMANDABLE_ACCELERATION, DEMANDABLE_DISTANCE = 1.1, 15.0, 0.005
"""What a recorded motion may ask of a wrist [m/s, m/s^2], and of the trajectory [m]; definition, see `demandable`."""
FINGER_TOLERANCE = 1e-3
"""How far a finger may be asked past its range [rad]; chosen: the rounding of files."""


@dataclass
class PalmErrors:
    """Errors of the palms at n steps of the chunks, each at its own time: asked, commanded and measured, compared.

    Attributes:
        times: When each step was due, shape (n,), [s].
        errors, turns: Measured against asked: distances [m] and angles [rad], shape (n, 2), left and right.
        moved, moved_turns: Commanded against asked, likewise.
        lags, lag_turns: Measured against commanded, likewise.
        demandable: Whether the step could be asked for, shape (n, 2): see `demandable`.
        reasons: Why the controller did not follow the chunk as given at that time, n reasons or None.
        fingers: Fingers asked past their range, by joint [rad].
        uncovered: Time between the last step of a chunk and the first one that was followed of the next, less a step,
            when it was first [s] and how much in all [s].
        asked: Palm points that were asked for, shape (n, 2, 3), world [m].
    """

    times: np.ndarray = field(default_factory=lambda: np.zeros(0))
    errors: np.ndarray = field(default_factory=lambda: np.zeros((0, 2)))
    turns: np.ndarray = field(default_factory=lambda: np.zeros((0, 2)))
    moved: np.ndarray = field(default_factory=lambda: np.zeros((0, 2)))
    moved_turns: np.ndarray = field(default_factory=lambda: np.zeros((0, 2)))
    lags: np.ndarray = field(default_factory=lambda: np.zeros((0, 2)))
    lag_turns: np.ndarray = field(default_factory=lambda: np.zeros((0, 2)))
    demandable: np.ndarray = field(default_factory=lambda: np.zeros((0, 2), dtype=bool))
    reasons: list[Reason | None] = field(default_factory=list)
    fingers: dict[str, LimitExcess] = field(default_factory=dict)
    uncovered: tuple[float, float] = (0.0, 0.0)
    asked: np.ndarray = field(default_factory=lambda: np.zeros((0, 2, 3)))


class TrackingError:
    """Compares the palms at the steps of the chunks, each step of the last chunk that had come when it was due.

    Steps fall between control ticks; where the palms were at a step, commanded and measured, is interpolated between
    the two ticks around it.
    """

    def __init__(self, supervisor: ChunkExecutor) -> None:
        robot, spec = supervisor.robot, supervisor.spec
        self._model, self._data = robot.model, robot.scratch
        self._palms = [robot.frame_id(tool.palm_frame) for tool in spec.tools]
        self._offsets = palm_offsets(spec)
        fingers = [spec.indices(tool.finger_joints) for tool in spec.tools]
        self._ranges = [
            (tool.finger_joints, spec.position_min[i], spec.position_max[i])
            for tool, i in zip(spec.tools, fingers, strict=True)
        ]
        self._chunk: ActionChunk | None = None
        self._before: tuple[RobotState, list[pin.SE3]] | None = None
        self._next = 0
        self._times: list[float] = []
        self._off: list[np.ndarray] = []
        self._asked: list[np.ndarray] = []
        self._demandable: list[np.ndarray] = []
        self._reasons: list[Reason | None] = []
        self._fingers: dict[str, LimitExcess] = {}
        self._uncovered = (0.0, 0.0)

    def follow(self, chunk: ActionChunk | None, report: PlanReport | None) -> None:
        """The chunk that is being followed, with its plan; another one than before replaces that from now on."""
        if chunk is None or chunk is self._chunk:
            return
        # Steps that were due before it came, or as it came, belong to the chunk before; chunks begin at ticks, so the
        # same step is due up to a tick earlier or later in both.
        begin = float(chunk.t_obs + max(report.steps[0], 0.0))
        since = max([begin, *(time + 0.5 / chunk.fps for time in self._times[-1:])])
        if self._chunk is not None:
            over, (first, lost) = float(self._due[-1]), self._uncovered
            gap = begin - over - 1.0 / chunk.fps
            if gap > 1e-6:
                self._uncovered = (first or over, lost + gap)
        self._chunk, self._due = chunk, chunk.times
        self._next = int(np.searchsorted(self._due, since + 1e-6))
        self._fair = demandable(chunk, report)

    def measure(
        self,
        state: RobotState,
        commanded: Mapping[str, np.ndarray],
        reason: Reason | None = None,
        carried: np.ndarray | None = None,
    ) -> None:
        """Score the step that has become due since the last state, if one has.

        Args:
            state: True state.
            commanded: Palm poses (4, 4) that are commanded in it, by side.
            reason: Why the chunk was not followed as given, if it was not.
            carried: How its poses have moved with a base that walks, shape (4, 4), if it does.
        """
        now = state, [pin.SE3(commanded[side]) for side in ("left", "right")]
        (before, led_before), self._before = self._before or now, now
        chunk, k = self._chunk, self._next
        if chunk is None or k >= len(chunk) or state.time < self._due[k] - 1e-6:
            return
        self._next += 1
        time = float(self._due[k])
        since = (time - before.time) / max(state.time - before.time, 1e-9)
        share = min(max(since, 0.0), 1.0)
        asked = _palms(chunk, k, self._offsets)
        if carried is not None:
            asked = [pin.SE3(carried) * T for T in asked]
        measured = _between(self._reached(before), self._reached(state), share)
        led = _between(led_before, now[1], share)
        self._times.append(time)
        self._off.append(np.array([_off(asked, measured), _off(asked, led), _off(led, measured)]))
        self._asked.append(np.array([T.translation for T in asked]))
        self._demandable.append(self._fair[k])
        self._reasons.append(reason)
        self._look_at_fingers(k, time)

    def _reached(self, state: RobotState) -> list[pin.SE3]:
        """Palm poses in world of a state, left first."""
        pin.framesForwardKinematics(self._model, self._data, state.q)
        return [self._data.oMf[frame].copy() for frame in self._palms]

    def _look_at_fingers(self, k: int, time: float) -> None:
        """Take note of fingers that a step asks past their range."""
        for q, (names, low, high) in zip((self._chunk.q_lhand[k], self._chunk.q_rhand[k]), self._ranges, strict=True):
            for i in np.flatnonzero(np.abs(q - np.clip(q, low, high)) > FINGER_TOLERANCE) if names else ():
                bound, value, period = float(np.clip(q[i], low[i], high[i])), float(q[i]), 1.0 / self._chunk.fps
                old = self._fingers.get(names[i], LimitExcess(time, 0.0, bound, bound))
                if abs(value - bound) > abs(old.worst - old.bound):
                    old = replace(old, worst=value, bound=bound)
                self._fingers[names[i]] = replace(old, seconds=old.seconds + period)

    @property
    def empty(self) -> bool:
        """Whether no chunk has been added yet."""
        return self._chunk is None

    def result(self) -> PalmErrors:
        """All steps so far."""
        off = np.array(self._off).reshape(-1, 3, 2, 2)
        return PalmErrors(
            times=np.array(self._times),
            errors=off[:, 0, :, 0],
            turns=off[:, 0, :, 1],
            moved=off[:, 1, :, 0],
            moved_turns=off[:, 1, :, 1],
            lags=off[:, 2, :, 0],
            lag_turns=off[:, 2, :, 1],
            demandable=np.array(self._demandable, dtype=bool).reshape(-1, 2),
            reasons=list(self._reasons),
            fingers=dict(self._fingers),
            uncovered=self._uncovered,
            asked=np.reshape(self._asked, (-1, 2, 3)),
        )


def _between(first: Sequence[pin.SE3], second: Sequence[pin.SE3], share: float) -> list[pin.SE3]:
    return [pin.SE3.Interpolate(a, b, share) for a, b in zip(first, second, strict=True)]


def _off(these: Sequence[pin.SE3], those: Sequence[pin.SE3]) -> np.ndarray:
    """Distances [m] and angles [rad] between the poses of both hands, shape (2, 2), a row a hand."""
    off = [a.actInv(b) for a, b in zip(these, those, strict=True)]
    return np.array([[np.linalg.norm(T.translation), np.linalg.norm(pin.log3(T.rotation))] for T in off])


def asked_palms(chunk: ActionChunk, time: float, spec: RobotSpec) -> np.ndarray:
    """Palm poses in world that a chunk asks for at a time, left first, shape (2, 4, 4).

    Between two steps they are interpolated; before the first and after the last step, that one counts.

    Args:
        chunk: A valid chunk.
        time: On the clock of its observation [s].
        spec: The robot.
    """
    step = min(max((time - chunk.t_obs) * chunk.fps, 0.0), len(chunk) - 1.0)
    k, offsets = min(int(step), max(len(chunk) - 2, 0)), palm_offsets(spec)
    first, second = _palms(chunk, k, offsets), _palms(chunk, min(k + 1, len(chunk) - 1), offsets)
    return np.stack([T.homogeneous for T in _between(first, second, step - k)])


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
    wanted = _palms(chunk, k, palm_offsets(spec))
    jumps = [pin.SE3(commanded[side]).actInv(T) for side, T in zip(("left", "right"), wanted, strict=True)]
    distances = [float(np.linalg.norm(jump.translation)) for jump in jumps]
    return max(distances), max(float(np.linalg.norm(pin.log3(jump.rotation))) for jump in jumps)


def _palms(chunk: ActionChunk, k: int, offsets: Sequence[np.ndarray]) -> list[pin.SE3]:
    """Palm poses in world that a step of a chunk asks for, left first."""
    poses = (chunk.T_world_lhand[k], chunk.T_world_rhand[k])
    return [pin.SE3(T[:3, :3], T[:3, :3] @ p + T[:3, 3]) for T, p in zip(poses, offsets, strict=True)]


def demandable(chunk: ActionChunk, report: PlanReport) -> np.ndarray:
    """Steps that a chunk may ask for: slow enough for the hands, and within reach of the trajectory.

    Returns:
        Shape (H, 2): wrist speed at most `DEMANDABLE_SPEED`, acceleration at most `DEMANDABLE_ACCELERATION`, posture
        plan within `DEMANDABLE_DISTANCE` at the step. Recordings contain glitches of 16 m/s, hence the definition.
    """
    fair = np.empty((len(chunk), 2), dtype=bool)
    for i, T in enumerate((chunk.T_world_lhand, chunk.T_world_rhand)):
        p = T[:, :3, 3]
        v = np.gradient(p, 1.0 / chunk.fps, axis=0) if len(p) > 1 else np.zeros_like(p)
        a = np.gradient(v, 1.0 / chunk.fps, axis=0) if len(p) > 1 else v
        slow = np.linalg.norm(v, axis=1) <= DEMANDABLE_SPEED
        fair[:, i] = slow & (np.linalg.norm(a, axis=1) <= DEMANDABLE_ACCELERATION)
    nearest = np.searchsorted(report.steps, chunk.times - chunk.t_obs - 1e-9).clip(0, len(report.steps) - 1)
    return fair & (report.tracking_error[nearest] <= DEMANDABLE_DISTANCE)
