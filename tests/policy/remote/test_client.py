"""The client against a peer that plays back what openpi's server wrote, and one that does whatever a bad server might.

Strategy: the peer is a bare socket (`openpi_peer`), so that what is on the wire is not our library's or our server's
work. Waits are measured: no call may take longer than it was allowed, whatever the peer does.
"""

import dataclasses
import socket
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

from policy import Anchor, Observation, ObservationError, SpecError, builtin, decode, sparing_log
from policy.errors import ChunkError
from policy.remote.channel import (
    Channel,
    RemoteAnswerError,
    RemoteConnectionError,
    RemoteError,
    RemoteServerError,
    RemoteTimeoutError,
    full_uri,
    quoted,
)
from policy.remote.client import RemoteOptions, RemotePolicy, _cameras
from policy.remote.msgpack_numpy import pack, unpack
from policy.remote.openpi import ALOHA, LIBERO, KeyMap
from tests.support.openpi_peer import IMAGE, IMAGES, REQUEST, SERVER, STATE, Peer, frame
from tests.support.policy_cases import observation

WBC32 = builtin("wbc32-v1")
LONG = 60.0
"""A time-out that is not what ends a wait, on a slow and busy machine neither [s]."""
OPTIONS = {"assume_spec": "wbc32-v1", "connect_timeout": LONG, "timeout": LONG, "first_timeout": LONG}
BRIEF = {"timeout": 0.4, "first_timeout": 0.4}
"""Time-outs that do end waits [s]."""
MANY = 40
"""Most time-outs that giving up may take: a closing handshake takes two, a busy machine what it wants. The peers wait
for the end of the test, so that who waited for them would wait for ever."""


def seen(time=0.0, *, images=None, task="pick up the can"):
    return dataclasses.replace(observation(time), images=IMAGES if images is None else images, task=task)


def play(*frames, requests=None):
    """A script: metadata, then one frame a request, then silence."""

    def script(wire):
        wire.send(SERVER["metadata"])
        for answer in frames:
            request = wire.receive()
            if requests is not None:
                requests.append(request)
            wire.send(answer)
        wire.receive()
        wire.stall()

    return script


def play_raw(data):
    """A script: some bytes, then the end of the connection."""
    return lambda wire: wire.send(data)


def connect(peer, **changes):
    return RemotePolicy.connect(peer.uri, **OPTIONS | changes)


def actions_frame(actions, **more):
    return frame(pack({"actions": actions, **more}))


def assert_within(begin, timeout):
    assert timeout <= time.monotonic() - begin < MANY * timeout


def test_openpis_server_gets_images_state_and_prompt_without_a_key_map_and_its_answer_becomes_a_chunk():
    """What is sent is byte for byte what openpi's own client packs for its LIBERO example."""
    requests = []
    with Peer(play(SERVER["answer"], SERVER["second_answer"], requests=requests)) as peer:
        policy = connect(peer)
        assert policy.metadata["reset_pose"] == [0.0, 0.5]
        assert policy.sees_robot
        assert policy.duration is None
        for k in range(2):
            at = seen(0.5 * k)
            chunk = policy.infer(at)
            actions = STATE + np.arange(2, dtype=np.float32)[:, None] / 64
            expected = decode(WBC32, actions, Anchor.measured(at), seq=k, t_obs=0.5 * k)
            assert (chunk.seq, chunk.t_obs, chunk.spec_id) == (k, 0.5 * k, WBC32.id)
            assert all(np.array_equal(value, chunk.arrays()[name]) for name, value in expected.arrays().items())
            assert policy.timing["round_trip_ms"] > policy.timing["infer_ms"] > 0.0
        policy.close()
    assert requests == [REQUEST, REQUEST]


def test_a_text_frame_is_the_servers_traceback_and_the_next_request_connects_again():
    with Peer(play(SERVER["failure_and_close"]), play(SERVER["answer"])) as peer:
        policy = connect(peer)
        with pytest.raises(RemoteServerError, match="the server says: ValueError: the state is not finite") as caught:
            policy.infer(seen())
        assert caught.value.traceback.startswith("Traceback (most recent call last):")
        assert "/app/src/openpi/policies/policy.py" in caught.value.traceback
        assert caught.value.__notes__ == [f"Traceback of the server:\n{quoted(caught.value.traceback)}"]
        assert policy.infer(seen(0.1)).seq == 1
        assert peer.connections == 2


