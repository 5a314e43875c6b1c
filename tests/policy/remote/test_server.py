"""A policy served on loopback: the same chunks to the bit, one robot at a time, and no request that brings it down."""

import dataclasses
import time
import urllib.request

import numpy as np
import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect as raw_connect

from policy import Anchor, PolicyError, builtin, encode
from policy.action_spec.state import state_numbers
from policy.clock import MonotonicClock
from policy.executor.executor import Executor, ExecutorConfig
from policy.prefix import Prefix, PrefixPolicy
from policy.remote import server as server_module
from policy.remote.channel import RemoteError, RemoteServerError, RemoteTimeoutError
from policy.remote.client import RemotePolicy
from policy.remote.msgpack_numpy import pack, unpack
from policy.remote.openpi import KeyMap
from policy.remote.server import CLOSE_REASON, PolicyServer, metadata_of
from policy.remote.wire import chunk_to_map, observation_to_map
from policy.scripted.library import scripted_policy
from tests.support.openpi_peer import IMAGES as OPENPI_IMAGES
from tests.support.openpi_peer import REQUEST, STATE
from tests.support.policy_cases import observation
from tests.support.watching_policy import Reaching, Watching

LONG = 60.0
"""A time-out that is not what ends a wait, on a slow and busy machine neither [s]."""
OPTIONS = {"connect_timeout": LONG, "timeout": LONG, "first_timeout": LONG}
IMAGES = {"head": np.arange(27, dtype=np.uint8).reshape(3, 3, 3)}


class Continuing(Reaching):
    def infer_after(self, observation, prefix):
        self.prefixes.append(prefix)
        return self.infer(observation)


def seen(time=0.0, task="pick up the can"):
    return dataclasses.replace(observation(time, lean=0.1), images=IMAGES, task=task)


def connect(server, **changes):
    return RemotePolicy.connect(server.uri, **OPTIONS | changes)


def raw(server):
    """A connection of another library's user, metadata already read."""
    connection = raw_connect(server.uri, compression=None, max_size=None, proxy=None).__enter__()
    connection.recv(LONG)
    return connection


def same(a, b):
    """Whether two chunks are equal to the bit."""
    names = ("spec_id", "seq", "t_obs", "fps", "notes")
    return (
        all(getattr(a, name) == getattr(b, name) for name in names)
        and a.arrays().keys() == b.arrays().keys()
        and all(a.arrays()[name].dtype == b.arrays()[name].dtype for name in b.arrays())
        and all(a.arrays()[name].tobytes() == b.arrays()[name].tobytes() for name in b.arrays())
    )


def test_served_chunks_are_those_of_the_policy_itself_to_the_bit():
    local = scripted_policy("wave")
    local.reset()
    with PolicyServer(scripted_policy("wave"), port=0) as server:
        policy = connect(server)
        assert (policy.spec, policy.sees_robot, policy.duration) == (local.spec, False, local.duration)
        for k in range(3):
            at = observation(0.4 * k)
            assert same(policy.infer(at), local.infer(at))
        policy.reset()
        local.reset()
        assert same(policy.infer(observation()), local.infer(observation()))


def test_the_policy_sees_the_observation_as_it_was_to_the_bit():
    served, at = Reaching(), seen(1.25)
    with PolicyServer(served, port=0) as server:
        policy = connect(server)
        policy.reset("tidy up")
        chunk = policy.infer(at)
        policy.infer(dataclasses.replace(at, time=1.5, task=""))
    first, second = served.asked
    for name in ("q_body", "q_lhand", "q_rhand", "T_world_base"):
        assert getattr(first, name).tobytes() == getattr(at, name).tobytes()
        assert getattr(first, name).flags.writeable
    assert (first.time, first.task, second.task) == (1.25, "pick up the can", "tidy up")
    assert np.array_equal(first.images["head"], IMAGES["head"])
    assert first.images["head"].flags.writeable
    assert chunk.notes == ("one", "two")
    assert served.resets == ["pick up the can"]


def test_a_policy_that_continues_what_is_executed_can_do_so_from_afar():
    served, executed = Continuing(), scripted_policy("wave").infer(observation())
    with PolicyServer(served, port=0) as server:
        policy = connect(server)
        assert isinstance(policy, PrefixPolicy)
        policy.infer_after(seen(), Prefix(executed, 20, 3, 10))
    (prefix,) = served.prefixes
    assert same(prefix.executed, executed)
    assert (prefix.steps, prefix.inference_delay, prefix.execution_horizon) == (20, 3, 10)
    with PolicyServer(Reaching(), port=0) as server:
        assert not isinstance(connect(server), PrefixPolicy)


