"""One websocket to a policy server, where every wait has an end."""

from __future__ import annotations

import logging
import socket
import threading
from contextlib import ExitStack, suppress
from time import monotonic, sleep
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from policy.errors import PolicyError, printable
from policy.remote.msgpack_numpy import pack, unpack
from policy.sparing_log import SparingLog

if TYPE_CHECKING:
    from collections.abc import Mapping

    from websockets.sync.client import ClientConnection

logger = logging.getLogger("policy.remote.client")

PORT = 8000
"""Port of openpi's server."""
FRAME_MAX = 64 * 2**20
"""Largest frame that is taken [bytes]: twenty raw images of 1280 x 720."""
RETRY_PAUSE = 0.2
"""Pause between attempts to connect to a port where no server listens yet [s]."""
LOOK_INTERVAL = 0.05
"""How often to look whether a connection has failed while an answer is awaited [s]."""
TRACEBACK_LINES, TRACEBACK_WIDTH = 60, 300
"""What is kept of a server's traceback: its last lines, and of each so many characters."""
CLOSE_TIMEOUT = 1.0
"""How long a closing handshake may take [s]; a server that is stuck does not take part in it."""


class RemoteError(PolicyError):
    """A policy server that cannot be used.

    Attributes:
        uri: Its address.
    """

    def __init__(self, message: str, *, uri: str = "") -> None:
        super().__init__(f"{uri}: {message}" if uri else message)
        self.uri = uri


class RemoteConnectionError(RemoteError, ConnectionError):
    """No server there, no websocket there, or the connection broke."""


class RemoteTimeoutError(RemoteError, TimeoutError):
    """No answer in time."""


class RemoteAnswerError(RemoteError, ValueError):
    """An answer that means nothing: no MessagePack, or without what is needed."""


class RemoteServerError(RemoteError, RuntimeError):
    """The policy raised on the server; its traceback is shown below this one.

    Attributes:
        traceback: The end of what the server sent, as it sent it: not for a terminal.
    """

    def __init__(self, traceback: str, *, uri: str = "") -> None:
        lines = [line for line in traceback[-TRACEBACK_LINES * TRACEBACK_WIDTH :].splitlines() if line.strip()]
        super().__init__(f"the server says: {printable(lines[-1].strip()) if lines else 'nothing'}", uri=uri)
        self.traceback = traceback[-TRACEBACK_LINES * TRACEBACK_WIDTH :]
        self.add_note(f"Traceback of the server:\n{quoted(traceback)}")


