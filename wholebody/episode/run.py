"""The closed loop: policy, supervisor and plant, stepped."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial

import numpy as np
import pinocchio as pin

from models.spec import RobotSpec
from policy.base import Policy
from policy.chunk import ActionChunk
from policy.clock import SimulatedClock
from policy.executor.executor import Executor, ExecutorConfig
from policy.executor.report import ExecutionReport
from policy.executor.simulated import simulated_executor
from policy.joints import BODY_JOINTS
from policy.observation import Observation
from wholebody.config_bounds import require_all
from wholebody.episode.chunk_seams import ChunkSeam, SeamMeter, commanded_chunk
from wholebody.episode.tracking_error import PalmErrors, TrackingError, start_jump
from wholebody.execution.supervisor import Supervisor
from wholebody.robot.standing import pelvis_tilt
from wholebody.sim.fall import Fall, detect_fall
from wholebody.sim.limit_monitor import LimitExcess, LimitMonitor
from wholebody.sim.plant import MujocoPlant
from wholebody.sim.recorder import Recorder
from wholebody.sim.sensors import Sensors
from wholebody.types import Reason, RobotState, Status

Cameras = Callable[[], Mapping[str, np.ndarray]]
"""Images of the present moment: camera name to uint8 (height, width, 3), RGB."""


@dataclass(frozen=True, kw_only=True)
class EpisodeConfig:
    """How an episode runs."""

    settle: float = 1.0
    """Standing before the first chunk [s]."""
    hold: float = 4.0
    """Standing after the last step: one run fell 2.1 s after it looked fine [s]."""
    replace_every: int = 25
    """Chunk steps after which a new chunk is asked for; an executor has its own setting."""
    task: str = ""
    """What to do, in words."""
    cameras: Cameras | None = None
    """Called once an observation for its images."""

    def __post_init__(self) -> None:
        require_all(self)


@dataclass(frozen=True)
class Refusal:
    """A chunk that was refused, or that never came: simulated time [s], reason, and a sentence."""

    time: float
    reason: Reason
    detail: str


@dataclass(frozen=True)
class Note:
    """What decoding changed in a chunk or found odd: simulated time [s] and a sentence."""

    time: float
    text: str


@dataclass
class EpisodeResult:
    """What happened.

    Attributes:
        fall: Time and cause, or None.
        seconds: Time spent per status name [s].
        reasons: Time spent per reason code [s].
        first_reasons: When each reason was there first [s], and what was said then.
        palms: Palms at the steps of the chunks: asked, commanded and measured.
        orientation_free: Whether nothing is asked of the left and the right palm's orientation.
        time_factor: Time on chunks over chunk time covered.
        contacts: First time at which two bodies of the robot touched, by pair [s].
        scene_contacts: First time at which the robot touched something else, feet on the floor left out [s].
        torques: Body motors asked for more than their effort limit, by joint [N m].
        positions: Joints past a position limit, by joint [rad].
        edge: The centre of pressure at the edge of the soles [m], or None.
        margin: Least distance of the centre of pressure from the edge of the soles [m].
        creep: Largest distance that a sole slid [m].
        tilt: Largest pelvis tilt [rad].
        refusals: Chunks that were refused or never came.
        notes: What decoding changed in the chunks or found odd.
        slowdown: Largest planned slow-down factor, and when that chunk came [s].
        start: When the first chunk was asked for [s].
        start_jump: How far the first chunk began from where the hands were: distance [m] and angle [rad].
        fps: Steps per second of the chunks [Hz]; 0 before the first.
        stitches: Jump of the commanded palms at every chunk.
        execution: What the executor saw.
    """

    fall: Fall | None = None
    seconds: dict[str, float] = field(default_factory=dict)
    reasons: dict[str, float] = field(default_factory=dict)
    first_reasons: dict[Reason, tuple[float, str]] = field(default_factory=dict)
    palms: PalmErrors = field(default_factory=PalmErrors)
    orientation_free: tuple[bool, bool] = (False, False)
    time_factor: float = 1.0
    contacts: dict[tuple[str, str], float] = field(default_factory=dict)
    scene_contacts: dict[tuple[str, str], float] = field(default_factory=dict)
    torques: dict[str, LimitExcess] = field(default_factory=dict)
    positions: dict[str, LimitExcess] = field(default_factory=dict)
    edge: LimitExcess | None = None
    margin: float = float("inf")
    creep: float = 0.0
    tilt: float = 0.0
    refusals: list[Refusal] = field(default_factory=list)
    notes: list[Note] = field(default_factory=list)
    slowdown: float = 1.0
    slowed_time: float = 0.0
    start: float = 0.0
    start_jump: tuple[float, float] = (0.0, 0.0)
    fps: float = 0.0
    stitches: list[ChunkSeam] = field(default_factory=list)
    execution: ExecutionReport | None = None

    @property
    def times(self) -> np.ndarray:
        """When each chunk step was due, shape (n,), [s]."""
        return self.palms.times

    @property
    def errors(self) -> np.ndarray:
        """Palm errors against the chunks at their own times, shape (n, 2), [m]."""
        return self.palms.errors

    @property
    def turns(self) -> np.ndarray:
        """Angles of the palms' orientations to those asked for, shape (n, 2), [rad]."""
        return self.palms.turns

    @property
    def rms(self) -> float:
        """Root mean square palm error [m]; 0 if nothing was scored."""
        return float(np.sqrt(np.mean(self.errors**2))) if self.errors.size else 0.0


