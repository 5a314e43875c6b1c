"""Judge inputs by planning and simulating them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, replace
from typing import Any, Protocol, cast

from policy.base import Policy
from policy.chunk import ActionChunk
from policy.executor.executor import Executor
from wholebody.config import ControllerConfig
from wholebody.config.bounds import require_run
from wholebody.config.description import describe
from wholebody.episode.result import EpisodeResult, Note
from wholebody.episode.run import Cameras, EpisodeConfig, run_episode
from wholebody.estimation.state_estimator import StateEstimator
from wholebody.execution.as_given import AsGiven
from wholebody.execution.supervisor import Supervisor
from wholebody.sim.plant import MujocoPlant
from wholebody.sim.recorder import Recorder
from wholebody.sim.robot_errors import RealisticPlant, RobotErrors
from wholebody.sim.sensors import SensorConfig, Sensors
from wholebody.verdict.chunk_gate import ChunkGate
from wholebody.verdict.fast import FastChecker
from wholebody.verdict.input_steps import far_from_stance, last_step, row_rate, within
from wholebody.verdict.verdict import Follow, Verdict, verdict_of

TIMESTEP = 0.002
"""Longest physics step [s]; chosen: one control period at 500 Hz."""


class RecordedPolicy(Policy, Protocol):
    """A recording as a policy, also one that is watched.

    Attributes:
        duration: How long it lasts [s].
        episode: All of it as one chunk.
    """

    duration: float
    episode: ActionChunk

    def held(self, seconds: float) -> RecordedPolicy:
        """RecordedPolicy with its first step held for so long [s]."""
        ...


class Checker:
    """Holds the loaded robot, so that many inputs are cheap.

    Args:
        scene: Name of a scene of `models.scenes`, or a MuJoCo file (.xml).
        config: Of the robot and its controller.
        episode: How an episode runs.
        sensors: Errors of the sensors; the controller gets the true state if not given.
        errors: How the robot differs from its model; then its state is estimated from readings.
        follow: ``planned``, ``gated``: what a `ChunkGate` clears or its plan repairs, or ``as_given``, see `AsGiven`.
        **world: Further settings of the plant: physics step, masses in the hands, which the controller observes, or is
            told by ``config.loads``, and friction of the floor.
    """

    def __init__(
        self,
        scene: str = "floor",
        config: ControllerConfig | None = None,
        *,
        episode: EpisodeConfig | None = None,
        sensors: SensorConfig | None = None,
        errors: RobotErrors | None = None,
        follow: Follow = "planned",
        **world: Any,
    ) -> None:
        config = config or ControllerConfig()
        spec = describe(config.robot)
        self.scene, self.episode, dt = scene, episode or EpisodeConfig(), config.dt
        world["timestep"] = min(world.get("timestep", TIMESTEP), dt)
        estimator = None if errors is None else StateEstimator(spec)
        self.sensors = Sensors(spec, sensors, dt, estimator) if sensors is not None else None
        # The plant before the supervisor: a scene that does not exist is told at once.
        if errors is None:
            self.plant = MujocoPlant(spec, scene=scene, control_dt=dt, **world)
        else:
            plant = RealisticPlant(spec, errors, encoders=self.sensors, scene=scene, control_dt=dt, **world)
            self.plant, self._payload = plant, plant.payload_kg
        self.gate = ChunkGate(FastChecker(config, scene)) if follow == "gated" else None
        self.supervisor: AsGiven | Supervisor = (
            AsGiven(spec, config) if follow == "as_given" else Supervisor(spec, config, gate=self.gate)
        )
        self.follow, self._errors = follow, errors

    @property
    def robot(self) -> str:
        """Which robot is simulated, and what the controller is told of it."""
        if self._errors is None:
            return "true" if self.sensors is None else f"true, errors of sensors with seed {self.sensors.config.seed}"
        left, right = self._payload
        knows = "true state" if self.sensors is None else "state estimated from readings"
        return f"realistic, seed {self._errors.seed}, {left:.2f} and {right:.2f} kg in its hands, {knows}"

    def recorder(self) -> Recorder:
        """A recorder for this robot and scene."""
        return Recorder(self.supervisor.spec, self.scene, self.supervisor.config)

    def check(
        self,
        policy: Policy | Executor,
        name: str,
        duration: float,
        *,
        cameras: Cameras | None = None,
        progress: Callable[[float, float], None] | None = None,
        recorder: Recorder | None = None,
    ) -> tuple[Verdict, EpisodeResult]:
        """Judge a policy's episode.

        Where the robot begins in a state of its own (``episode.begin``), the first step of a recording is held until a
        plan of it can be there.

        Args:
            policy: Source of the chunks: a policy, or an executor that says how late it is.
            name: What to call the input.
            duration: How long to run it [s].
            cameras: What the policy's cameras see, such as `wholebody.sim.cameras.RenderedCameras`; nothing if None.
            progress: See `run_episode`.
            recorder: See `run_episode`.

        Raises:
            InputError: If the duration is negative or longer than six hours.
        """
        require_run("duration", duration)
        # By its attributes: of one that is watched, an instance check does not see them.
        placed = self.episode.begin is not None and hasattr(policy, "held")
        recording = cast(RecordedPolicy, policy) if placed else None
        given, lead_in = policy, 0.0
        if recording is not None:
            # A plan is there when the recording begins, as in the midst of a longer one.
            policy = longer = recording.held(self.supervisor.config.planning.lead)
            lead_in = longer.duration - recording.duration
        if self.gate is not None:
            layout = (policy.policy if isinstance(policy, Executor) else policy).spec
            self.gate.begin(layout.orientation_free)
        result = run_episode(
            policy,
            self.supervisor,
            self.plant,
            duration=duration + lead_in,
            config=replace(self.episode, lead_in=lead_in, cameras=cameras or self.episode.cameras),
            sensors=self.sensors,
            recorder=recorder,
            progress=progress,
        )
        if recording is not None:
            far = far_from_stance(recording.episode, self.plant.spec, result.orientation_free)
            result.notes += [Note(result.start, text) for text in far]
            result.placed = True
        config = self.supervisor.config
        plans = self.supervisor.handover
        summary = None if self.gate is None or plans is None else self.gate.summary(plans.late)
        verdict = verdict_of(name, result, asdict(config), bounds=config.verdict)
        last = last_step(given, duration, result.fps)
        verdict = replace(verdict, robot=self.robot, follow=self.follow, gate=summary)
        return within(verdict, last, row_rate(given)), result