class Channel:
    """A connection in openpi's protocol: metadata once, then request and answer by turns.

    Whatever goes wrong closes it, so that a late answer is never taken for the next one; `open` connects again.

    Args:
        uri: ``ws://host:port``, or ``host``, ``host:port``; ``wss://`` for TLS.
        connect_timeout: For connection, handshake and metadata together [s].
        api_key: Sent as ``Authorization: Api-Key ...``, as openpi's client does.

    Raises:
        RemoteConnectionError: If the address is none.
    """

    def __init__(self, uri: str, *, connect_timeout: float = 10.0, api_key: str | None = None) -> None:
        self.uri, self.connect_timeout = full_uri(uri), connect_timeout
        self._headers = {"Authorization": f"Api-Key {api_key}"} if api_key else None
        self._connection: ClientConnection | None = None
        self._held = ExitStack()
        self._told, self._log = "", SparingLog(logger)

    @property
    def is_open(self) -> bool:
        """Whether a request can be sent; false once the server has hung up."""
        from websockets.protocol import State

        return self._connection is not None and self._connection.protocol.state is State.OPEN

    def open(self, *, patient: bool = False) -> Mapping[str, Any]:
        """Connect and return the server's metadata.

        Args:
            patient: Where no server listens, try again until the time is over: a server that loads its weights.

        Raises:
            RemoteError: If there is no policy server, or it says why it takes no client.
        """
        self.close()
        deadline = monotonic() + self.connect_timeout
        while True:
            try:
                self._connect(deadline)
                break
            except ConnectionRefusedError as error:
                if patient and monotonic() + RETRY_PAUSE < deadline:
                    sleep(RETRY_PAUSE)
                    continue
                cure = "start the server, or check host and port"
                raise RemoteConnectionError(f"no server listens there; {cure}", uri=self.uri) from error
        return self._read(self._exchange(None, deadline - monotonic(), "metadata"))

    def ask(self, request: Mapping[str, Any], timeout: float) -> Mapping[str, Any]:
        """Send a request and wait for its answer, `timeout` seconds for both together.

        What came without having been asked for closes the connection: it would be taken for this answer.

        Raises:
            WireError: If the request holds something that cannot be sent.
            RemoteError: If there is no answer, or none that can be read.
        """
        frame = pack(request)
        self._refuse_unasked()
        return self._read(self._exchange(frame, timeout, "answer"))

    def close(self) -> None:
        """Hang up; waits a second at most."""
        self._connection = None
        self._held.close()

    def _connect(self, deadline: float) -> None:
        from websockets.exceptions import WebSocketException
        from websockets.sync.client import connect

        try:
            # No pings: openpi's server does not answer any while it computes, and every wait here ends by itself.
            connection = connect(
                self.uri,
                compression=None,
                proxy=None,
                additional_headers=self._headers,
                open_timeout=max(deadline - monotonic(), 1e-3),
                close_timeout=CLOSE_TIMEOUT,
                ping_interval=None,
                max_size=FRAME_MAX,
            )
            self._connection = self._held.enter_context(connection)
        except ConnectionRefusedError:
            raise
        except TimeoutError as error:
            text = f"no websocket within {self.connect_timeout:g} s; is a policy server on that port?"
            raise RemoteTimeoutError(text, uri=self.uri) from error
        except (OSError, WebSocketException, AssertionError) as error:
            # websockets asserts that no server answers before it has asked; an SSH server greets first.
            why = str(error) or "it spoke before it was asked"
            text = f"no websocket there: {why}; is a policy server on that port?"
            raise RemoteConnectionError(text, uri=self.uri) from error

    def _refuse_unasked(self) -> None:
        from websockets.exceptions import ConnectionClosed

        if self._connection is None:
            return
        try:
            self._connection.recv(0.0)
        except (TimeoutError, ConnectionClosed):
            return
        _break_off(self._connection.socket)
        self.close()
        text = "the server sent an answer that was not asked for; which request it answers cannot be known"
        raise RemoteAnswerError(text, uri=self.uri)

    def _exchange(self, frame: bytes | None, timeout: float, awaited: str) -> bytes | str:
        from websockets.exceptions import ConnectionClosed

        if self._connection is None:
            raise RemoteConnectionError("not connected; call open", uri=self.uri)
        deadline = monotonic() + timeout
        # recv has a time-out, send has none: a peer that stops reading would block it for ever.
        watchdog = threading.Timer(max(timeout, 0.0), _break_off, (self._connection.socket,))
        watchdog.daemon = True
        watchdog.start()
        try:
            if frame is not None:
                self._connection.send(frame)
            return self._received(deadline)
        except (ConnectionClosed, TimeoutError) as error:
            expired = isinstance(error, TimeoutError) or monotonic() >= deadline
            _break_off(self._connection.socket)
            self.close()
            if expired:
                raise RemoteTimeoutError(f"no {awaited} within {timeout:g} s", uri=self.uri) from error
            raise RemoteConnectionError(f"the connection broke before the {awaited}: {error}", uri=self.uri) from error
        finally:
            watchdog.cancel()

    def _received(self, deadline: float) -> bytes | str:
        """Next frame.

        Raises:
            TimeoutError: If it does not come in time.
            RemoteConnectionError: If what comes is no frame: websockets would wait for the peer to hang up.
        """
        connection = self._connection
        while True:
            left = max(deadline - monotonic(), 0.0)
            # A connection that fails from here on is seen after the next wait.
            failed = not self.is_open
            try:
                return connection.recv(min(left, LOOK_INTERVAL))
            except TimeoutError:
                if left <= LOOK_INTERVAL:
                    raise
                if failed:
                    why = connection.protocol.parser_exc or "it hung up"
                    _break_off(connection.socket)
                    self.close()
                    text = f"the connection broke before the answer: {printable(why, 200)}"
                    raise RemoteConnectionError(text, uri=self.uri) from None

    def _read(self, frame: bytes | str) -> Mapping[str, Any]:
        """Data of a frame; a text frame is a traceback."""
        if isinstance(frame, str):
            self.close()
            self._tell(frame)
            raise RemoteServerError(frame, uri=self.uri)
        try:
            data = unpack(frame)
        except ValueError as error:
            self.close()
            raise RemoteAnswerError(str(error), uri=self.uri) from error
        if not isinstance(data, dict):
            self.close()
            text = f"the frame holds {type(data).__name__}; a map is expected. Is this a policy server?"
            raise RemoteAnswerError(text, uri=self.uri)
        return data

    def _tell(self, traceback: str) -> None:
        """Log a server's traceback, once: a client that asks again and again gets the same one; others come sparingly.

        A refusal of our own server is no bug, and its last line, which is in the exception too, says all.
        """
        text = quoted(traceback)
        refused = text.rpartition("\n")[2].startswith("| policy.errors.")
        if text != self._told and not refused:
            self._told = text
            self._log.error("%s failed:\n%s", self.uri, text)


def quoted(text: str) -> str:
    """The last lines of a text from outside, each `printable` and behind a bar, so that none passes for ours."""
    lines = text[-TRACEBACK_LINES * TRACEBACK_WIDTH :].rstrip().splitlines()[-TRACEBACK_LINES:]
    return "\n".join(f"| {printable(line, TRACEBACK_WIDTH)}" for line in lines)


def full_uri(uri: str) -> str:
    """Address with scheme and port.

    Raises:
        RemoteConnectionError: If it is none.
    """
    text = uri if "://" in uri else f"ws://{uri}"
    try:
        parts = urlsplit(text)
        port = PORT if parts.port is None else parts.port
    except ValueError as error:
        raise RemoteConnectionError(f"'{uri}' is no address: {error}") from error
    if parts.scheme not in ("ws", "wss") or not parts.hostname:
        raise RemoteConnectionError(f"'{uri}' is no address of a policy server; ws://HOST:{PORT} is expected")
    host = f"[{parts.hostname}]" if ":" in parts.hostname else parts.hostname
    return f"{parts.scheme}://{host}:{port}{parts.path}"


def _break_off(sock: socket.socket) -> None:
    with suppress(OSError):
        sock.shutdown(socket.SHUT_RDWR)
