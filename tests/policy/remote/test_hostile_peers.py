"""Peers that mean harm, or are broken: silent clients, unasked answers, frames that are none, answers without end."""

import dataclasses
import logging
import socket
import threading
import time
from contextlib import ExitStack

import numpy as np
import pytest
from websockets.sync.client import connect as raw_connect

from policy import sparing_log
from policy.chunk import ActionChunk
from policy.reading import HORIZON_MAX
from policy.remote import server as server_module
from policy.remote.channel import RemoteAnswerError, RemoteConnectionError, RemoteServerError, quoted
from policy.remote.client import RemotePolicy, _cameras, _seconds
from policy.remote.msgpack_numpy import ENTRIES_MAX, WireError, pack, unpack
from policy.remote.server import PolicyServer
from policy.remote.wire import PROMPT_MAX, chunk_from_map, chunk_to_map, observation_from_map, observation_to_map
from policy.scripted.library import scripted_policy
from tests.support.openpi_peer import IMAGES as OPENPI_IMAGES
from tests.support.openpi_peer import SERVER, Peer, frame
from tests.support.policy_cases import observation

LONG = 60.0
"""A time-out that is not what ends a wait, on a slow and busy machine neither [s]."""
OPTIONS = {"connect_timeout": LONG, "timeout": LONG, "first_timeout": LONG}
HANDSHAKE = (
    b"GET / HTTP/1.1\r\nHost: x\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    b"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n"
)


def raw(server):
    """A connection of another library's user."""
    return raw_connect(server.uri, compression=None, proxy=None)


def silent_client(server):
    """A connection that shakes hands and says nothing after that, no pong either."""
    connection = socket.create_connection(("127.0.0.1", int(server.uri.rpartition(":")[2])))
    connection.sendall(HANDSHAKE)
    return connection


def test_b5_two_hundred_silent_clients_do_not_keep_the_robot_out():
    """Each was waited for, one after the other, under a lock: 400 s."""
    with PolicyServer(scripted_policy("wave"), port=0) as server, ExitStack() as held:
        for _ in range(200):
            held.enter_context(silent_client(server))
        begin = time.monotonic()
        policy = RemotePolicy.connect(server.uri, **OPTIONS)
        assert policy.infer(observation(0.0)).seq == 0
        assert time.monotonic() - begin < 0.1 * 200 * server_module.PONG_TIMEOUT
        policy.close()


def test_a_client_that_never_asks_gives_way(monkeypatch):
    monkeypatch.setattr(server_module, "IDLE_MAX", 0.2)
    with PolicyServer(scripted_policy("wave"), port=0) as server, raw(server) as idle:
        idle.recv(LONG)
        time.sleep(0.4)
        policy = RemotePolicy.connect(server.uri, **OPTIONS)
        policy.infer(observation(0.0))
        # A robot that asks keeps its place.
        time.sleep(0.4)
        with pytest.raises(RemoteServerError, match="busy"):
            RemotePolicy.connect(server.uri, **OPTIONS)
        policy.close()


def test_b5_refused_requests_and_clients_are_logged_on_one_line(caplog):
    caplog.set_level(logging.WARNING, "policy.remote.server")
    with PolicyServer(scripted_policy("wave"), port=0) as server, raw(server) as client:
        client.recv(LONG)
        with pytest.raises(RemoteServerError, match="busy"):
            RemotePolicy.connect(server.uri, **OPTIONS)
        client.send(pack({"session": "a", "\x1b[2J\nFEASIBLE": 1}))
        client.recv(LONG)
    said = [record.getMessage() for record in caplog.records if record.name == "policy.remote.server"]
    assert any("turned a client at 127.0.0.1" in line for line in said)
    assert any("refused a request of 127.0.0.1" in line and "\\x1b[2J" in line for line in said)
    assert all(line.isprintable() for line in said)


def test_strangers_who_shake_hands_badly_cannot_fill_the_servers_log(caplog):
    with PolicyServer(scripted_policy("wave"), port=0) as server:
        for _ in range(40):
            with socket.create_connection(("127.0.0.1", int(server.uri.rpartition(":")[2]))) as stranger:
                stranger.sendall(b"GET / HTTP/1.1\r\nHost: x\r\nOrigin: http://x\r\n\r\n")
                while stranger.recv(4096):
                    pass
    assert 0 < len(caplog.records) <= 2 * sparing_log.BURST


def answer():
    return frame(pack({"actions": np.tile([0.3, 0.2, 0.1, 1, 0, 0, 0, 1, 0] * 2 + [0.0] * 14, (2, 1))}))


def connect(peer):
    return RemotePolicy.connect(peer.uri, assume_spec="wbc32-v1", **OPTIONS)


def seen(time=0.0):
    return dataclasses.replace(observation(time), images=OPENPI_IMAGES)


@pytest.mark.parametrize("broken", [b"\xff\xff\xff\xff", b"\x82\xff" + b"\xff" * 8, b"\xc2\x01a", b"\x82\x81abcd"])
def test_b5_a_broken_frame_is_told_at_once(broken):
    """websockets waits for its peer to hang up; a run of 2 s took 124."""

    def script(wire):
        wire.send(SERVER["metadata"])
        wire.receive()
        wire.send(broken)
        wire.stall()

    with Peer(script) as peer:
        policy, begin = connect(peer), time.monotonic()
        with pytest.raises(RemoteConnectionError, match="the connection broke before the answer"):
            policy.infer(seen())
        # The peer stays silent until the test is over.
        assert time.monotonic() - begin < 0.1 * LONG


