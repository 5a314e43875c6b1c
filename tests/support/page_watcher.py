"""A bare websocket client of the live page: what viser's server sends to a browser, without one."""

import threading

import msgspec
import numpy as np
import viser
import zstandard
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

HANDLE, PALM = "/handle/left", "/robot/left_hand_palm_link"


def connected(address):
    """A connection to the page at an address."""
    uri = address.replace("http:", "ws:", 1)
    return connect(uri, max_size=None, subprotocols=[f"viser-v{viser.__version__}"], proxy=None)


def messages(frame):
    """Messages of a frame: sizes, compressed MessagePack, arrays."""
    size = int.from_bytes(frame[8:16], "little")
    return msgspec.msgpack.decode(zstandard.ZstdDecompressor().decompress(frame[16 : 16 + size]))["messages"]


class PageWatcher:
    """Listens beside other browsers; `positions` are the last ones, by name of the frame."""

    def __init__(self, address):
        self.positions = {}
        self._socket = connected(address)
        threading.Thread(target=self._listen, daemon=True).start()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._socket.close()

    def _listen(self):
        try:
            for frame in self._socket:
                for message in messages(frame):
                    if message["type"] == "SetPositionMessage":
                        self.positions[message["name"]] = np.array(message["position"])
        except ConnectionClosed:
            pass
