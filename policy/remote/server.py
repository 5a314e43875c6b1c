"""A policy behind a websocket, for a robot whose own computer has no GPU and no torch."""

from __future__ import annotations

import logging
import threading
from contextlib import suppress
from http import HTTPStatus
from socket import SHUT_RDWR
from time import monotonic, perf_counter
from traceback import format_exc
from typing import TYPE_CHECKING, Any

from policy.action_spec.anchor import Anchor
from policy.action_spec.codec import encode
from policy.base import Policy
from policy.errors import PolicyError, printable
from policy.prefix import PrefixPolicy
from policy.remote.channel import CLOSE_TIMEOUT, FRAME_MAX, PORT
from policy.remote.msgpack_numpy import pack, unpack
from policy.remote.openpi import LIBERO, KeyMap
from policy.remote.openpi_request import OpenpiRequests
from policy.remote.wire import OWN_KEY, PROTOCOL, chunk_to_map, observation_from_map, prefix_from_map
from policy.remote.worker import PolicyFailure, PolicyWorker
from policy.sparing_log import SparingLog

if TYPE_CHECKING:
    from websockets.http11 import Request, Response
    from websockets.sync.server import ServerConnection

logger = logging.getLogger(__name__)

LOOPBACK = "127.0.0.1"
PORT_MAX = 65535
SESSION_MAX = 100
"""Most characters of the name of a client's episode."""
PING_INTERVAL = 5.0
"""How often an idle client is asked whether it is still there [s]."""
PING_TIMEOUT = 10.0
"""Time without an answer after which a client counts as gone [s]."""
PONG_TIMEOUT = 2.0
"""Time without an answer after which a client gives way to another one that wants to come in [s]: a robot that lost
its network must get in again soon."""
IDLE_MAX = 10.0
"""How long a client may be connected without a first request before it gives way to another one [s]."""
CLOSE_REASON = "Internal server error. Traceback included in previous frame."
"""Reason of a closed connection, the words of openpi's server after a traceback."""


