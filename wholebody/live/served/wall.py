"""A served robot on the wall clock: MuJoCo and planner in processes of their own, the control loop in this one."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from policy.executor.executor import ExecutorConfig
from wholebody.config import ControllerConfig
from wholebody.config.description import describe
from wholebody.live import wire
from wholebody.live.robot_process import RobotProcess, World, WorldView
from wholebody.live.served.messages import Seen, Served
from wholebody.live.served.program import RemoteProgram, seen_by
from wholebody.live.session import Session, SessionConfig
from wholebody.types import RobotState

if TYPE_CHECKING:
    import socket

    from wholebody.execution.gate import Gate


ASKING = ExecutorConfig(replace_every=4)
"""A chunk is asked for at every target that says something new, and every 0.13 s: within
`wholebody.execution.ahead.hands_ahead.STREAM_GAP`, so that it counts as a stream all the while."""


class _Viewed(RobotProcess):
    """A robot whose world is shown to the one who serves it."""

    def start(self, page: socket.socket | None = None) -> RobotState:
        """Load the robot; it stands still until `go`. Answers its first state."""
        self.view, other = wire.wire()
        with other:
            return super().start(other)


class OnTheWall:
    """A session whose policy is another program.

    Args:
        served: Which robot, where, and how.
        settings: Of the controller.
        program: The other program.
        gate: Makes what judges plans, in the planner's process; nothing does if None.

    Raises:
        WholebodyError: If the processes do not come up.
    """

    def __init__(
        self, served: Served, settings: ControllerConfig, program: RemoteProgram, gate: Callable[[], Gate] | None = None
    ) -> None:
        self._program, world = program, World(describe(settings.robot), served.scene)
        self._robot = _Viewed(world, settings.dt)
        self._session = Session(settings, self._robot, SessionConfig(settle=0.0, hold=0.0), gate=gate)
        self._objects, self._greeted, self._ended = np.zeros((0, 7)), False, False

    @property
    def origin(self) -> float:
        """Instant of `time.monotonic` at which the robot's clock is 0 [s]."""
        return self._robot.origin

    def run(self) -> None:
        """Run until the program is gone or ends; then the robot is lowered."""
        self._session.run({"targets": self._program.stream}, self._tick, ASKING)

    def hasten(self) -> None:
        """Ask for a chunk that goes to the newest target."""
        if self._session.loop.executor is not None:
            self._session.loop.executor.hasten()

    def seen(self) -> Seen:
        """Present view of robot and world."""
        loop = self._session.loop
        if (view := wire.newest(self._robot.view)) is not None:
            self._objects = WorldView.of(view).objects
        return seen_by(loop, self._objects, loop.statistics.fallen is not None)

    def reset(self, seed: int = 0) -> None:
        """Nothing: time on the wall does not begin anew; the program is told what there is to see."""
        self._program.tell(self.seen())

    def place(self, objects: np.ndarray) -> None:
        """Nothing: only in lockstep is somebody there who puts things back."""

    def close(self) -> dict[str, object]:
        """End everything; a summary of the run."""
        loop, supervisor = self._session.loop, self._session.supervisor
        robot = self._session.close()
        summary = self._session.summary()
        fell = bool(summary["fell"] or robot.get("fall"))
        return summary | {"robot": robot, "fell": fell, "lowered": supervisor.lowered, "seconds": loop.clock.now()}

    def _tick(self, now: float) -> None:
        """After every tick of the loop, those of lowering too."""
        if not self._greeted:
            self._greeted = True
            self._program.tell(self.seen())
        self._program.serve(self)
        if not (self._program.there or self._ended):
            self._ended = True
            self._session.loop.stop()
