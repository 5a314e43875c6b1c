"""Plans in a process of its own: its Python holds no lock that the control loop wants."""

from __future__ import annotations

import signal
from collections.abc import Callable
from multiprocessing import get_context
from multiprocessing.connection import Connection

from models.spec import RobotSpec
from wholebody.config import ControllerConfig
from wholebody.errors import InputError, PlanningError
from wholebody.execution.background_planner import PlanRequest
from wholebody.execution.gate import Gate, gated
from wholebody.planning.chunk_planner import ChunkPlanner
from wholebody.planning.plan import ChunkPlan
from wholebody.robot.state import Robot

START_TIMEOUT = 600.0
"""Longest time until the process can plan [s]; chosen: with an empty cache it compiles the planner first."""


class PlannerProcess:
    """Computes plans elsewhere; each call waits for its plan, so give it to a `ThreadPlanner`.

    Args:
        spec: The robot.
        config: Settings of the controller.
        begin: Called first in the process, with its own imports: such as what makes it give way to the control loop.
        gate: Makes what judges plans there; all are handed out if not given.

    Attributes:
        seconds: CPU time of each plan so far [s].
    """

    def __init__(
        self,
        spec: RobotSpec,
        config: ControllerConfig,
        *,
        begin: Callable[[], None] | None = None,
        gate: Callable[[], Gate] | None = None,
    ) -> None:
        self._arguments = (spec, config, begin, gate)
        self.seconds: list[float] = []
        self._closed = False
        self._start()

    def _start(self) -> None:
        context = get_context("spawn")
        self._connection, other = context.Pipe()
        self._process = context.Process(target=_main, args=(other, *self._arguments), name="planner", daemon=True)
        self._process.start()
        other.close()
        self._ready = False

    def wait(self) -> None:
        """Wait until the process can plan.

        Raises:
            PlanningError: If it ended, or does not come up.
        """
        try:
            if not self._ready and not self._connection.poll(START_TIMEOUT):
                raise PlanningError(f"the planner's process did not come up in {START_TIMEOUT:g} s")
            self._ready = self._ready or self._connection.recv()
        except (EOFError, OSError):
            raise PlanningError("the planner's process ended while it was loading") from None

    def __call__(self, request: PlanRequest) -> ChunkPlan:
        """The plan of a request.

        Raises:
            PlanningError: If there is none, or the process ended: another one is started.
            InputError: If the chunk cannot be planned.
        """
        try:
            self.wait()
            self._connection.send(request)
            answer, seconds = self._connection.recv()
        except (EOFError, OSError, PlanningError):
            if not self._closed:
                self._end()
                self._start()
            raise PlanningError("the planner's process ended; another one is on its way") from None
        self.seconds.append(seconds)
        if isinstance(answer, Exception):
            raise answer
        return answer

    def close(self) -> None:
        """End the process, and start no other one."""
        self._closed = True
        self._end()

    def _end(self) -> None:
        self._process.kill()
        self._process.join()
        self._connection.close()


def _main(
    connection: Connection,
    spec: RobotSpec,
    config: ControllerConfig,
    begin: Callable[[], None] | None,
    gate: Callable[[], Gate] | None,
) -> None:
    from time import thread_time

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if begin is not None:
        begin()
    planner = ChunkPlanner(spec, Robot(spec), config)
    compute = gated(lambda request: request.plan_with(planner), gate and gate())
    connection.send(True)
    while True:
        try:
            request = connection.recv()
        except EOFError:
            return
        started = thread_time()
        answer: ChunkPlan | Exception
        try:
            answer = compute(request)
        except (InputError, PlanningError) as error:
            answer = error
        except Exception as error:  # noqa: BLE001 - a mistake of ours must not end the planner: the robot goes on without
            answer = PlanningError(f"{type(error).__name__}: {error}")
        connection.send((answer, thread_time() - started))