def test_a_servers_traceback_is_logged_once_however_often_it_comes(caplog):
    with Peer(play(SERVER["failure_and_close"])) as peer:
        policy = connect(peer)
        for k in range(3):
            with pytest.raises(RemoteServerError):
                policy.infer(seen(0.1 * k))
    (record,) = (record for record in caplog.records if record.name == "policy.remote.client")
    assert record.levelname == "ERROR"
    assert 'raise ValueError("the state is not finite")' in record.getMessage()


def test_a_server_that_says_something_else_every_time_cannot_fill_the_log(caplog, monkeypatch):
    """Sixty lines twice a second were 35,000 lines in five minutes."""
    monkeypatch.setattr(sparing_log, "monotonic", lambda: 0.0)  # so long that one more may come, it takes nowhere
    said = [frame("".join(f"line {k} of {n}\n" for k in range(5)).encode(), text=True) for n in range(60)]
    with Peer(*[play(text) for text in said]) as peer:
        policy = connect(peer)
        for n in range(len(said)):
            with pytest.raises(RemoteServerError, match=f"line 4 of {n}"):
                policy.infer(seen(0.1 * n))
    told = [record for record in caplog.records if record.name == "policy.remote.client"]
    assert len(told) == sparing_log.BURST
    assert "line 4 of 0" in told[0].getMessage()


def test_a_refusal_of_our_own_server_is_an_exception_and_no_traceback_in_the_log(caplog):
    said = b"Traceback (most recent call last):\n  File ...\npolicy.errors.ObservationError: lacks head\n"
    with Peer(play(frame(said, text=True))) as peer:
        policy = connect(peer)
        with pytest.raises(RemoteServerError, match="ObservationError: lacks head"):
            policy.infer(seen())
    assert not [record for record in caplog.records if record.name == "policy.remote.client"]


def test_a_server_that_states_impossible_camera_sizes_is_served_without_grey():
    sizes = {"head": [48, 64], "a": [0, 4], "b": [10**9, 10**9], "c": "big", "d": [1.5, 2.0], "e": [True, True]}
    assert _cameras({"cameras": sizes}) == {"head": (48, 64)}
    assert _cameras({"cameras": [1]}) == _cameras({}) == {}


def test_a_text_frame_in_place_of_metadata_is_said():
    script = play_raw(frame(b"RuntimeError: out of memory", text=True))
    with Peer(script) as peer, pytest.raises(RemoteServerError, match="out of memory"):
        connect(peer)


def test_the_prompt_is_the_observations_task_or_that_of_the_episode():
    requests = []
    with Peer(play(*[SERVER["answer"]] * 2, requests=requests)) as peer:
        policy = connect(peer)
        policy.reset("open the drawer")
        policy.infer(seen(0.0, task=""))
        policy.infer(seen(0.1, task="close it"))
    assert [unpack(request)["prompt"] for request in requests] == ["open the drawer", "close it"]


def test_images_go_under_the_names_and_in_the_axes_of_the_key_map():
    images = {camera: IMAGE + i for i, camera in enumerate(("head", "left_wrist", "right_wrist"))}
    flat = LIBERO.request(STATE, images, "go")
    assert list(flat) == ["observation/state", "observation/image", "observation/wrist_image", "prompt"]
    assert np.array_equal(flat["observation/wrist_image"], IMAGE + 1)
    nested = ALOHA.request(STATE, images, "go")
    assert list(nested) == ["state", "images", "prompt"]
    assert list(nested["images"]) == ["cam_high", "cam_left_wrist", "cam_right_wrist"]
    assert np.array_equal(nested["images"]["cam_right_wrist"], (IMAGE + 2).transpose(2, 0, 1))
    assert unpack(pack(nested))["images"]["cam_high"].shape == (3, 2, 3)
    assert "prompt" not in KeyMap(prompt=None).request(STATE, {}, "go")


@pytest.mark.parametrize(
    "keys",
    [
        {"state": "prompt"},
        {"images": {"head": ("observation", "image"), "wrist": "observation"}},
        {"image_axes": "whc"},
    ],
)
def test_a_key_map_that_contradicts_itself_is_refused(keys):
    with pytest.raises(SpecError):
        KeyMap(**keys)


