"""Strategy: the page itself, asked by clients that are no page of it, and told what none of its controls sends."""

import http.client
import itertools
import re
import threading

import msgspec
import numpy as np
import pytest
import viser
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from tests.support.page_watcher import messages
from wholebody.live import page as page_module
from wholebody.live.door import ANYWHERE, Door
from wholebody.live.page import Page
from wholebody.live.panel import CONTROLS
from wholebody.live.robot_process import World
from wholebody.live.snapshot import UserCommand

VALUES = itertools.count(10.0, 10.0)
"""Latencies, each another one: a control that is told what it has says nothing [ms]."""
ROTATION, POINT = [1.0, 0.0, 0.0, 0.0], [0.3, 0.2, 0.9]


@pytest.fixture(scope="module")
def page():
    return Page(World(), ["wave", "hands"], "127.0.0.1", 0, CONTROLS)


@pytest.fixture(autouse=True)
def nothing_wished(page):
    page._wishes.clear()


def port(page):
    return int(re.search(r":(\d+)/", page.address)[1])


def joined(page, path=None, **headers):
    uri = f"ws://127.0.0.1:{port(page)}/{page._door.token if path is None else path}"
    protocols = [f"viser-v{viser.__version__}"]
    return connect(uri, max_size=None, subprotocols=protocols, proxy=None, additional_headers=headers)


def looking(page):
    """A client that is somebody to viser, since it has said where it looks from."""
    client = joined(page)
    points = {"position": POINT, "look_at": POINT, "up_direction": [0.0, 0.0, 1.0]}
    numbers = {"fov": 1.0, "near": 0.01, "far": 100.0, "image_height": 400, "image_width": 600}
    send(client, {"type": "ViewerCameraMessage", "wxyz": ROTATION} | points | numbers)
    return client


def status(page, path, host):
    asked = http.client.HTTPConnection("127.0.0.1", port(page), timeout=60)
    asked.request("GET", path, headers={"Host": host})
    return asked.getresponse().status


def told(page, client, count):
    """Wishes of the page once there are so many; the client shows that it is still served."""
    latency = next(VALUES)
    send(client, {"type": "GuiUpdateMessage", "uuid": uuid(page, "latency"), "updates": {"value": latency}})
    for _ in range(1000):
        if len(page._wishes) >= count:
            break
        threading.Event().wait(0.01)
    return list(page._wishes)


def send(client, message):
    client.send(message if isinstance(message, bytes | str) else msgspec.msgpack.encode(message))


def uuid(page, label):
    found = page._server.gui._gui_input_handle_from_uuid
    return next(key for key, handle in found.items() if label in handle.label)


def test_the_address_with_its_token_is_served_and_no_other(page):
    host, token = f"127.0.0.1:{port(page)}", page._door.token
    assert page.address == f"http://{host}/{token}"
    assert len(token) >= 22
    assert status(page, f"/{token}", host) == 200
    for path in ("/", "/index.html", f"/{token}x", f"/{token[:-1]}", "//", f"/x/{token}", f"/?{token}"):
        assert status(page, path, host) == 403


@pytest.mark.parametrize("host", ["evil.example", "127.0.0.1.evil.example", "192.168.0.9", "", "[", "user@127.0.0.1.x"])
def test_a_name_that_was_made_to_point_here_is_refused(page, host):
    assert status(page, f"/{page._door.token}", host) == 403


@pytest.mark.parametrize("host", ["localhost", "LOCALHOST", "127.0.0.1", "[::1]"])
def test_this_computer_may_be_called_by_its_names(page, host):
    assert status(page, f"/{page._door.token}", f"{host}:{port(page)}") == 200


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "null", "http://127.0.0.1", "https://127.0.0.1:{}", "file://"]
)
def test_another_web_site_is_refused(page, origin):
    with pytest.raises(InvalidStatus, match="403"):
        joined(page, Origin=origin.format(port(page)))


def test_a_websocket_without_the_token_is_refused(page):
    for path in ("", "x", page._door.token[:-1]):
        with pytest.raises(InvalidStatus, match="403"):
            joined(page, path)


def test_the_page_itself_gets_in(page):
    with joined(page, Origin=f"http://127.0.0.1:{port(page)}") as client:
        assert messages(client.recv(60.0))


def test_a_page_for_every_network_is_asked_by_address_or_by_the_computers_name():
    door = Door("0.0.0.0")
    assert "0.0.0.0" in ANYWHERE
    assert door._is_ours("192.168.1.7:8080")
    assert door._is_ours("[fe80::1]:8080")
    assert not door._is_ours("evil.example:8080")
    assert not Door("127.0.0.1")._is_ours("192.168.1.7:8080")


