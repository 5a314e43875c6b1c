"""A served robot whose time passes as the program lets it: one process, nothing depends on how fast it computes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from policy.clock import SimulatedClock
from policy.executor.executor import Executor
from policy.executor.simulated import SimulatedWorker
from wholebody.config import ControllerConfig
from wholebody.config.description import describe
from wholebody.episode.warm_up import compile_plan
from wholebody.estimation.state_estimator import StateEstimator
from wholebody.execution.gate import Gate
from wholebody.execution.supervisor import Supervisor
from wholebody.live.loop import ControlLoop
from wholebody.live.served.messages import Seen, Served
from wholebody.live.served.program import RemoteProgram, seen_by
from wholebody.live.served.wall import ASKING
from wholebody.live.session import lower
from wholebody.sim.fall import Fall, detect_fall
from wholebody.sim.plant import MujocoPlant
from wholebody.sim.robot_errors import REALISTIC_ROBOT, RealisticPlant
from wholebody.sim.sensors import REALISTIC_READINGS, Sensors
from wholebody.types import JointCommand, RobotState

SETTLE = 1.0
"""Simulated time of standing before the program sees the robot [s]; chosen: as in episodes."""


class SteppedRobot:
    """MuJoCo as a robot that moves when its state is asked for, by one period. A `RobotLink`.

    Args:
        plant: Robot and surroundings.
        clock: Set to the plant's time.
        sensors: What is told of the true state; the truth itself if None.

    Attributes:
        origin: 0: its clock is its own.
        fall: The fall, or None.
    """

    def __init__(self, plant: MujocoPlant, clock: SimulatedClock, sensors: Sensors | None = None) -> None:
        self.origin = 0.0
        self.plant, self._clock, self._sensors, self.fall = plant, clock, sensors, None
        self._command: JointCommand | None = None

    def receive(self, timeout: float) -> RobotState:
        """The state after another control period."""
        state = self.plant.state() if self._command is None else self.plant.step(self._command)
        self._clock.set(max(state.time, self._clock.now()))
        return state if self._sensors is None else self._sensors.measure(state)

    def reset(self) -> RobotState:
        """Its first state: in the stance, at rest."""
        self._command = self.fall = None
        state = self.plant.reset()
        if self._sensors is None:
            return state
        self._sensors.reset()
        return self._sensors.measure(state)

    def send(self, command: JointCommand) -> None:
        """Command the motors for the next period."""
        self._command = command

    def watch(self, loop: ControlLoop) -> Fall | None:
        """The fall so far, or None."""
        self.fall = self.fall or detect_fall(self.plant, self.plant.state(), loop.supervisor.status.status)
        return self.fall


class InLockstep:
    """Controller, planner and MuJoCo in one process, stepped.

    A plan takes the simulated time that the settings say, a program's own computing takes none.

    Args:
        served: Which robot, where, and how.
        settings: Of the controller.
        program: The other program.
        gate: Makes what judges plans; nothing does if None.

    Attributes:
        origin: 0: stamps are simulated time.

    Raises:
        WholebodyError: If a setting is wrong.
    """

    def __init__(
        self, served: Served, settings: ControllerConfig, program: RemoteProgram, gate: Callable[[], Gate] | None = None
    ) -> None:
        spec = describe(settings.robot)
        self.origin, self._program, self._clock = 0.0, program, SimulatedClock()
        self._ended: float | None = None
        self._served = served
        self._supervisor = Supervisor(spec, settings, gate=gate and gate())
        self._robot = self._a_robot(0)
        compile_plan(spec)
        state = self._robot.reset()
        self._supervisor.reset(state, state.time)
        self._loop = ControlLoop(spec, self._supervisor, self._robot, state, clock=self._clock, scored=False)
        self._executor = Executor(
            program.stream, self._clock, config=ASKING, worker=SimulatedWorker(program.stream, self._clock, lambda: 0.0)
        )
        self._executor.lead = settings.planning.lead

    def run(self) -> None:
        """Run until the program is gone or ends; then the robot is lowered."""
        loop, program = self._loop, self._program
        program.until = SETTLE

        def going(now: float) -> bool:
            self._robot.watch(loop)
            while program.there and self._clock.now() + 0.5 * loop.dt > program.until:
                if loop.executor is None:
                    self._greet()
                program.serve(self, wait=True)
            return program.there

        loop.run(going)
        loop.executor, self._ended = None, self._clock.now()
        lower(loop, lambda now: self._robot.watch(loop))

    def _greet(self) -> None:
        """The robot stands: the program sees it, and its targets are followed from now on."""
        self._executor.reset()
        self._loop.executor = self._executor
        self._program.tell(self.seen())

    def reset(self, seed: int = 0) -> None:
        """Put the robot, a realistic one of a seed, into its stance, and tell the program once it stands."""
        self._clock.restart()
        self._loop.executor, self._program.until = None, SETTLE
        if self._served.realistic:
            self._robot = self._loop.robot = self._a_robot(seed)
        self._loop.restart(self._robot.reset())

    def _a_robot(self, seed: int) -> SteppedRobot:
        """A robot as its model is, or a realistic one of a seed."""
        spec, dt, scene = self._supervisor.spec, self._supervisor.config.dt, self._served.scene
        if not self._served.realistic:
            return SteppedRobot(MujocoPlant(spec, scene=scene, control_dt=dt), self._clock)
        sensors = Sensors(spec, replace(REALISTIC_READINGS, seed=seed), dt, StateEstimator(spec))
        errors = replace(REALISTIC_ROBOT, seed=seed)
        return SteppedRobot(
            RealisticPlant(spec, errors, encoders=sensors, scene=scene, control_dt=dt), self._clock, sensors
        )

    def place(self, objects: np.ndarray) -> None:
        """Put the scene's bodies that move elsewhere."""
        self._robot.plant.place(objects)

    def hasten(self) -> None:
        """Ask for a chunk that goes to the newest target."""
        self._executor.hasten()

    def seen(self) -> Seen:
        """Present view of robot and world."""
        return seen_by(self._loop, self._robot.plant.objects(), self._robot.fall is not None)

    def close(self) -> dict[str, object]:
        """End everything; a summary of the run."""
        statistics, fall = self._loop.statistics, self._robot.fall
        return {
            "fell": fall is not None,
            "fell_at": fall.time if fall else None,
            "lowering_from": self._ended,
            "robot": {"fall": fall.cause if fall else ""},
            "lowered": self._supervisor.lowered,
            "seconds": self._clock.now(),
            "chunks": {"accepted": statistics.accepted, "refused": dict(statistics.refusals)},
            "reasons": dict(statistics.reasons),
            "time_factor": self._supervisor.time_factor,
        }
