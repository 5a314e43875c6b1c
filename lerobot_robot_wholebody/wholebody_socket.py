"""Another program on this computer says where hands are to be: lines of JSON over a socket that is a file."""

from __future__ import annotations

import json
import os
import socket
import stat
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from lerobot_robot_wholebody.config_teleoperators import WholebodySocketConfig
from lerobot_robot_wholebody.hands_teleoperator import RobotTeleoperator

if TYPE_CHECKING:
    from lerobot_robot_wholebody.target import Accepted
    from lerobot_robot_wholebody.wholebody_g1 import WholebodyG1

LINE_MAX = 1 << 16
"""Longest line that is taken [bytes]; chosen: twenty times one with all numbers of an action."""

LINES_MAX = 64
"""Lines that are taken in a step at most; chosen: a program at 1 kHz has half of it, and the step stays short."""


class WholebodySocket(RobotTeleoperator):
    """Takes numbers of actions from a program that connects to a socket file, and answers with what is seen.

    Each line is a JSON object of some of an action's numbers by name; ``{}`` only looks. Each is answered by a line
    ``{"observation": {...}, "phase": "episode", "time": 1.2, "error": ""}`` at the next step; where ``error`` says what
    is wrong, nothing of the line was taken. What was said last stays, also when the program goes; another may come.

    Args:
        config: Settings.
    """

    config_class = WholebodySocketConfig
    name = "wholebody_socket"

    def connect(self, calibrate: bool = True) -> None:
        """Make the socket file, which only its owner may use.

        Raises:
            ConnectionError: If it cannot be made there.
        """
        path = self.config.path
        self._server = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        before = os.umask(0o177)
        try:
            _sweep(path)
            self._server.bind(path)
            self._server.listen(1)
        except OSError as error:
            self._server.close()
            raise ConnectionError(f"--teleop.path={path}: no socket can be made there: {error.strerror}") from None
        finally:
            os.umask(before)
        self._server.setblocking(False)
        self._program: socket.socket | None = None
        self._heard = b""
        super().connect(calibrate)

    def disconnect(self) -> None:
        """Remove the socket file."""
        self._drop()
        self._server.close()
        with suppress(OSError):
            os.unlink(self.config.path)
        super().disconnect()

    def get_action(self) -> dict[str, Any]:
        """Where wrists and fingers are to be now.

        Raises:
            ConnectionError: If it was not asked to come, or there is no robot.
        """
        robot = self._driven()
        for line in self._lines():
            self._answer(robot, self._take(line, robot))
        return dict(self._accepted.last)

    def _meet(self, robot: WholebodyG1) -> None:
        from lerobot_robot_wholebody.target import Accepted

        super()._meet(robot)
        self._accepted: Accepted = Accepted(robot.numbers, robot.seen.observation)

    def _take(self, line: bytes, robot: WholebodyG1) -> str:
        """Take a line's numbers; what is wrong with it, or nothing."""
        from policy.errors import ChunkError, printable

        try:
            told = json.loads(line)
            if not isinstance(told, dict):
                return "a line is a JSON object of numbers by name"
            self._accepted.take(robot.checked(told), robot.seen.observation)
        except (ValueError, TypeError, OverflowError, RecursionError, ChunkError) as error:
            return printable(str(error), 300)
        return ""

    def _answer(self, robot: WholebodyG1, error: str) -> None:
        seen = {name: value for name, value in robot.observation.items() if isinstance(value, float)}
        said = {"observation": seen, "phase": robot.phase, "time": robot.now(), "error": error}
        try:
            self._program.sendall(json.dumps(said).encode() + b"\n")
        except (OSError, AttributeError):
            self._drop()  # it does not read its answers, or has gone

    def _lines(self) -> list[bytes]:
        """Whole lines that came since; never waits."""
        if self._program is None:
            try:
                self._program = self._server.accept()[0]
            except BlockingIOError:
                return []
            self._program.setblocking(False)
        gone = False
        with suppress(BlockingIOError):
            while len(self._heard) <= LINE_MAX and not gone:
                data = self._hear()
                self._heard += data
                gone = not data
        *lines, self._heard = self._heard.split(b"\n", LINES_MAX)
        if gone or (b"\n" not in self._heard and len(self._heard) > LINE_MAX):
            self._drop()
        return lines

    def _hear(self) -> bytes:
        try:
            return self._program.recv(LINE_MAX)
        except ConnectionError:
            return b""

    def _drop(self) -> None:
        if self._program is not None:
            self._program.close()
        self._program, self._heard = None, b""


def _sweep(path: str) -> None:
    """Remove a socket file that nobody listens to any more; any other file stays, and is in the way."""
    with suppress(FileNotFoundError), socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as other:
        if not stat.S_ISSOCK(os.lstat(path).st_mode):
            return
        try:
            other.connect(path)
        except ConnectionRefusedError:
            os.unlink(path)
