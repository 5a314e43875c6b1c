"""The protocols of a robot on the wall clock: what the control loop and what a session need of it."""

from __future__ import annotations

import socket
from dataclasses import dataclass
from typing import Protocol

from wholebody.types import JointCommand, RobotState


@dataclass(frozen=True)
class Order:
    """What a person does to the robot's world: `push`, `payload`, `friction`, `reset`, `pause`, `resume` or `end`.

    Attributes:
        what: One of these.
        numbers: Force [N] and duration [s]; masses [kg]; coefficient; the shift of the clock by a pause [s].
        body: Which one is pushed.
    """

    what: str
    numbers: tuple[float, ...] = ()
    body: str = ""


class RobotLink(Protocol):
    """A robot, or what behaves like one, as the control loop knows it.

    Attributes:
        origin: Instant of `time.monotonic` at which the robot's clock is 0 [s].
    """

    origin: float

    def receive(self, timeout: float) -> RobotState | None:
        """The newest state that has not been taken, waited for up to ``timeout`` [s]; None if none came."""
        ...

    def send(self, command: JointCommand) -> None:
        """Command the motors; never waits."""
        ...


class SessionRobot(RobotLink, Protocol):
    """A robot that a session starts and ends; `wholebody.live.robot_process.RobotProcess` is MuJoCo."""

    def start(self, page: socket.socket | None = None) -> RobotState:
        """Connect; the robot stands still until `go`. Answers its first state.

        Args:
            page: Where views of the world are shown (`wholebody.live.robot_process.WorldView`); None: nowhere.

        Raises:
            WholebodyError: If the robot is not there.
        """
        ...

    def go(self, origin: float) -> None:
        """Let time run: the robot's clock is 0 at this instant of `time.monotonic` [s]."""
        ...

    def order(self, order: Order) -> None:
        """Do to the robot's world what a person wants; a robot whose world cannot be told so leaves it."""
        ...

    def close(self) -> dict[str, float | str]:
        """End, and say how time was kept and why the robot fell (`fall`, empty if it did not), as far as known."""
        ...
