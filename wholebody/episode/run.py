"""The closed loop: policy, supervisor and plant, stepped."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from models.spec import RobotSpec
from policy.base import Policy
from policy.clock import SimulatedClock
from policy.executor.executor import Executor, ExecutorConfig
from policy.executor.simulated import simulated_executor
from policy.observation import Observation
from policy.recorded.replay import needed_until
from wholebody.config.bounds import require_all
from wholebody.episode.chunk_seams import commanded_chunk
from wholebody.episode.meters import Meters
from wholebody.episode.observation import observation_of
from wholebody.episode.result import EpisodeResult
from wholebody.episode.tracking_error import asked_palms
from wholebody.execution.chunk_executor import ChunkExecutor
from wholebody.robot.plant import Plant
from wholebody.sim.recorder import Followed, Recorder
from wholebody.sim.sensors import Sensors
from wholebody.types import RobotState

Cameras = Callable[[], Mapping[str, np.ndarray]]
"""Images of the present moment: camera name to uint8 (height, width, 3), RGB."""


@dataclass(frozen=True, kw_only=True)
class EpisodeConfig:
    """How an episode runs."""

    settle: float = 1.0
    """Standing before the first chunk [s]."""
    hold: float = 4.0
    """Standing after the last step: one run fell 2.1 s after it looked fine [s]."""
    lead_in: float = 0.0
    """Time of the input before what is asked of the robot begins, for a plan of that to be there when it does [s]."""
    replace_every: int = 25
    """Chunk steps after which a new chunk is asked for; an executor has its own setting."""
    task: str = ""
    """What to do, in words."""
    cameras: Cameras | None = None
    """Called once an observation for its images."""
    begin: RobotState | None = None
    """State in which the robot begins; the stance if None."""

    def __post_init__(self) -> None:
        require_all(self)


def observe(
    spec: RobotSpec,
    supervisor: ChunkExecutor,
    state: RobotState,
    task: str = "",
    images: Mapping[str, np.ndarray] | None = None,
    now: float | None = None,
    objects: np.ndarray | None = None,
) -> Observation:
    """What a policy sees of the robot: the state that the controller would go on with, so no chunk begins at a glitch.

    Args:
        spec: The robot.
        supervisor: Knows the order of the joints, and which states can be used.
        state: As measured.
        task: What to do, in words.
        images: Camera name to image, uint8, shape (height, width, 3).
        now: Present time on the clock of the states [s]; the state's own if not given.
        objects: Poses of the scene's bodies that move, for policies that are told where things are, shape (k, 7).
    """
    state = supervisor.monitor.trusted(state, state.time if now is None else now)
    return observation_of(spec, supervisor.robot, state, task, images, objects)


def followed(supervisor: ChunkExecutor, now: float) -> Followed:
    """What a supervisor followed in its last step, for a recording.

    Args:
        supervisor: After `step`.
        now: Time of that step [s].
    """
    chunk, palms, plans = supervisor.chunk, supervisor.palm_reference(), supervisor.handover
    asked, carried = None if chunk is None else asked_palms(chunk, now, supervisor.spec), supervisor.carried
    return Followed(
        asked=asked if asked is None or carried is None else carried @ asked,
        commanded=np.stack([palms["left"], palms["right"]]),
        status=supervisor.status,
        rate=supervisor.rate,
        planning_time=0.0 if plans is None else plans.planning_time,
    )


def run_episode(
    policy: Policy | Executor,
    supervisor: ChunkExecutor,
    plant: Plant,
    *,
    duration: float,
    config: EpisodeConfig | None = None,
    sensors: Sensors | None = None,
    recorder: Recorder | None = None,
    progress: Callable[[float, float], None] | None = None,
) -> EpisodeResult:
    """Run a policy through the controller on a plant.

    Args:
        policy: Source of chunks: a policy, which answers in no time, or an executor on a simulated clock.
        supervisor: Made for the plant's robot: a `Supervisor`, or an `AsGiven`.
        plant: Robot and surroundings, such as a `MujocoPlant`; reset here.
        duration: Time for which chunks are asked for, after the settling time [s].
        config: How the episode runs.
        sensors: What the controller is told of the true state; the truth itself if not given.
        recorder: Collects every control period; what it held is forgotten.
        progress: Called about ten times a simulated second with the time and the end time [s].

    Raises:
        TypeError: If an executor's clock is not a simulated one, or the plant has no `place` that the policy needs.
    """
    config = config or EpisodeConfig()
    state, measure = plant.reset() if config.begin is None else plant.reset(config.begin), _measures(sensors)
    supervisor.reset(measured := measure(state), state.time)
    executor, clock = _executor(policy, config, supervisor.config.planning.lead)
    _arrange(executor.policy, plant)
    meters = Meters(supervisor, plant, executor, config.settle + config.lead_in)
    asking = config.settle + max(duration, plant.control_dt)  # even the shortest input is asked for once
    until = config.settle + needed_until(executor.policy, duration)

    def seen() -> Observation:
        return observe(plant.spec, supervisor, measured, config.task, *_around(config, executor, plant, state.time))

    if recorder is not None:
        recorder.begin(meters.result.orientation_free)
    end, tick = config.settle + duration + config.hold, 0
    while state.time < end - 1e-9 and meters.result.fall is None:
        if config.settle - 1e-9 <= state.time < asking - 1e-9:
            clock.set(max(state.time, clock.now()))
            chunk = executor.poll(seen, partial(commanded_chunk, supervisor), until)
            if chunk is not None:
                answer = supervisor.accept(chunk, state.time)
                meters.offered(chunk, executor, answer, supervisor)
        command = supervisor.step(measured, state.time)
        _expect(sensors, supervisor)
        meters.refused(supervisor.take_refusal(), executor)
        meters.commanded(supervisor, state)
        if recorder is not None:
            recorder.add(state, command, followed(supervisor, state.time), plant)
        state, tick = plant.step(command), tick + 1
        measured = measure(state)
        meters.after(supervisor, plant, state)
        if progress is not None and tick % 50 == 0:
            progress(state.time, end)
    return meters.finish(supervisor)


def _around(
    config: EpisodeConfig, executor: Executor, plant: Plant, now: float
) -> tuple[Mapping[str, np.ndarray] | None, float, np.ndarray | None]:
    """Pictures, the time, and poses of the scene's things (k, 7) for a policy that is told of them."""
    told = getattr(executor.policy, "sees_objects", False)
    return config.cameras and config.cameras(), now, plant.objects() if told else None