def test_openpis_client_gets_raw_actions_for_its_images_state_and_prompt_without_a_key_map():
    """The request is what openpi-client 0.1.2 packed under the keys of openpi's LIBERO example."""
    served, layout = Watching(), builtin("wbc32-v1")
    stock = {"compression": None, "max_size": None, "proxy": None}
    with PolicyServer(served, port=0) as server, raw_connect(server.uri, **stock) as connection:
        metadata = unpack(connection.recv(LONG))
        connection.send(REQUEST)
        answer = unpack(connection.recv(LONG))
    assert metadata["action_spec"]["hash"] == layout.hash
    assert list(metadata["request"]) == list(unpack(REQUEST))
    (seen,) = served.asked
    assert seen.task == "pick up the can"
    assert {name: image.tolist() for name, image in seen.images.items()} == {
        name: image.tolist() for name, image in OPENPI_IMAGES.items()
    }
    np.testing.assert_allclose(state_numbers(layout, seen), STATE, atol=1e-5)
    assert sorted(answer) == ["actions", "server_timing"]
    # The policy answers with the wrists that it saw.
    np.testing.assert_allclose(answer["actions"], np.tile(STATE, (4, 1)), atol=1e-5)


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"observation/state": np.zeros(8)}, "(8,); the 32 numbers of 'wbc32' are expected (wholebody layouts wbc32)"),
        ({"observation/state": [0.0] * 32}, "'observation/state' of the request is list"),
        (
            {"observation/state": np.full(32, np.nan)},
            "the state is none of 'wbc32': action 0 (left_wrist_x",
        ),
        ({"observation/state": STATE + 3.0}, "waist and arms cannot reach"),
        ({"observation/image": np.zeros((3, 4, 4), np.uint8)}, "uint8 of shape (3, 4, 4); uint8 (height, width, 3)"),
        ({"observation/wrist_image": None}, "'observation/wrist_image' of the request is NoneType"),
        ({"prompt": 3}, "'prompt' of the request is int; text of at most 4000 is expected"),
        ({"prompt": "x" * 4001}, "'prompt' of the request is 4001 characters"),
    ],
)
def test_a_request_of_openpis_client_that_does_not_fit_is_answered_with_what_would(changes, complaint):
    with PolicyServer(Watching(), port=0) as server:
        connection = raw(server)
        connection.send(pack(unpack(REQUEST) | changes))
        assert complaint in connection.recv(LONG).strip().splitlines()[-1]


def test_a_camera_that_libero_lacks_goes_by_its_own_name_and_other_keys_are_told_by_a_map():
    served = Watching({"head": (2, 3), "torso": (2, 3)})
    with PolicyServer(served, port=0) as server:
        connection = raw(server)
        connection.send(REQUEST)
        said = connection.recv(LONG).strip().splitlines()[-1]
        assert "the request lacks 'observation/torso'" in said
        assert "it has observation/state, observation/image, observation/wrist_image, prompt" in said
    keys = KeyMap.named('{"torso": "observation/wrist_image"}')
    with PolicyServer(served, port=0, keys=keys) as server:
        connection = raw(server)
        connection.send(REQUEST)
        assert "actions" in unpack(connection.recv(LONG))
    assert sorted(served.asked[-1].images) == ["head", "torso"]


def test_a_policy_that_does_not_see_the_robot_is_served_to_openpis_client_without_a_state():
    with PolicyServer(scripted_policy("wave"), port=0) as server:
        connection = raw(server)
        connection.send(pack({"prompt": "wave"}))
        answer = unpack(connection.recv(LONG))
    expected = encode(builtin("wbc32"), scripted_policy("wave").infer(observation()), Anchor.nominal())
    np.testing.assert_allclose(answer["actions"], expected, atol=1e-7)


def test_the_server_listens_on_the_loopback_alone_unless_told_otherwise():
    with PolicyServer(scripted_policy("wave"), port=0) as server:
        assert server._server.socket.getsockname()[0] == "127.0.0.1"
        assert server.uri.startswith("ws://127.0.0.1:")
    with PolicyServer(scripted_policy("wave"), host="0.0.0.0", port=0) as server:
        assert server._server.socket.getsockname()[0] == "0.0.0.0"
        connect(server).close()


def test_a_port_that_is_taken_is_said_at_once():
    with PolicyServer(scripted_policy("wave"), port=0) as server, pytest.raises(OSError, match="in use"):
        PolicyServer(scripted_policy("wave"), port=int(server.uri.rsplit(":", 1)[1]))


def test_web_pages_cannot_reach_the_policy_and_health_checks_can():
    with PolicyServer(scripted_policy("wave"), port=0) as server:
        with pytest.raises(InvalidStatus, match="403"):
            raw_connect(server.uri, origin="http://evil.example", proxy=None).__enter__()
        with urllib.request.urlopen(server.uri.replace("ws", "http") + "/healthz", timeout=LONG) as answer:
            assert (answer.status, answer.read()) == (200, b"OK\n")