def test_a_missing_camera_is_named_with_the_nearest_one_before_anything_is_sent():
    with Peer(play(SERVER["answer"])) as peer:
        policy = connect(peer)
        with pytest.raises(ObservationError, match="no image 'head'; did you mean 'heat'"):
            policy.infer(seen(images={"heat": IMAGE}))
        with pytest.raises(ObservationError, match="it has no images"):
            policy.infer(seen(0.1, images={}))
        assert policy.infer(seen(0.2)).seq == 2


def test_a_server_that_does_not_state_its_layout_is_refused_unless_the_user_vouches():
    with Peer(play()) as peer:
        with pytest.raises(SpecError, match=r"does not say what its actions are.*assume_spec"):
            connect(peer, assume_spec=None)
        with pytest.raises(SpecError, match="--assume-spec wbc32"):
            RemotePolicy.connect(peer.uri, spec="wbc32-v1", **OPTIONS | {"assume_spec": None})
        assert connect(peer).spec == WBC32


@pytest.mark.parametrize("as_text", [False, True])
def test_a_layout_in_the_metadata_of_an_openpi_server_is_agreed_on(as_text):
    stated = builtin("joint28").to_json() if as_text else builtin("joint28").to_dict()
    metadata = frame(pack({"action_spec": stated}))
    options = OPTIONS | {"assume_spec": None}
    with Peer(lambda wire: (wire.send(metadata), wire.stall())) as peer:
        assert RemotePolicy.connect(peer.uri, **options).spec == builtin("joint28")
        with pytest.raises(SpecError, match="spec 'joint28' is not 'wbc32': dim is 28, expected 32"):
            RemotePolicy.connect(peer.uri, spec="wbc32-v1", **options)


def test_another_layout_for_the_state_can_be_named():
    requests = []
    answer = actions_frame(np.tile(STATE, (3, 1)))
    with Peer(play(answer, requests=requests)) as peer:
        connect(peer, assume_state="joint28").infer(seen())
    assert unpack(requests[0])["observation/state"].shape == (28,)


@pytest.mark.parametrize(
    ("answer", "error", "complaint"),
    [
        (actions_frame(STATE), ChunkError, r"have shape \(32,\); 'wbc32' has \(steps, 32\)"),
        (actions_frame(np.zeros((5, 31))), ChunkError, r"have shape \(5, 31\)"),
        (actions_frame(np.full((2, 32), np.nan)), ChunkError, "is nan at step 0"),
        (actions_frame(np.zeros((2, 32))), ChunkError, "left_wrist_rotation at step 0"),
        (actions_frame([[0.0] * 32]), RemoteAnswerError, "no array 'actions'; it is list"),
        (frame(pack({"action": 1, "state": 2})), RemoteAnswerError, "no array 'actions'; there are: action, state"),
        (frame(pack([1, 2])), RemoteAnswerError, "holds list; a map is expected"),
        (frame(b"\xc1"), RemoteAnswerError, "is no MessagePack"),
        (frame(b""), RemoteAnswerError, "is no MessagePack"),
        (b"\x82\x7f" + (2**40).to_bytes(8, "big"), RemoteConnectionError, "the connection broke"),
        (b"\xff\xff\xff\xff", RemoteConnectionError, "the connection broke"),
        (frame(b"\xff\xfe", text=True), RemoteConnectionError, "the connection broke"),
    ],
    ids=lambda value: None if isinstance(value, bytes) else str(value)[:40],
)
def test_an_answer_that_means_nothing_is_refused_and_the_next_one_counts(answer, error, complaint):
    good = play(SERVER["answer"])
    with Peer(play(answer, SERVER["answer"]), good) as peer:
        policy = connect(peer)
        with pytest.raises(error, match=complaint):
            policy.infer(seen())
        assert policy.infer(seen(0.1)).t_obs == 0.1


def test_a_server_that_thinks_for_ever_is_given_up_in_time_and_its_late_answer_is_never_taken():
    late = threading.Event()

    def slow(wire):
        wire.send(SERVER["metadata"])
        wire.receive()
        late.wait()
        wire.send(actions_frame(np.tile(STATE, (9, 1))))

    with Peer(slow, play(SERVER["answer"])) as peer:
        policy, begin = connect(peer, **BRIEF), time.monotonic()
        with pytest.raises(RemoteTimeoutError, match=r"ws://127.0.0.1:\d+: no answer within 0.4 s"):
            policy.infer(seen())
        assert_within(begin, 0.4)
        late.set()
        policy.options = dataclasses.replace(policy.options, first_timeout=LONG)
        assert len(policy.infer(seen(0.1))) == 2


