"""The other program, as the control loop knows it: what it says is done between two ticks."""

from __future__ import annotations

from math import inf
from multiprocessing.connection import Connection
from typing import Protocol

import numpy as np

from policy.errors import PolicyError
from policy.targets.stream import TargetStream
from wholebody.episode.run import observe
from wholebody.live.loop import ControlLoop
from wholebody.live.served.messages import Advance, Ask, End, PlaceBodies, Reset, Seen, Target


class ServedLoop(Protocol):
    """A control loop that follows the targets of a program."""

    @property
    def origin(self) -> float:
        """Stamp of a target at which the robot's clock is 0 [s]."""
        ...

    def hasten(self) -> None:
        """Ask for a chunk that goes to the newest target."""
        ...

    def seen(self) -> Seen:
        """Present view of robot and world."""
        ...

    def reset(self) -> None:
        """Put the robot into its stance, and tell the program once it stands."""
        ...

    def place(self, objects: np.ndarray) -> None:
        """Put the scene's bodies that move elsewhere."""
        ...


def seen_by(loop: ControlLoop, objects: np.ndarray, fallen: bool) -> Seen:
    """What a loop has to show now, beside the poses of the scene's bodies (k, 7) and whether standing was lost."""
    supervisor = loop.supervisor
    observation = observe(loop.spec, supervisor, loop.state, now=loop.clock.now(), objects=objects)
    status, chunk = supervisor.status, supervisor.chunk
    names = (status.status.value, str(status.reason or ""))
    followed = -inf if chunk is None else float(chunk.t_obs)
    return Seen(observation, names, fallen, followed, supervisor.touch.forces.copy())


class RemoteProgram:
    """The other program, as the control loop knows it.

    Args:
        connection: To it.

    Attributes:
        stream: Where its targets go.
        refused: How many targets could not be used, by reason.
        there: Whether it is there and wants to go on.
        asked_to_end: Whether it waits for a summary.
    """

    def __init__(self, connection: Connection) -> None:
        self._connection, self.stream = connection, TargetStream()
        self.refused: dict[str, int] = {}
        self.there, self.asked_to_end, self.until = True, False, 0.0

    def serve(self, robot: ServedLoop, wait: bool = False) -> None:
        """Do what it said since; with ``wait`` until it has let time pass, or ends."""
        try:
            while self.there and (wait or self._connection.poll()):
                message = self._connection.recv()
                if isinstance(message, Advance):
                    self.until = message.until
                    return
                if isinstance(message, Reset):
                    robot.reset(message.seed)
                    return
                self._do(message, robot)
        except (EOFError, OSError):
            self.there = False

    def _do(self, message: object, robot: ServedLoop) -> None:
        if isinstance(message, Ask):
            self._connection.send(robot.seen())
        elif isinstance(message, Target):
            try:
                self.stream.put(message.stamp - robot.origin, **message.parts)
            except PolicyError as error:
                self.refused[str(error)] = self.refused.get(str(error), 0) + 1
            else:
                if self.stream.news:
                    robot.hasten()
        elif isinstance(message, PlaceBodies):
            robot.place(message.objects)
        elif isinstance(message, End):
            self.there, self.asked_to_end = False, True

    def tell(self, what: Seen | Exception | dict[str, object]) -> None:
        """Say something, if it is there."""
        try:
            self._connection.send(what)
        except OSError:
            self.there = False