def test_a_second_robot_is_turned_away_with_a_sentence_and_gets_in_when_the_first_has_left():
    with PolicyServer(Reaching(), port=0) as server:
        first = connect(server)
        with pytest.raises(RemoteServerError, match="busy: it serves one robot at a time"):
            connect(server)
        first.infer(seen())
        first.close()
        assert connect(server).infer(seen()).seq == 0


def test_a_robot_whose_network_broke_makes_room_for_the_next(monkeypatch):
    """As soon as another one asks, not when its next ping is due."""
    monkeypatch.setattr(server_module, "PING_INTERVAL", 10.0 * LONG)
    with PolicyServer(Reaching(), port=0) as server:
        deaf = raw(server)
        # Its socket stays open, but nothing is read from it any longer, so no ping is answered.
        deaf.recv_flow_control.acquire()
        assert deaf.ping().wait(LONG)
        try:
            assert connect(server).infer(seen()).seq == 0
        finally:
            deaf.recv_flow_control.release()


def test_what_a_policy_raises_reaches_the_client_with_its_traceback_and_the_server_goes_on():
    served = Reaching()
    with PolicyServer(served, port=0) as server:
        policy = connect(server)
        policy.infer(seen())
        for raised in (RuntimeError("CUDA out of memory"), SystemExit(3)):
            served.raises = raised
            with pytest.raises(RemoteServerError) as caught:
                policy.infer(seen(1.0))
            assert f"{type(raised).__name__}: {raised}" in str(caught.value)
            assert "in infer\n    raise self.raises" in caught.value.traceback
        served.raises = None
        assert policy.infer(seen(2.0)).seq == 3


def test_a_traceback_is_a_text_frame_and_the_connection_is_closed_as_openpi_closes_it():
    with PolicyServer(Reaching(), port=0) as server:
        connection = raw(server)
        connection.send(pack({"prompt": "go"}))
        text = connection.recv(LONG)
        assert isinstance(text, str)
        assert text.startswith("Traceback (most recent call last):")
        assert text.rstrip().endswith("other keys are named with --rename-map")
        with pytest.raises(ConnectionClosed):
            connection.recv(LONG)
        assert (connection.close_code, connection.close_reason) == (1011, CLOSE_REASON)


def request(**changes):
    return {**observation_to_map(seen(), "go"), "session": "s", "continues": False, **changes}


@pytest.mark.parametrize(
    ("frame", "complaint"),
    [
        ("text", "a request is a binary frame"),
        (b"\xc1", "no MessagePack"),
        (pack([1]), "the request holds list"),
        (pack(request(q_bdy=1)), "an entry 'q_bdy'; did you mean 'q_body'"),
        (pack(request(time="now")), "'time' of the request is str"),
        (pack(request(time=float("nan"))), "time is nan"),
        (pack(request(q_body=[0.0] * 29)), "'q_body' of the request is list"),
        (pack(request(q_body=np.zeros(28))), r"q_body has shape (28,)"),
        (pack(request(q_body=np.full(29, np.nan))), "q_body is not finite"),
        (pack(request(q_body=np.array(["a"] * 29))), "'q_body' of the request is <U1"),
        (pack(request(T_world_base=np.zeros((4, 4)))), "T_world_base has no rotation"),
        (pack(request(images=[IMAGES["head"]])), "no map of cameras"),
        (pack(request(images={"head": 1})), "'head' of images is int"),
        (pack(request(images={"head": np.zeros((3, 4, 4))})), "image 'head' is float64"),
        (pack(request(prompt=3)), "'prompt' of the request is int"),
        (pack(request(prefix={"steps": 1})), "the prefix lacks executed"),
        (pack(request(prefix=3)), "the prefix is int"),
        (
            pack(request(prefix={"executed": {}, "steps": 1, "inference_delay": 1, "execution_horizon": 1})),
            "the chunk lacks",
        ),
    ],
)
def test_a_hostile_request_is_answered_with_a_sentence_and_never_reaches_the_policy(frame, complaint):
    served = Reaching()
    with PolicyServer(served, port=0) as server:
        connection = raw(server)
        connection.send(frame)
        assert complaint in connection.recv(LONG).strip().splitlines()[-1]
        connection.close()
        assert served.asked == []
        assert connect(server).infer(seen()).seq == 0


def test_a_prefix_for_a_policy_that_takes_none_is_refused():
    chunk = chunk_to_map(scripted_policy("wave").infer(observation()))
    prefix = {"executed": chunk, "steps": 1, "inference_delay": 0, "execution_horizon": 1}
    with PolicyServer(Reaching(), port=0) as server:
        connection = raw(server)
        connection.send(pack(request(prefix=prefix)))
        assert "Reaching takes no prefix" in connection.recv(LONG)