class PolicyServer:
    """Serves one policy to one robot at a time, in openpi's protocol.

    What our own client sends is in `policy.remote.wire`, what openpi's sends in `policy.remote.openpi_request`.

    Metadata come first; then each request is answered with a chunk, or with a traceback as a text frame, after which
    the connection is closed with code 1011. ``GET /healthz`` answers ``OK``. A second client is turned away: a policy
    has one episode. Requests with an ``Origin`` are refused, so that no web page that the user visits can drive the
    robot; that aside, all who can connect can use the policy, which is why the address is the loopback unless said.

    All calls of the policy are made in one thread, which CUDA graphs need. A call that hangs cannot be broken off:
    clients are told that the policy is busy, and the thread is a daemon, so that at least the program can end.

    Use it as a context manager to serve in the background, or call `serve_forever`.

    Args:
        policy: What is served.
        host: Address to bind; ``0.0.0.0`` for every network.
        port: 0 takes a free one.
        keys: Names of the inputs of openpi's clients; those of its LIBERO example if not given.

    Raises:
        OSError: If the address cannot be bound.
        ValueError: If the port is none.
    """

    def __init__(self, policy: Policy, *, host: str = LOOPBACK, port: int = PORT, keys: KeyMap = LIBERO) -> None:
        from websockets.sync.server import serve

        if not 0 <= port <= PORT_MAX:
            raise ValueError(f"port is {port}; 0 to {PORT_MAX} is expected")
        self.policy, self._openpi = policy, OpenpiRequests(policy, keys)
        self.metadata = metadata_of(policy) | {"request": self._openpi.describe()}
        self._session: str | None = None
        self._guard = threading.Lock()
        self._client: ServerConnection | None = None
        self._since, self._asked = 0.0, False
        self._thread: threading.Thread | None = None
        self._logger = SparingLog(logger)
        self._server = serve(
            self._handle,
            host,
            port,
            compression=None,
            origins=[None],
            process_request=_health_check,
            ping_interval=PING_INTERVAL,
            ping_timeout=PING_TIMEOUT,
            close_timeout=CLOSE_TIMEOUT,
            max_size=FRAME_MAX,
            logger=self._logger,
        )
        self._worker = PolicyWorker()

    @property
    def uri(self) -> str:
        """Address that a client on this machine, or one that can reach the bound address, connects to."""
        host, port = self._server.socket.getsockname()[:2]
        return f"ws://{LOOPBACK if host == '0.0.0.0' else host}:{port}"

    def serve_forever(self) -> None:
        """Serve until `close` is called from another thread, or an exception such as KeyboardInterrupt arrives."""
        self._server.serve_forever()

    def wait(self) -> None:
        """Wait while a server that was entered as a context manager serves; ends like `serve_forever`."""
        if self._thread is None:
            raise PolicyError("`wait` is for a server that was entered: `with PolicyServer(...) as server: ...`")
        self._thread.join()

    def close(self) -> None:
        """Hang up and stop listening."""
        self._server.shutdown()
        # websockets does it from version 17 on.
        if self._client is not None:
            _hang_up(self._client)
        if self._thread is not None:
            self._thread.join()
        self._worker.close()

    def __enter__(self) -> PolicyServer:
        self._thread = threading.Thread(target=self.serve_forever, name="policy server", daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _handle(self, client: ServerConnection) -> None:
        """Life of a connection."""
        from websockets.exceptions import ConnectionClosed
        from websockets.frames import CloseCode

        if not _is_there(client):
            # Who does not answer would take the place of who does.
            self._logger.warning("a client at %s does not answer", _address(client))
            return
        if not self._let_in(client):
            self._logger.warning("turned a client at %s away: another one is connected", _address(client))
            with suppress(ConnectionClosed):
                client.send("the policy server is busy: it serves one robot at a time, and one is connected")
                client.close(CloseCode.TRY_AGAIN_LATER, "busy")
            return
        with suppress(ConnectionClosed):
            client.send(pack(self.metadata))
            for frame in client:
                try:
                    answer = self._answer(frame, client)
                # Whatever it is, the client is told, as openpi's server does, and the server lives on.
                except Exception as error:  # noqa: BLE001
                    self._log(client, error)
                    client.send(error.text if isinstance(error, PolicyFailure) else format_exc())
                    client.close(CloseCode.INTERNAL_ERROR, CLOSE_REASON)
                    return
                client.send(answer)

    def _let_in(self, client: ServerConnection) -> bool:
        """Whether a client is the one from now on; other clients that wait meanwhile wait beside it, not behind it."""
        while True:
            with self._guard:
                before = self._client
                idle = not self._asked and monotonic() - self._since > IDLE_MAX
            if before is not None and not idle and _is_there(before):
                return False
            with self._guard:
                if self._client is before:
                    self._client, self._since, self._asked = client, monotonic(), False
                    break
        if before is not None:
            _hang_up(before)
        return True

    def _log(self, client: ServerConnection, error: Exception) -> None:
        text = error.text.rstrip().rpartition("\n")[2] if isinstance(error, PolicyFailure) else str(error)
        self._logger.warning("refused a request of %s: %s", _address(client), printable(text, 300))

    def _answer(self, frame: bytes | str, client: ServerConnection) -> bytes:
        """Answer to a request."""
        if isinstance(frame, str):
            raise PolicyError("a request is a binary frame of MessagePack; this one is text")
        request = unpack(frame)
        if not isinstance(request, dict):
            raise PolicyError(f"the request holds {type(request).__name__}; a map is expected")
        if client is self._client:
            self._asked = True
        answer = self._worker.run(lambda: self._infer(request, str(client.id)), lambda: _is_open(client))
        return pack(answer)

    def _infer(self, request: dict[str, Any], connection: str) -> dict[str, Any]:
        """Call the policy; in the worker's thread."""
        own, robot = "session" in request, self.policy.spec.robot
        if own and not (isinstance(request["session"], str) and len(request["session"]) <= SESSION_MAX):
            raise PolicyError(f"'session' of the request is no text of at most {SESSION_MAX} characters")
        session, continues, prefix = (request.pop(key, None) for key in ("session", "continues", "prefix"))
        if own or OWN_KEY in request:
            observation = observation_from_map(request, robot)
        else:
            observation = self._openpi.observation(request, monotonic())
        prefix = None if prefix is None else prefix_from_map(prefix, robot)
        self._begin(session if own else connection, continues is True, observation.task)
        begin = perf_counter()
        if prefix is None:
            chunk = self.policy.infer(observation)
        elif isinstance(self.policy, PrefixPolicy):
            chunk = self.policy.infer_after(observation, prefix)
        else:
            raise PolicyError(f"{type(self.policy).__name__} takes no prefix; the metadata say so")
        timing = {"infer_ms": 1e3 * (perf_counter() - begin)}
        if own:
            return {"chunk": chunk_to_map(chunk), "server_timing": timing}
        actions = encode(self.policy.spec, chunk, Anchor.measured(observation, robot))
        return {self._openpi.keys.actions: actions, "server_timing": timing}

    def _begin(self, session: str, continues: bool, task: str) -> None:
        """Reset the policy for a session that it has not seen."""
        if session == self._session:
            return
        if continues and not self.policy.sees_robot:
            raise PolicyError(
                "this episode is not known here: the server was started anew, or has served another client since, and "
                "the policy would begin again from its start. Reset the client"
            )
        self.policy.reset(task)
        self._session = session


def metadata_of(policy: Policy) -> dict[str, Any]:
    """What a server says of its policy."""
    duration = getattr(policy, "duration", None)
    return {
        "protocol": PROTOCOL,
        "action_spec": {**policy.spec.to_dict(), "hash": policy.spec.hash},
        "sees_robot": bool(policy.sees_robot),
        "takes_prefix": isinstance(policy, PrefixPolicy),
        "name": str(getattr(policy, "name", type(policy).__name__)),
        "duration": None if duration is None else float(duration),
        "cameras": {camera: list(size) for camera, size in getattr(policy, "cameras", {}).items()},
    }


def _is_open(client: ServerConnection) -> bool:
    from websockets.protocol import State

    return client.protocol.state is State.OPEN


def _is_there(client: ServerConnection) -> bool:
    """Whether a client still answers; one whose network broke looks open for a while."""
    from websockets.exceptions import ConnectionClosed

    if not _is_open(client):
        return False
    try:
        return client.ping().wait(PONG_TIMEOUT)
    except ConnectionClosed:
        return False


def _hang_up(client: ServerConnection) -> None:
    """Break a connection off without waiting for its peer; the thread that serves it ends."""
    with suppress(OSError):
        client.socket.shutdown(SHUT_RDWR)


def _address(client: ServerConnection) -> str:
    address = client.remote_address
    return printable(f"{address[0]}:{address[1]}" if isinstance(address, tuple) and len(address) > 1 else address, 80)


def _health_check(connection: ServerConnection, request: Request) -> Response | None:
    return connection.respond(HTTPStatus.OK, "OK\n") if request.path == "/healthz" else None
