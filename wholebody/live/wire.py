"""What goes between the control loop and the robot's process: states one way, commands the other, as plain numbers.

Every message is one datagram of 64-bit floats. Nobody ever waits for the other side to read: what does not fit is
dropped, and of several messages only the newest counts.
"""

from __future__ import annotations

import socket
from collections.abc import Iterator
from select import select

import numpy as np

from wholebody.types import JointCommand, RobotState

DATAGRAM_MAX = 1 << 16
"""Longest message [bytes]: some 8,000 numbers."""


def wire() -> tuple[socket.socket, socket.socket]:
    """Both ends of a new connection."""
    ends = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    for end in ends:
        end.setblocking(False)
    return ends


def send(end: socket.socket, *parts: np.ndarray | float) -> bool:
    """Send numbers as one message; False if there was no room for it, or nobody is there."""
    try:
        end.send(np.hstack([np.asarray(part, dtype=float).ravel() for part in parts]).tobytes())
    except (BlockingIOError, BrokenPipeError, ConnectionResetError):
        return False
    return True


def messages(end: socket.socket) -> Iterator[np.ndarray]:
    """All messages that have come, oldest first.

    Raises:
        EOFError: If the other side is gone.
    """
    while True:
        try:
            data = end.recv(DATAGRAM_MAX)
        except BlockingIOError:
            return
        except ConnectionResetError:
            data = b""
        if not data:
            raise EOFError("the other side of the wire is gone")
        yield np.frombuffer(data)


def newest(end: socket.socket, timeout: float = 0.0) -> np.ndarray | None:
    """The newest message; waits for one up to ``timeout`` [s] if none has come, and answers None if none does.

    Raises:
        EOFError: If the other side is gone.
    """
    if timeout > 0.0:
        select([end], [], [], timeout)
    last = None
    for last in messages(end):  # noqa: B007 - the last one is what is wanted
        pass
    return last


def state_message(state: RobotState) -> tuple[np.ndarray | float, ...]:
    """A state as parts of a message; its torques come last, if there are any."""
    return (state.time, state.q, state.v) if state.tau is None else (state.time, state.q, state.v, state.tau)


def state_of(message: np.ndarray, nq: int, nv: int) -> RobotState:
    """The state in a message."""
    q, v, tau = np.split(message[1:].copy(), (nq, nq + nv))
    return RobotState(float(message[0]), q, v, tau if len(tau) else None)


def command_message(command: JointCommand) -> tuple[np.ndarray | float, ...]:
    """A command as parts of a message."""
    return command.time, command.q, command.dq, command.tau, command.kp, command.kd


def command_of(message: np.ndarray) -> JointCommand:
    """The command in a message."""
    return JointCommand(float(message[0]), *message[1:].reshape(5, -1))