def observe(
    spec: RobotSpec,
    supervisor: Supervisor,
    state: RobotState,
    task: str = "",
    images: Mapping[str, np.ndarray] | None = None,
) -> Observation:
    """What a policy sees of the robot.

    Args:
        spec: The robot.
        supervisor: Knows the order of the joints.
        state: As measured.
        task: What to do, in words.
        images: Camera name to image, uint8, shape (height, width, 3).
    """
    joints = state.q[7:][supervisor.robot.pin_to_motor]
    fingers = [joints[spec.indices(tool.finger_joints)] for tool in spec.tools]
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = pin.Quaternion(state.q[3:7]).toRotationMatrix(), state.q[:3]
    return Observation(
        time=state.time,
        q_body=joints[: len(BODY_JOINTS)],
        q_lhand=fingers[0],
        q_rhand=fingers[1],
        T_world_base=T,
        images=images or {},
        task=task,
    )


def run_episode(
    policy: Policy | Executor,
    supervisor: Supervisor,
    plant: MujocoPlant,
    *,
    duration: float,
    config: EpisodeConfig | None = None,
    sensors: Sensors | None = None,
    recorder: Recorder | None = None,
    progress: Callable[[float, float], None] | None = None,
) -> EpisodeResult:
    """Run a policy through the controller in MuJoCo.

    Args:
        policy: Source of chunks: a policy, which then answers in no time, or an executor on a simulated clock, whose
            worker may be simulated or a thread.
        supervisor: Made for the plant's robot.
        plant: Where it happens; reset here.
        duration: Time for which chunks are asked for, after the settling time [s].
        config: How the episode runs.
        sensors: What the controller is told of the true state; the truth itself if not given.
        recorder: Where to write every control period.
        progress: Called about ten times a simulated second with the time and the end time [s].

    Raises:
        TypeError: If an executor's clock is not a simulated one.
    """
    config = config or EpisodeConfig()
    state = plant.reset()
    if sensors is not None:
        sensors.reset()
    measure = (lambda state: state) if sensors is None else sensors.measure
    measured = measure(state)
    supervisor.reset(measured)
    executor = _executor(policy, config)
    meters = _Meters(supervisor, plant, executor, config.settle)
    asking = config.settle + max(duration, plant.control_dt)  # even the shortest input is asked for once

    def seen() -> Observation:
        images = config.cameras() if config.cameras is not None else {}
        return observe(plant.spec, supervisor, measured, task=config.task, images=images)

    end, tick = config.settle + duration + config.hold, 0
    while state.time < end - 1e-9 and meters.result.fall is None:
        if config.settle - 1e-9 <= state.time < asking - 1e-9:
            executor.clock.set(max(state.time, executor.clock.now()))
            chunk = executor.poll(seen, partial(commanded_chunk, supervisor))
            if chunk is not None and _offer(chunk, supervisor, meters.score, meters.result, executor):
                meters.seams.mark(state.time)
        command = supervisor.step(measured)
        palms = meters.before(supervisor)
        if recorder is not None:
            recorder.add(state, command, palms, supervisor.status, plant)
        state = plant.step(command)
        measured = measure(state)
        meters.after(supervisor, plant, state, palms)
        tick += 1
        if progress is not None and tick % 50 == 0:
            progress(state.time, end)
    return meters.finish(supervisor)