def test_a_request_that_is_too_large_closes_the_connection_and_not_the_server():
    with PolicyServer(Reaching(), port=0) as server:
        connection = raw(server)
        # The header of a frame of a terabyte.
        connection.socket.sendall(b"\x82\xff" + (2**40).to_bytes(8, "big") + b"\0\0\0\0")
        with pytest.raises(ConnectionClosed):
            connection.recv(LONG)
        assert connection.close_code == 1009
        assert connect(server).infer(seen()).seq == 0


def test_while_a_policy_hangs_clients_are_given_up_and_told_and_afterwards_served():
    served = Reaching()
    with PolicyServer(served, port=0) as server:
        policy = connect(server, timeout=0.3)
        policy.infer(seen())
        served.gate.clear()
        with pytest.raises(RemoteTimeoutError, match=r"no answer within 0.3 s"):
            policy.infer(seen(1.0))
        with pytest.raises(RemoteServerError, match="the policy is busy: it computes since"):
            policy.infer(seen(2.0))
        served.gate.set()
        server._worker._running[0].result(LONG)
        assert policy.infer(seen(3.0)).seq == 3
    assert len(served.asked) == 3


def test_a_server_whose_policy_hangs_can_be_closed():
    served = Reaching()
    served.gate.clear()
    server = PolicyServer(served, port=0)
    with server:
        policy = connect(server, first_timeout=0.2)
        with pytest.raises(RemoteTimeoutError):
            policy.infer(seen())
    # Closed, and the policy still waits: closing one that is waited for would not end.
    assert not served.gate.is_set()
    served.gate.set()


def test_a_new_episode_or_another_client_resets_the_policy_and_a_broken_connection_does_not():
    served = Reaching()
    with PolicyServer(served, port=0) as server:
        policy = connect(server)
        policy.infer(seen(0.0))
        policy._channel.close()
        policy.infer(seen(1.0))
        assert len(served.resets) == 1
        policy.reset()
        policy.infer(seen(0.0))
        assert len(served.resets) == 2
        policy.close()
        connect(server).infer(seen(0.0))
        assert len(served.resets) == 3


def test_an_episode_that_the_server_does_not_know_goes_on_only_where_the_policy_sees_the_robot():
    for served, goes_on in ((Reaching(), True), (scripted_policy("wave"), False)):
        with PolicyServer(served, port=0) as server:
            port = int(server.uri.rsplit(":", 1)[1])
            policy = connect(server)
            policy.infer(seen(0.0))
        with PolicyServer(served, port=port) as server:
            if goes_on:
                assert policy.infer(seen(1.0)).seq == 1
            else:
                with pytest.raises(RemoteServerError, match=r"this episode is not known here.*Reset the client"):
                    policy.infer(seen(1.0))
                policy.reset()
                assert policy.infer(seen(1.0)).seq == 0
            policy.close()


def test_metadata_say_what_a_client_must_know():
    metadata = metadata_of(Continuing())
    assert metadata["protocol"] == "g1-wholebody/1"
    assert (metadata["name"], metadata["sees_robot"], metadata["takes_prefix"]) == ("reaching", True, True)
    assert metadata["duration"] is None
    assert unpack(pack(metadata)) == metadata


@pytest.mark.alone
def test_an_executor_rides_out_a_server_that_dies_and_comes_back():
    """In real time: the control loop polls at 500 Hz and never waits."""
    served, clock = Reaching(), MonotonicClock()
    server = PolicyServer(served, port=0)
    port = int(server.uri.rsplit(":", 1)[1])
    with server:
        policy = connect(server)
        executor = Executor(policy, clock, config=ExecutorConfig(replace_every=1, retry_after=0.05))
        executor.reset()
        longest = poll_until(executor, clock, lambda: len(executor.report.deliveries) >= 3)
    longest = max(longest, poll_until(executor, clock, lambda: executor.report.counts["policy_raised"] >= 2))
    before = len(executor.report.deliveries)
    with PolicyServer(served, port=port):
        longest = max(longest, poll_until(executor, clock, lambda: len(executor.report.deliveries) > before))
        executor.close()
    assert longest < 0.5


def poll_until(executor, clock, done):
    """Poll as a control loop would; the longest poll [s]."""
    longest, end = 0.0, clock.now() + 10.0
    while not done():
        begin = clock.now()
        assert begin < end
        executor.poll(lambda: seen(clock.now()))
        longest = max(longest, clock.now() - begin)
        time.sleep(0.002)
    return longest


def test_every_failure_of_a_remote_policy_is_a_policy_error():
    assert issubclass(RemoteError, PolicyError)