def test_b5_an_answer_that_nobody_asked_for_is_not_taken_for_the_next():
    def twice(wire):
        wire.send(SERVER["metadata"])
        wire.receive()
        wire.send(answer() + answer())
        wire.receive()
        wire.stall()

    def once(wire):
        wire.send(SERVER["metadata"])
        wire.receive()
        wire.send(answer())
        wire.stall()

    with Peer(twice, once) as peer:
        policy = connect(peer)
        assert policy.infer(seen()).seq == 0
        time.sleep(0.2)
        with pytest.raises(RemoteAnswerError, match="an answer that was not asked for"):
            policy.infer(seen(0.1))
        assert policy.infer(seen(0.2)).t_obs == 0.2
        assert peer.connections == 2


def test_b3_answers_of_ten_thousand_rows_are_refused():
    def script(wire):
        wire.send(SERVER["metadata"])
        wire.receive()
        data = pack({"actions": np.zeros((10_000, 32), dtype=np.float32)})
        wire.send(b"\x82\x7f" + len(data).to_bytes(8, "big") + data)
        wire.stall()

    with Peer(script) as peer, pytest.raises(RemoteAnswerError, match=f"10000 steps; at most {HORIZON_MAX} are taken"):
        connect(peer).infer(seen())
    chunk = chunk_to_map(scripted_policy("wave").infer(observation(0.0)))
    long = {
        name: np.tile(x, (10_000, *[1] * (x.ndim - 1))) if isinstance(x, np.ndarray) else x for name, x in chunk.items()
    }
    with pytest.raises(WireError, match="steps; at most"):
        chunk_from_map(long)


def map_of_nothing(count):
    """A map of numbers to nil."""
    entries = np.empty(count, "S1,>u4,S1")
    entries["f0"], entries["f1"], entries["f2"] = b"\xce", np.arange(count), b"\xc0"
    return b"\xdf" + count.to_bytes(4, "big") + entries.tobytes()


@pytest.mark.parametrize(
    "bomb",
    [
        b"\xdd\x00\x98\x96\x80" + b"\x80" * 10**7,
        b"\xdc\x27\x10" + (b"\xdc\x27\x10" + b"\x90" * 10_000) * 100,
        b"\x91" * 10**6 + b"\x90",
        map_of_nothing(2**20),
        b"\xdb\x00\x20\x00\x00" + b"a" * 2**21,
    ],
)
def test_a_frame_that_unpacks_to_a_thousandfold_is_refused(bomb):
    """64 MiB of empty maps took 4.6 GB."""
    with pytest.raises(WireError):
        unpack(bomb)
    assert len(unpack(pack(list(range(ENTRIES_MAX - 1))))) == ENTRIES_MAX - 1


def test_what_a_server_says_of_itself_is_bounded():
    assert [_seconds(value) for value in (3, 1e300, -1.0, float("nan"), True, "x")] == [3.0, *[None] * 5]
    many = {f"camera{i}": [480, 640] for i in range(10_000)}
    assert len(_cameras({"cameras": many})) == 16
    assert _cameras({"cameras": {f"camera{i}": [8192, 8192] for i in range(16)}}) == {}
    assert next(iter(_cameras({"cameras": {"\x1b[2J": [480, 640]}}))) == "\\x1b[2J"


def test_what_a_client_sends_is_bounded():
    request = observation_to_map(observation(0.0), "go")
    with pytest.raises(WireError, match=f"at most {PROMPT_MAX} are taken"):
        observation_from_map(request | {"prompt": "a" * (PROMPT_MAX + 1)})
    image = np.zeros((1, 1, 3), dtype=np.uint8)
    with pytest.raises(WireError, match="17 cameras; at most 16"):
        observation_from_map(request | {"images": {str(i): image for i in range(17)}})


def test_a_servers_traceback_cannot_pass_for_ours():
    text = "Traceback\n" + "x" * 10**6 + "\n\x1b[2JFEASIBLE  reach: done as given\nValueError: \x1b]0;title\x07"
    error = RemoteServerError(text)
    assert str(error).isprintable()
    lines = quoted(text).splitlines()
    assert all(line.startswith("| ") and line.isprintable() and len(line) < 320 for line in lines)
    assert "\x1b" not in error.__notes__[0]


def test_notes_of_a_chunk_go_into_reports_printable():
    chunk = chunk_to_map(scripted_policy("wave").infer(observation(0.0)))
    found = chunk_from_map(chunk | {"notes": ["\x1b[2J\nFEASIBLE" + "x" * 10**5] * 1000})
    assert isinstance(found, ActionChunk)
    assert len(found.notes) == 16
    assert all(note.isprintable() and len(note) < 320 for note in found.notes)


def test_threads_of_silent_clients_end_with_the_server():
    before = threading.active_count()
    with PolicyServer(scripted_policy("wave"), port=0) as server:
        clients = [silent_client(server) for _ in range(5)]
    for client in clients:
        client.close()
    deadline = time.monotonic() + LONG
    while threading.active_count() > before and time.monotonic() < deadline:
        time.sleep(0.05)
    assert threading.active_count() <= before + 1
