"""What is measured in every control period of an episode, and where a plan is taken over."""

from __future__ import annotations

import numpy as np

from models.spec import RobotSpec
from policy.action_spec.spec import ActionSpec
from policy.chunk import ActionChunk
from policy.executor.executor import Executor
from wholebody.episode.chunk_seams import SeamMeter
from wholebody.episode.result import EpisodeResult, Note, Refusal
from wholebody.episode.tracking_error import TrackingError, start_jump
from wholebody.execution.chunk_executor import ChunkExecutor
from wholebody.execution.feet.led import notes
from wholebody.planning.plan import PlanReport
from wholebody.robot.plant import Plant
from wholebody.robot.standing import pelvis_tilt
from wholebody.sim.fall import detect_fall
from wholebody.sim.limit_monitor import LimitMonitor
from wholebody.sim.motor_heat import HeatMeter
from wholebody.types import Reason, RobotState, Status, StatusReport


class Meters:
    """Measurements of an episode."""

    def __init__(self, supervisor: ChunkExecutor, plant: Plant, executor: Executor, start: float) -> None:
        free = executor.policy.spec.orientation_free
        self.result = EpisodeResult(start=start, execution=executor.report, orientation_free=free)
        self._tracking_error = TrackingError(supervisor)
        self._seams, self._limits = SeamMeter(plant.control_dt), LimitMonitor(plant)
        self._heat = HeatMeter(plant)
        self._plan: PlanReport | None = None
        self._came: dict[float, float] = {}  # when the chunk of an observation came, until one is followed [s]
        self._chunk: ActionChunk | None = None
        self._palms = supervisor.palm_reference()
        self._left_out = _left_out(supervisor.spec, executor.policy.spec)

    def offered(self, chunk: ActionChunk, executor: Executor, answer: StatusReport, supervisor: ChunkExecutor) -> None:
        """Take note of a chunk that the supervisor has got and answered, and walks with or not."""
        self.result.fps = chunk.fps
        if self._tracking_error.empty:
            self._came[chunk.t_obs] = executor.clock.now()
        texts = (*notes(chunk, walked=supervisor.walks, not_led=supervisor.not_led), *self._left_out)
        self.result.notes += [Note(executor.clock.now(), text) for text in texts]
        self.refused(answer, executor)

    def refused(self, answer: StatusReport | None, executor: Executor) -> None:
        """Tell the executor where the supervisor does not follow its chunk."""
        if answer is not None and answer.status is Status.HOLD and answer.reason:
            executor.refused(answer.reason, answer.detail)

    def commanded(self, supervisor: ChunkExecutor, state: RobotState) -> None:
        """Note the command in a true state."""
        if supervisor.plan_report is not self._plan:
            self._plan = supervisor.plan_report
            self._taken_over(supervisor, state.time)
        self._palms = supervisor.palm_reference()
        self._seams.add(self._palms)
        self._tracking_error.measure(
            state, self._palms, supervisor.moved_for or supervisor.status.reason, supervisor.carried
        )

    def _taken_over(self, supervisor: ChunkExecutor, now: float) -> None:
        """A plan was taken over: what it changes in the chunk."""
        result, chunk, report = self.result, supervisor.chunk, self._plan
        if self._tracking_error.empty:
            # A chunk that came at once begins with its first step; of a late one, what it missed is lost.
            late = self._came.get(chunk.t_obs, chunk.t_obs) > chunk.t_obs + 0.5 / chunk.fps
            due = chunk.t_obs + float(report.steps[0]) * late
            result.start_jump = start_jump(chunk, due, self._palms, supervisor.spec)
            result.start_palms = np.array([self._palms[side][:3, 3] for side in ("left", "right")])
        result.executed += chunk is not self._chunk
        self._chunk = chunk
        self._seams.mark(now)
        self._tracking_error.follow(chunk, report)
        if report.slowdown > result.slowdown:
            result.slowdown, result.slowed_time = report.slowdown, chunk.t_obs

    def after(self, supervisor: ChunkExecutor, plant: Plant, state: RobotState) -> None:
        """Take note of the state that it led to."""
        self._limits.look(state.time, supervisor.contacts)
        self._heat.look()
        _count(self.result, supervisor, plant, state)

    def finish(self, supervisor: ChunkExecutor) -> EpisodeResult:
        """Result of the episode, with all that was measured."""
        result, limits = self.result, self._limits
        result.time_factor, result.seams = supervisor.time_factor, self._seams.seams
        result.palms = self._tracking_error.result()
        result.torques, result.positions, result.edge = limits.torques, limits.positions, limits.edge
        result.heat = self._heat.hottest()
        result.margin, result.creep, result.steps = limits.margin, limits.creep, limits.steps
        faults = (event for event in result.execution.events if event.code != Reason.STARVED)
        result.refusals = [Refusal(event.time, Reason(event.code), event.detail) for event in faults]
        return result


def _left_out(robot: RobotSpec, layout: ActionSpec) -> tuple[str, ...]:
    """What a layout asks of fingers that the robot does not have, as a note on every chunk."""
    asked = [slot.name for slot in layout.slots if slot.name.endswith(("_hand", "_grasp"))]
    if not asked or any(tool.finger_joints for tool in robot.tools):
        return ()
    return (f"the robot has no fingers: what the layout asks of {', '.join(asked)} is left out",)


def _hands(robot: RobotSpec, which: tuple[bool, bool]) -> tuple[str, ...]:
    """How the names of the bodies of some hands begin."""
    chosen = (tool for tool, one in zip(robot.tools, which, strict=True) if one)
    return tuple(name for tool in chosen for name in (tool.wrist_frame, f"{tool.side}_hand"))


def _count(result: EpisodeResult, supervisor: ChunkExecutor, plant: Plant, state: RobotState) -> None:
    status = supervisor.status
    for counts, key in ((result.seconds, status.status.value), (result.reasons, status.reason)):
        if key:
            counts[key] = counts.get(key, 0.0) + plant.control_dt
    if status.reason:
        result.first_reasons.setdefault(status.reason, (state.time, status.detail))
    chunk = supervisor.chunk
    wanted = _hands(supervisor.spec, (False, False) if chunk is None else chunk.pushes)
    for pair in plant.contacts():
        own = all(plant.is_robot(body) for body in pair)
        if own or not any(body.startswith(wanted) for body in pair):
            (result.contacts if own else result.scene_contacts).setdefault(pair, state.time)
    result.tilt = max(result.tilt, pelvis_tilt(state))
    result.fall = detect_fall(plant, state, status.status)
