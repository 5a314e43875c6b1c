"""openpi's own client against our server, and our client against openpi's server: `make test-openpi`.

Neither side has a key map. openpi's side runs in an environment of its own, which OPENPI_PYTHON names; with a checkout
of openpi (OPENPI_CHECKOUT) the server is openpi's own, else one around openpi-client's packing.
"""

import dataclasses
import json
import os
import subprocess
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from policy import Anchor, builtin, encode
from policy.remote.channel import RemoteServerError
from policy.remote.client import RemotePolicy
from policy.remote.server import PolicyServer
from tests.support.openpi_peer import STATE
from tests.support.policy_cases import observation
from tests.support.watching_policy import Watching

pytestmark = [
    pytest.mark.openpi,
    pytest.mark.skipif("OPENPI_PYTHON" not in os.environ, reason="no environment of openpi's: make test-openpi"),
]

PEER = Path(__file__).parents[2] / "support" / "openpi_live.py"
SIDE = 224


def command(*arguments):
    # The interpreter of the other environment, and nothing of this one.
    python = Path(os.environ["OPENPI_PYTHON"]).absolute()
    return {"args": [str(python), "-E", str(PEER), *arguments], "stdout": subprocess.PIPE, "text": True}


@contextmanager
def openpi_server():
    checkout = os.environ.get("OPENPI_CHECKOUT", "")
    with subprocess.Popen(**command("server", *([checkout] if checkout else []))) as process:
        try:
            uri, kind = process.stdout.readline().split()
            assert kind == ("WebsocketPolicyServer" if checkout else "StandIn")
            yield uri
        finally:
            process.terminate()


def test_openpis_client_sends_images_state_and_prompt_to_our_server_without_a_key_map():
    served = Watching({"head": (SIDE, SIDE), "left_wrist": (SIDE, SIDE)})
    with PolicyServer(served, port=0) as server:
        call = command("client", server.uri)
        done = subprocess.run(**call, input=json.dumps(STATE.tolist()), check=True, timeout=60)
    said = json.loads(done.stdout)
    assert said["answer"] == ["actions", "server_timing"]
    assert {"action_spec", "request"} <= set(said["metadata"])
    # The policy answers with the wrists and fingers that it saw.
    np.testing.assert_allclose(said["actions"], np.tile(STATE, (2, 4, 1)), atol=1e-5)
    for seen in served.asked:
        assert seen.task == "pick up the can"
        assert sorted(seen.images) == ["head", "left_wrist"]
        assert all(image.shape == (SIDE, SIDE, 3) for image in seen.images.values())
        assert np.array_equal(seen.images["left_wrist"], seen.images["head"] + np.uint8(1))


def test_openpis_server_gets_images_state_and_prompt_from_our_client_without_a_key_map():
    with openpi_server() as uri:
        policy = RemotePolicy.connect(uri, assume_spec="wbc32-v1", placeholder_cameras=True, task="pick up the can")
        for k in range(3):
            at = observation(0.5 * k, lean=0.1 * k)
            chunk = policy.infer(at)
            actions = encode(builtin("wbc32-v1"), chunk, Anchor.measured(at))
            np.testing.assert_allclose(actions, np.tile(STATE, (10, 1)), atol=1e-6)
        pictures = {name: np.zeros((48, 64, 3), np.uint8) for name in ("head", "left_wrist")}
        with pytest.raises(RemoteServerError, match=r"observation/image is uint8 \(48, 64, 3\)"):
            policy.infer(dataclasses.replace(observation(2.0), images=pictures))
        assert len(policy.infer(observation(2.5))) == 10
        policy.close()
