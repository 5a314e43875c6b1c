"""The program's side of a robot that is served to it.

It imports neither Pinocchio nor MuJoCo, and waits for those who do only in `start`.
"""

from __future__ import annotations

import os
import socket
import subprocess
import sys
from multiprocessing.connection import Connection
from pathlib import Path
from threading import Lock
from time import monotonic

import numpy as np

from wholebody.errors import SimulationError
from wholebody.live.served.messages import Advance, Ask, End, PlaceBodies, Reset, Seen, Served, Target

START_TIMEOUT = 900.0
"""Longest time until the robot stands [s]; chosen: with an empty cache controller and planner are compiled first."""
ANSWER_TIMEOUT = 60.0
"""Longest time that an answer takes [s]; chosen: some seconds of simulation that were let pass before, on a busy
computer."""
END_TIMEOUT = 120.0
"""Longest time in which the robot is lowered [s]; chosen: ten times what it takes on the wall clock."""


class ServedRobot:
    """The balanced robot in processes of its own, for a program that says where hands are to be.

    The processes outlive a program that is killed for as long as it takes to lower the robot.

    Args:
        served: Which robot, where, and how.

    Attributes:
        time: Simulated time that the program has let pass in lockstep [s].
    """

    def __init__(self, served: Served) -> None:
        self.served, self.time = served, 0.0
        self._connection: Connection | None = None
        self._lock = Lock()

    @property
    def running(self) -> bool:
        """Whether it was started and not ended."""
        return self._connection is not None

    def start(self) -> Seen:
        """Load, warm up and stand; nothing is left over if that fails. Answers what is seen then.

        Raises:
            WholebodyError: If a setting is wrong, or the processes do not come up.
        """
        own, other = socket.socketpair()
        root = str(Path(__file__).parents[3])
        path = os.pathsep.join([root, *filter(None, [os.environ.get("PYTHONPATH")])])
        with other:
            # A session of its own: Ctrl-C in a terminal is for the program, which then says what is to be done.
            self._process = subprocess.Popen(
                [sys.executable, "-m", "wholebody.cli.serve_robot", str(other.fileno())],
                pass_fds=[other.fileno()],
                stdin=subprocess.DEVNULL,
                stdout=sys.stderr.fileno() if _has_stderr() else subprocess.DEVNULL,
                env={**os.environ, "PYTHONPATH": path},
                start_new_session=True,
            )
        self._connection = Connection(own.detach())
        try:
            self._send(self.served)
            seen = self._receive(START_TIMEOUT)
            self.time = seen.observation.time
        except BaseException:
            self._give_up()
            raise
        return seen

    def see(self) -> Seen:
        """Present view of robot and world.

        Raises:
            SimulationError: If the robot's processes ended.
        """
        with self._lock:
            self._send(Ask())
            return self._receive(ANSWER_TIMEOUT)

    def put(self, **parts: np.ndarray) -> None:
        """Say where hands are to be now, as `policy.targets.stream.TargetStream.put` takes it.

        Raises:
            SimulationError: If the robot's processes ended.
        """
        stamp = monotonic() if self.served.clock == "wall" else self.time
        with self._lock:
            self._send(Target(stamp, parts))

    def advance(self, seconds: float) -> None:
        """Let time pass in lockstep; does not wait for the simulation of it.

        The simulation has periods of 2 ms: it is at the nearest of them, and nothing is lost over many steps.

        Raises:
            SimulationError: If the robot's processes ended.
        """
        self.time += seconds
        with self._lock:
            self._send(Advance(self.time))

    def reset(self, seed: int = 0) -> Seen:
        """Put the robot into its stance in lockstep, with no target, whatever it does. Answers what is seen then.

        Args:
            seed: Of how a realistic robot differs from its model from then on.

        Raises:
            ValueError: On the wall clock.
            SimulationError: If the robot's processes ended.
        """
        if self.served.clock == "wall":
            raise ValueError("on the wall clock time does not begin anew: a robot is put into its stance in lockstep")
        with self._lock:
            self._send(Reset(seed))
            seen = self._receive(ANSWER_TIMEOUT)
        self.time = seen.observation.time
        return seen

    def place(self, objects: np.ndarray) -> None:
        """Put the scene's bodies that move elsewhere in lockstep, at rest.

        Args:
            objects: Their poses, as in `Seen`, shape (k, 7).

        Raises:
            ValueError: On the wall clock.
            SimulationError: If the robot's processes ended.
        """
        if self.served.clock == "wall":
            raise ValueError("on the wall clock nobody puts things back: a scene is set in lockstep")
        with self._lock:
            self._send(PlaceBodies(np.asarray(objects, dtype=float)))

    def close(self) -> dict[str, object]:
        """Lower the robot and end its processes; a summary of the run, empty if they do not answer."""
        if self._connection is None:
            return {}
        try:
            with self._lock:
                self._send(End())
                return self._receive(END_TIMEOUT)
        except SimulationError:
            return {}
        finally:
            self._give_up()

    def _give_up(self) -> None:
        self._connection.close()
        self._connection = None
        try:
            self._process.wait(END_TIMEOUT)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _send(self, message: object) -> None:
        if self._connection is None:
            raise SimulationError("the robot has not been started, or was ended")
        try:
            self._connection.send(message)
        except OSError:
            raise SimulationError("the robot's processes ended") from None

    def _receive(self, timeout: float) -> Seen | dict[str, object]:
        try:
            if not self._connection.poll(timeout):
                raise SimulationError(f"the robot's processes did not answer in {timeout:g} s")
            answer = self._connection.recv()
        except (EOFError, OSError):
            raise SimulationError("the robot's processes ended") from None
        if isinstance(answer, Exception):
            raise answer
        return answer


def _has_stderr() -> bool:
    """Whether standard error is a file of the system; in notebooks and tests it may be none."""
    try:
        sys.stderr.fileno()
    except (AttributeError, OSError, ValueError):
        return False
    return True
