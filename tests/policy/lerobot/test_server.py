"""A π0.5 behind the server, and a client in a process that never loads torch."""

import subprocess
import sys

import numpy as np
import pytest
from websockets.sync.client import connect

from policy import Anchor, builtin, decode, encode
from policy.action_spec.state import state_numbers
from policy.lerobot.policy import LeRobotPolicy
from policy.prefix import Prefix
from policy.remote.client import RemotePolicy
from policy.remote.msgpack_numpy import pack, unpack
from policy.remote.server import PolicyServer
from tests.support.tiny_policies import observation, tiny_backbones, write_checkpoint

CLIENT = """
import sys
from time import perf_counter
import numpy as np
from policy.action_spec.anchor import Anchor
from policy.observation import Observation
from policy.remote.client import RemotePolicy

anchor, rng = Anchor.nominal(), np.random.default_rng(0)
images = {name: rng.integers(0, 256, (64, 64, 3), dtype=np.uint8) for name in ("head", "left_wrist", "right_wrist")}
joints = (anchor.q_body, anchor.q_lhand, anchor.q_rhand, anchor.T_world_base)
policy = RemotePolicy.connect(sys.argv[1])
chunk = policy.infer(Observation(0.0, *joints, images=images, task="pick up the can"))
np.savez(sys.argv[2], **chunk.arrays())
print(sorted({"torch", "lerobot", "transformers"} & set(sys.modules)))
"""


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory):
    with tiny_backbones():
        return write_checkpoint("pi05", tmp_path_factory.mktemp("pi05"))


def load(checkpoint, **options):
    with tiny_backbones():
        return LeRobotPolicy.from_pretrained(checkpoint, seed=7, num_steps=2, **options)


def test_a_robot_without_torch_gets_the_chunk_of_the_policy_itself_to_the_bit(checkpoint, tmp_path):
    expected = load(checkpoint).infer(observation())
    with PolicyServer(load(checkpoint), port=0) as server:
        run = [sys.executable, "-c", CLIENT, server.uri, str(tmp_path / "chunk.npz")]
        done = subprocess.run(run, capture_output=True, text=True, timeout=1000, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "[]"
    with np.load(tmp_path / "chunk.npz", allow_pickle=False) as found:
        assert sorted(found) == sorted(expected.arrays())
        assert all(found[name].tobytes() == value.tobytes() for name, value in expected.arrays().items())


def test_real_time_chunking_works_from_afar_to_the_bit(checkpoint):
    local = load(checkpoint, rtc=True)
    first = local.infer(observation())
    prefix = Prefix(first, len(first), 3, 10)
    expected = local.infer_after(observation(0.1), prefix)
    with PolicyServer(load(checkpoint, rtc=True), port=0) as server:
        policy = RemotePolicy.connect(server.uri)
        policy.infer(observation())
        found = policy.infer_after(observation(0.1), prefix)
        policy.close()
    assert all(found.arrays()[name].tobytes() == value.tobytes() for name, value in expected.arrays().items())


def test_a_missing_camera_is_said_by_the_server_in_the_words_of_the_policy(checkpoint):
    with PolicyServer(load(checkpoint), port=0) as server:
        policy = RemotePolicy.connect(server.uri)
        with pytest.raises(RuntimeError, match="the policy was trained with the cameras head, left_wrist, right_wrist"):
            policy.infer(observation(cameras=("head",)))
        policy.close()


def test_a_simulation_without_pictures_shows_grey_to_the_cameras_that_the_server_names(checkpoint):
    with PolicyServer(load(checkpoint), port=0) as server:
        policy = RemotePolicy.connect(server.uri, placeholder_cameras=True)
        assert policy.cameras == dict.fromkeys(("head", "left_wrist", "right_wrist"), (64, 64))
        (warning,) = policy.warnings
        assert "head, left_wrist, right_wrist see grey" in warning.text
        found = policy.infer(observation(cameras=()))
        policy.close()
    expected = load(checkpoint, placeholder_cameras=True).infer(observation(cameras=()))
    assert all(found.arrays()[name].tobytes() == value.tobytes() for name, value in expected.arrays().items())


def test_openpis_client_gets_the_actions_of_the_policy_itself_for_its_images_state_and_prompt(checkpoint):
    at, names = observation(), {"head": "image", "left_wrist": "wrist_image", "right_wrist": "right_wrist"}
    policy = load(checkpoint)
    expected = policy.predict(at)
    with (
        PolicyServer(load(checkpoint), port=0) as server,
        connect(server.uri, compression=None, max_size=None, proxy=None) as client,
    ):
        client.recv(10.0)
        request = {f"observation/{key}": at.images[camera] for camera, key in names.items()}
        request |= {"observation/state": state_numbers(policy.state_spec, at).astype(np.float32), "prompt": at.task}
        client.send(pack(request))
        answer = unpack(client.recv(30.0))
    # The state goes through a posture and back, and the actions through poses.
    np.testing.assert_allclose(answer["actions"], as_poses(expected), atol=1e-4)


def as_poses(actions):
    anchor = Anchor.nominal()
    return encode(builtin("wbc32-v1"), decode(builtin("wbc32-v1"), actions, anchor), anchor)