class _Meters:
    """What is measured in an episode."""

    def __init__(self, supervisor: Supervisor, plant: MujocoPlant, executor: Executor, start: float) -> None:
        free = executor.policy.spec.orientation_free
        self.result = EpisodeResult(start=start, execution=executor.report, orientation_free=free)
        self.score = TrackingError(supervisor)
        self.seams, self._limits = SeamMeter(plant.control_dt), LimitMonitor(plant)

    def before(self, supervisor: Supervisor) -> dict[str, np.ndarray]:
        """Take note of what is commanded; the palm poses (4, 4), by side."""
        self.score.follow(supervisor.chunk, supervisor.plan_report)
        palms = supervisor.palm_reference()
        self.seams.add(palms)
        return palms

    def after(
        self, supervisor: Supervisor, plant: MujocoPlant, state: RobotState, palms: dict[str, np.ndarray]
    ) -> None:
        """Take note of the state that it led to."""
        self._limits.look(state.time)
        _count(self.result, supervisor, plant, state)
        self.score.measure(state, palms, supervisor.status.reason)

    def finish(self, supervisor: Supervisor) -> EpisodeResult:
        """The result with what was collected along the way."""
        result, score, limits = self.result, self.score, self._limits
        result.time_factor, result.stitches = supervisor.time_factor, self.seams.stitches
        result.palms = score.result()
        result.torques, result.positions, result.edge = limits.torques, limits.positions, limits.edge
        result.margin, result.creep = limits.margin, limits.creep
        faults = (event for event in result.execution.events if event.code != Reason.STARVED)
        result.refusals = [Refusal(event.time, Reason(event.code), event.detail) for event in faults]
        return result


def _executor(policy: Policy | Executor, config: EpisodeConfig) -> Executor:
    """Whatever runs the policy, ready at the end of the settling time."""
    executor = policy
    if not isinstance(policy, Executor):
        executor = simulated_executor(policy, config=ExecutorConfig(replace_every=config.replace_every))
    if not isinstance(executor.clock, SimulatedClock):
        raise TypeError(f"the executor has a {type(executor.clock).__name__}; MuJoCo is stepped on a SimulatedClock")
    executor.clock.restart(config.settle)
    executor.reset(config.task)
    return executor


def _offer(
    chunk: ActionChunk, supervisor: Supervisor, score: TrackingError, result: EpisodeResult, executor: Executor
) -> bool:
    """Hand a chunk to the supervisor; whether it was accepted."""
    poses = supervisor.palm_reference()
    status = supervisor.accept(chunk)
    result.fps = chunk.fps
    result.notes += [Note(executor.clock.now(), text) for text in chunk.notes]
    if status.status is Status.HOLD and status.reason:
        executor.refused(status.reason, status.detail)
        return False
    report = supervisor.plan_report
    if score.empty:
        result.start_jump = start_jump(chunk, chunk.t_obs + float(report.steps[0]), poses, supervisor.spec)
    if report.slowdown > result.slowdown:
        result.slowdown, result.slowed_time = report.slowdown, chunk.t_obs
    return True


def _count(result: EpisodeResult, supervisor: Supervisor, plant: MujocoPlant, state: RobotState) -> None:
    status = supervisor.status
    for counts, key in ((result.seconds, status.status.value), (result.reasons, status.reason)):
        if key:
            counts[key] = counts.get(key, 0.0) + plant.control_dt
    if status.reason:
        result.first_reasons.setdefault(status.reason, (state.time, status.detail))
    for pair in plant.contacts():
        own = all(plant.is_robot(body) for body in pair)
        (result.contacts if own else result.scene_contacts).setdefault(pair, state.time)
    result.tilt = max(result.tilt, pelvis_tilt(state))
    result.fall = detect_fall(plant, state, status.status)