def test_what_the_controls_send_is_done(page):
    with looking(page) as client:
        send(client, {"type": "TransformControlsDragStartMessage", "name": "/handle/left", "owner": ""})
        move = {"name": "/handle/left", "wxyz": ROTATION, "position": POINT, "owner": ""}
        send(client, {"type": "TransformControlsUpdateMessage"} | move)
        # A drag that ends only with its client is ended by the server, whenever it notices: in the test that follows.
        send(client, {"type": "TransformControlsDragEndMessage", "name": "/handle/left", "owner": ""})
        send(client, {"type": "GuiUpdateMessage", "uuid": uuid(page, "source"), "updates": {"value": "hands"}})
        wishes = told(page, client, 5)
    assert [wish[0] for wish in wishes][:2] == [UserCommand.TARGETS, UserCommand.TARGETS]
    assert {UserCommand.SOURCE, UserCommand.LATENCY} <= {wish[0] for wish in wishes}
    np.testing.assert_allclose(np.array(wishes[1][1:]).reshape(2, 4, 4)[0, :3, 3], POINT)


def bad_messages(page):
    push, source = uuid(page, "push [N s]"), uuid(page, "source")
    drag = {"type": "TransformControlsUpdateMessage", "name": "/handle/left", "wxyz": ROTATION, "position": POINT}
    update = {"type": "GuiUpdateMessage", "uuid": push}
    camera = {"type": "ViewerCameraMessage", "wxyz": ROTATION}
    nan, huge = float("nan"), 1e300
    yield from ("text", b"", b"\xc1", b"\x91" * 5000, {}, [], 5, None, {"type": "None"}, {"type": 5}, {"type": ["x"]})
    yield from (
        {"type": "ShareUrlRequest"},
        {"type": "ShareUrlDisconnect"},
        {"type": "GuiFormSubmitMessage", "uuid": "x"},
    )
    yield from ({"type": "RunJavascriptMessage", "source": "alert(1)"}, {"type": "ResetGuiMessage"})
    yield from ({"type": "GuiFormDirtyMessage", "uuid": push}, {"type": "CommandTriggerMessage", "uuid": [1]})
    yield from (
        drag | {"name": "/robot"},
        drag | {"name": [1]},
        drag | {"wxyz": [nan] * 4},
        drag | {"position": [nan] * 3},
    )
    yield from (
        drag | {"position": [huge] * 3},
        drag | {"wxyz": [0.0] * 4},
        drag | {"position": None},
        drag | {"more": 1},
    )
    yield from (drag | {"owner": 5}, {"type": "TransformControlsUpdateMessage"}, drag | {"wxyz": "abcd"})
    for value in ("x", nan, huge, None, [1.0], {}, True, -1.0, 21.0, "5"):
        yield update | {"updates": {"value": value}}
    yield from (update, update | {"updates": {}}, update | {"updates": []}, update | {"updates": {"update_cb": []}})
    yield from (update | {"updates": {"value": 1.0, "removed": True}}, update | {"updates": {"removed": True}})
    yield from (update | {"uuid": "none", "updates": {"value": 1.0}}, update | {"uuid": [1], "updates": {"value": 1.0}})
    yield from (
        {"type": "GuiUpdateMessage", "uuid": source, "updates": {"value": one}} for one in ("none", 0, nan, ["wave"])
    )
    yield from (camera, camera | {"position": POINT, "fov": nan}, camera | {"wxyz": "none"})
    yield {"type": "FileTransferStartUpload", "source_component_uuid": push, "transfer_uuid": "x", "filename": "x"}
    yield {"type": "GetRenderResponseMessage", "payload": b"", "render_uuid": "x"}


def test_what_no_control_sends_leaves_no_trace_and_kills_nothing(page, capfd, monkeypatch):
    """Thirty-one kinds of messages left a traceback, one of them killed a slider for all, one opened a tunnel."""
    asked = []
    monkeypatch.setattr(type(page._server), "request_share_url", asked.append)
    with looking(page) as client:
        bad = list(bad_messages(page))
        for message in bad:
            send(client, message)
        assert len(bad) > 50
        wishes = told(page, client, 1)
        # Another one is served as before.
        with joined(page) as other:
            assert messages(other.recv(60.0))
    assert [wish[0] for wish in wishes] == [UserCommand.LATENCY]
    assert asked == []
    assert "Traceback" not in capfd.readouterr().err


def test_a_message_that_is_too_large_ends_its_connection_alone(page):
    with looking(page) as client, looking(page) as other:
        send(client, b"x" * (1 << 20))
        with pytest.raises(ConnectionClosed):
            for _ in client:
                pass
        assert [wish[0] for wish in told(page, other, 1)] == [UserCommand.LATENCY]


def test_every_control_of_the_page_is_known_to_its_door(page):
    inputs = page._server.gui._gui_input_handle_from_uuid
    assert page._door.values.keys() == inputs.keys()
    assert page._door.handles == {f"/handle/{side}" for side in page_module.SIDES}