def _arrange(policy: Policy, plant: Plant) -> None:
    """Put the scene's things where a policy draws them; most draw nothing."""
    if (arranged := getattr(policy, "arranged", None)) is None:
        return
    if (put := getattr(plant, "place", None)) is None:
        raise TypeError(f"a {type(plant).__name__} has no place(poses) to put things where the policy draws them")
    put(arranged(plant.objects()))


def _measures(sensors: Sensors | None) -> Callable[[RobotState], RobotState]:
    """What the controller is told of a true state, from now on."""
    if sensors is None:
        return lambda state: state
    sensors.reset()
    return sensors.measure


def _expect(sensors: Sensors | None, supervisor: ChunkExecutor) -> None:
    """Tell an estimator which feet are to stand, where they may step."""
    if sensors is not None and supervisor.config.steps != "never":
        sensors.estimator.expect(supervisor.contacts)


def _executor(policy: Policy | Executor, config: EpisodeConfig, lead: float) -> tuple[Executor, SimulatedClock]:
    """Executor of the policy and its clock, ready at the end of the settling time; ``lead``: of its plans [s]."""
    if isinstance(policy, Executor):
        executor = policy
    else:
        executor = simulated_executor(policy, config=ExecutorConfig(replace_every=config.replace_every))
    clock = executor.clock
    if not isinstance(clock, SimulatedClock):
        raise TypeError(f"the executor has a {type(clock).__name__}; MuJoCo is stepped on a SimulatedClock")
    executor.lead = max(executor.config.lead, lead)
    clock.restart(config.settle)
    executor.reset(config.task)
    return executor, clock
