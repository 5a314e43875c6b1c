"""A peer on loopback that does exactly what a test wants of it: no websocket library, only a socket."""

import base64
import hashlib
import json
import socket
import threading
from pathlib import Path

import numpy as np

from policy import builtin
from policy.action_spec.state import state_layout, state_numbers
from tests.support.policy_cases import observation

RECORDING = json.loads((Path(__file__).parent / "openpi_session.json").read_text())
SERVER = {name: base64.b64decode(text) for name, text in RECORDING["server"].items()}
"""Websocket frames of openpi's server, by what they hold."""
REQUEST = base64.b64decode(RECORDING["request"])
"""Payload of what openpi's client sends."""
IMAGE = (np.arange(2 * 3 * 3) * 14).astype(np.uint8).reshape(2, 3, 3)
"""The first image in that request; the second is one brighter everywhere."""
IMAGES = {"head": IMAGE, "left_wrist": IMAGE + 1}
"""Both, by our names of the cameras."""
STATE = state_numbers(state_layout(builtin("wbc32-v1")), observation()).astype(np.float32)
"""The state in it: that of the stance, 32 numbers of the first wbc32, as it was recorded."""


class Peer:
    """Accepts connections and runs a script on each, after the websocket handshake."""

    def __init__(self, *scripts, handshake=True, port=0):
        self.scripts, self.handshake, self.errors, self.connections = list(scripts), handshake, [], 0
        self._listener = socket.create_server(("127.0.0.1", port))
        self.uri = f"ws://127.0.0.1:{self._listener.getsockname()[1]}"
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._end.set()
        self._listener.close()
        self._thread.join(timeout=5.0)
        assert self.errors == []

    def _run(self):
        while not self._end.is_set():
            try:
                self._listener.settimeout(0.05)
                connection, _ = self._listener.accept()
            except TimeoutError:
                continue
            except OSError:
                return
            # The last script serves every further connection.
            script = self.scripts[min(self.connections, len(self.scripts) - 1)]
            self.connections += 1
            threading.Thread(target=self._serve, args=(connection, script), daemon=True).start()

    def _serve(self, connection, script):
        with connection:
            try:
                connection.settimeout(120.0)
                if self.handshake:
                    shake_hands(connection)
                script(Wire(connection, self._end))
            except (ConnectionError, EOFError):
                pass  # the client hung up, as many a test wants
            except Exception as error:  # noqa: BLE001 - shown by the test
                self.errors.append(error)


class Wire:
    """The peer's end of a connection."""

    def __init__(self, connection, end):
        self.connection, self._end = connection, end

    def send(self, data):
        self.connection.sendall(data)

    def receive(self):
        """Payload of the next frame of the client, unmasked."""
        head = read(self.connection, 2)
        assert head[1] & 0x80, "a client masks its frames"
        length = head[1] & 0x7F
        if length > 125:
            length = int.from_bytes(read(self.connection, 2 if length == 126 else 8), "big")
        mask, payload = read(self.connection, 4), read(self.connection, length)
        if head[0] & 0x0F == 8:
            raise EOFError("the client closes")
        return bytes(byte ^ mask[i % 4] for i, byte in enumerate(payload))

    def stall(self):
        """Do nothing until the test is over."""
        self._end.wait()


def frame(payload, *, text=False):
    """An unmasked websocket frame."""
    head = bytes([0x81 if text else 0x82])
    if len(payload) < 126:
        return head + bytes([len(payload)]) + payload
    return head + b"\x7e" + len(payload).to_bytes(2, "big") + payload


def payload_of(frame):
    """Payload of an unmasked frame shorter than 64 KiB."""
    return frame[4:] if frame[1] == 126 else frame[2:]


def shake_hands(connection):
    request = b""
    while b"\r\n\r\n" not in request:
        request += read(connection, 1)
    lines = request.decode().split("\r\n")
    key = next(line.split(": ")[1] for line in lines if line.lower().startswith("sec-websocket-key"))
    # RFC 6455, section 1.3.
    digest = hashlib.sha1(f"{key}258EAFA5-E914-47DA-95CA-C5AB0DC85B11".encode()).digest()
    connection.sendall(
        b"HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        b"Sec-WebSocket-Accept: " + base64.b64encode(digest) + b"\r\n\r\n"
    )


def read(connection, count):
    data = b""
    while len(data) < count:
        more = connection.recv(count - len(data))
        if not more:
            raise EOFError("the client hung up")
        data += more
    return data