def test_a_server_that_stops_reading_is_given_up_in_time():
    big = np.zeros((2000, 2000, 3), dtype=np.uint8)  # 12 MB: more than any socket's buffers
    with Peer(lambda wire: (wire.send(SERVER["metadata"]), wire.stall())) as peer:
        policy, begin = connect(peer, **BRIEF), time.monotonic()
        with pytest.raises(RemoteTimeoutError, match=r"no answer within 0.4 s"):
            policy.infer(seen(images={"head": big, "left_wrist": big}))
        assert_within(begin, 0.4)


def test_a_server_that_drips_an_endless_frame_is_given_up_in_time():
    def drip(wire):
        wire.send(SERVER["metadata"])
        wire.receive()
        wire.send(b"\x82\x7f" + (10**6).to_bytes(8, "big"))
        while not wire._end.wait(0.02):
            wire.send(b"\x00")

    with Peer(drip) as peer:
        policy, begin = connect(peer, **BRIEF), time.monotonic()
        with pytest.raises(RemoteTimeoutError):
            policy.infer(seen())
        assert_within(begin, 0.4)


def test_the_first_answer_of_a_connection_has_its_own_time_out():
    def compiling(wire):
        wire.send(SERVER["metadata"])
        wire.receive()
        time.sleep(0.6)
        wire.send(SERVER["answer"])
        wire.receive()
        wire.stall()

    with Peer(compiling) as peer:
        policy = connect(peer, timeout=0.4)
        assert len(policy.infer(seen())) == 2
        with pytest.raises(RemoteTimeoutError, match=r"within 0.4 s"):
            policy.infer(seen(0.1))


@pytest.mark.parametrize(
    ("script", "handshake"), [(lambda wire: wire.stall(), True), (lambda wire: wire.stall(), False)]
)
def test_a_server_that_takes_the_connection_and_says_nothing_is_given_up_in_time(script, handshake):
    with Peer(script, handshake=handshake) as peer:
        begin = time.monotonic()
        with pytest.raises(RemoteTimeoutError, match=r"policy server on that port|no metadata within"):
            connect(peer, connect_timeout=0.4)
        assert_within(begin, 0.4)


def test_what_is_no_websocket_is_said():
    answers = (b"HTTP/1.1 403 Forbidden\r\nContent-Length: 0\r\n\r\n", b"SSH-2.0-OpenSSH_9.6\r\n")
    for answer in answers:
        peer = Peer(play_raw(answer), handshake=False)
        with peer, pytest.raises(RemoteConnectionError, match="no websocket there"):
            connect(peer)


def test_what_speaks_before_it_is_asked_is_no_websocket(monkeypatch):
    """An SSH server greets whoever connects, which websockets does not expect before its own request."""
    from websockets.sync.client import ClientConnection

    shake = ClientConnection.handshake

    def late(self, *arguments):
        time.sleep(0.2)
        shake(self, *arguments)

    def greet(wire):
        wire.send(b"SSH-2.0-OpenSSH_9.6\r\n")
        time.sleep(0.5)

    monkeypatch.setattr(ClientConnection, "handshake", late)
    peer = Peer(greet, handshake=False)
    with peer, pytest.raises(RemoteConnectionError, match=r"no websocket there: .+; is a policy server on that port"):
        connect(peer)


def test_where_nobody_listens_the_client_waits_and_then_says_so():
    begin = time.monotonic()
    with pytest.raises(RemoteConnectionError, match="no server listens there; start the server"):
        RemotePolicy.connect(f"ws://127.0.0.1:{free_port()}", **OPTIONS | {"connect_timeout": 0.5})
    assert 0.1 < time.monotonic() - begin < MANY * 0.5


def test_a_server_that_still_loads_is_waited_for():
    port, peers = free_port(), []

    def start():
        time.sleep(0.5)
        peers.append(Peer(play(SERVER["answer"]), port=port).__enter__())

    thread = threading.Thread(target=start)
    thread.start()
    policy = RemotePolicy.connect(f"127.0.0.1:{port}", **OPTIONS)
    assert len(policy.infer(seen())) == 2
    thread.join()
    peers[0].__exit__()


