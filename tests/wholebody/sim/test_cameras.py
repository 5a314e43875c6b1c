"""What the robot's cameras see is drawn from the plant's present moment, and sent to a policy that wants it."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from models import g1
from policy.findings import Finding
from policy.remote.client import RemotePolicy
from policy.remote.msgpack_numpy import unpack
from tests.support.openpi_peer import SERVER, Peer
from tests.support.policy_cases import observation
from wholebody.cli.simulated import cameras_of
from wholebody.cli.sources import _warnings
from wholebody.errors import RenderError
from wholebody.sim import cameras as module
from wholebody.sim.cameras import RenderedCameras
from wholebody.sim.plant import MujocoPlant

SCENE = "table_cylinder"


@pytest.fixture(scope="module")
def plant():
    made = MujocoPlant(g1(), scene=SCENE)
    made.reset()
    return made


def red(image):
    """Share of pixels of the cylinder's colour."""
    r, g, b = (image[..., i].astype(int) for i in range(3))
    return float(((r > 100) & (r > 2 * g) & (r > 2 * b)).mean())


def test_images_sent_to_a_policy_are_rendered_when_told_so(plant):
    """The head looks at the table with the cylinder on it; what openpi's server gets is that, and grey for the rest."""
    requests, frames = [], (SERVER["metadata"], SERVER["answer"])

    def script(wire):
        wire.send(frames[0])
        requests.append(unpack(wire.receive()))
        wire.send(frames[1])
        wire.stall()

    checker = SimpleNamespace(plant=plant, scene=SCENE)
    with Peer(script) as peer:
        policy = RemotePolicy.connect(peer.uri, assume_spec="wbc32", placeholder_cameras=True)
        policy.cameras = {"head": (96, 128), "torso": (8, 8)}
        try:
            with cameras_of(policy, checker, "rendered") as cameras:
                first = cameras()
                plant.data.qpos[2] += 0.3
                second = cameras()
        except RenderError as error:
            assert "libegl1" in str(error)  # noqa: PT017 - no OpenGL here is an answer, too
            return
        finally:
            plant.reset()
        policy.infer(dataclasses.replace(observation(), images=first | {"left_wrist": first["head"]}))
        policy.close()
    assert list(first) == ["head"]
    assert first["head"].shape == (96, 128, 3)
    assert red(first["head"]) > 0.005
    assert not np.array_equal(first["head"], second["head"])
    assert np.array_equal(requests[0]["observation/image"], first["head"])


def test_images_are_grey_unless_told_otherwise(plant):
    policy = SimpleNamespace(
        cameras={"head": (8, 8), "torso": (8, 8)}, warnings=(Finding("cameras", "warning", "all see grey"),)
    )
    with cameras_of(policy, SimpleNamespace(plant=plant, scene=SCENE), "grey") as cameras:
        assert cameras is None
    (said,) = _warnings(policy, "grey")
    assert "head, torso see grey" in said.text
    (said,) = _warnings(policy, "rendered")
    assert "torso see grey" in said.text
    assert "head" not in said.text


def test_without_opengl_the_packages_are_named(plant, monkeypatch):
    monkeypatch.setattr(module, "LIBRARIES", {"nothing": "libnothing1"})
    with pytest.raises(RenderError, match=r"no OpenGL here to draw what cameras see.*libnothing1"):
        RenderedCameras(plant, SCENE, {"head": (8, 8)})