def test_a_server_that_is_gone_is_not_waited_for_in_mid_run():
    with Peer(play()) as peer:
        policy = connect(peer)
        policy._channel.close()
    begin = time.monotonic()
    with pytest.raises(RemoteConnectionError, match="no server listens"):
        policy.infer(seen())
    assert time.monotonic() - begin < 0.1 * LONG


def test_a_server_that_hangs_up_in_mid_run_costs_no_answer_when_it_is_back():
    def hang_up(wire):
        wire.send(SERVER["metadata"])
        wire.receive()
        wire.send(SERVER["answer"])

    with Peer(hang_up) as peer:
        policy = connect(peer)
        for k in range(3):
            assert policy.infer(seen(0.1 * k)).seq == k
            time.sleep(0.1)
        assert peer.connections == 3


def test_another_policy_on_the_same_port_is_not_taken_for_the_one_before():
    other = frame(pack({"action_spec": builtin("joint28").to_dict()}))
    with Peer(play(SERVER["failure_and_close"]), lambda wire: (wire.send(other), wire.stall())) as peer:
        policy = connect(peer)
        with pytest.raises(RemoteServerError):
            policy.infer(seen())
        with pytest.raises(RemoteAnswerError, match="another policy answers there now"):
            policy.infer(seen(0.1))


def test_time_that_goes_back_is_refused_until_a_reset():
    with Peer(play(*[SERVER["answer"]] * 3)) as peer:
        policy = connect(peer)
        policy.infer(seen(1.0))
        with pytest.raises(ObservationError, match="is before the last one"):
            policy.infer(seen(0.5))
        policy.reset()
        assert policy.infer(seen(0.5)).seq == 0


@pytest.mark.parametrize(
    ("given", "meant"),
    [
        ("gpu.local", "ws://gpu.local:8000"),
        ("10.0.0.2:9000", "ws://10.0.0.2:9000"),
        ("wss://host/path", "wss://host:8000/path"),
        ("ws://[::1]:80", "ws://[::1]:80"),
    ],
)
def test_an_address_is_completed(given, meant):
    assert full_uri(given) == meant


@pytest.mark.parametrize("given", ["http://host", "ws://", "ws://host:port", "ws://host:99999", ""])
def test_what_is_no_address_is_refused(given):
    with pytest.raises(RemoteConnectionError, match="is no address"):
        Channel(given)


@pytest.mark.parametrize("changes", [{"timeout": 0.0}, {"first_timeout": -1.0}, {"connect_timeout": float("inf")}])
def test_a_wait_without_an_end_cannot_be_asked_for(changes):
    with pytest.raises(ValueError, match=f"{next(iter(changes))} is"):
        RemoteOptions(**changes)


def test_every_error_is_a_policy_error_and_a_builtin_one():
    kinds = {
        RemoteConnectionError: ConnectionError,
        RemoteTimeoutError: TimeoutError,
        RemoteAnswerError: ValueError,
        RemoteServerError: RuntimeError,
    }
    for kind, builtin_kind in kinds.items():
        assert issubclass(kind, RemoteError)
        assert issubclass(kind, builtin_kind)


def test_a_malformed_observation_is_refused_before_anything_is_sent():
    nominal = observation()
    broken = Observation(0.0, nominal.q_body[:5], nominal.q_lhand, nominal.q_rhand, nominal.T_world_base)
    with Peer(play()) as peer, pytest.raises(ObservationError, match="q_body has shape"):
        connect(peer).infer(broken)


def test_client_and_server_need_no_torch():
    names = ("torch", "lerobot", "transformers", "safetensors", "mujoco")
    code = (
        "import sys; from policy.remote.server import PolicyServer; from policy.remote.client import RemotePolicy\n"
        "from policy.scripted.library import scripted_policy\n"
        "with PolicyServer(scripted_policy('wave'), port=0) as server: RemotePolicy.connect(server.uri).close()\n"
        f"print(sorted(set(sys.modules) & set({names!r})))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def free_port():
    with socket.create_server(("127.0.0.1", 0)) as listener:
        return listener.getsockname()[1]
