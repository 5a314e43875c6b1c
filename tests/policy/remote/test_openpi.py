"""Names of inputs for openpi's peers, and grey where nobody takes pictures."""

import numpy as np
import pytest

from policy import ObservationError, SpecError
from policy.remote.client import RemotePolicy
from policy.remote.msgpack_numpy import unpack
from policy.remote.openpi import ALOHA, LIBERO, KeyMap
from tests.support.openpi_peer import SERVER, Peer
from tests.support.policy_cases import observation


def test_c4_the_default_keys_are_those_of_liberos_example():
    assert KeyMap.named("") == KeyMap.named("libero") == LIBERO
    assert LIBERO.images == {"head": "observation/image", "left_wrist": "observation/wrist_image"}
    assert (LIBERO.state, LIBERO.prompt, LIBERO.actions) == ("observation/state", "prompt", "actions")
    assert KeyMap.named("aloha") == ALOHA


def test_a_map_names_what_differs_and_null_sends_nothing():
    cameras = '"head": ["images", "cam"], "left_wrist": null, "torso": "observation/torso"'
    keys = KeyMap.named(f'{{{cameras}, "state": "state", "prompt": null}}')
    assert keys.images == {"head": ("images", "cam"), "torso": "observation/torso"}
    assert (keys.state, keys.prompt, keys.actions) == ("state", None, "actions")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("liberro", "no map of keys: libero, aloha, or JSON such as"),
        ('{"head": ', "no map of keys"),
        ("[" * 10**5, "no map of keys"),
        ('["head"]', "JSON list; an object"),
        ('{"head": 3}', "the key of 'head' is 3"),
        ('{"head": []}', r"the key of 'head' is \[\]"),
        ('{"state": null}', "'state' and 'actions'"),
        ('{"actions": ["a", "b"]}', "'state' and 'actions'"),
        ('{"head": "prompt"}', "take each other's place"),
    ],
)
def test_a_map_that_cannot_be_read_is_refused_with_one_that_could(text, says):
    with pytest.raises(SpecError, match=says):
        KeyMap.named(text)


def test_c4_a_run_on_an_openpi_server_sends_images_grey_where_there_are_no_pictures():
    requests = []

    def script(wire):
        wire.send(SERVER["metadata"])
        requests.append(wire.receive())
        wire.send(SERVER["answer"])
        wire.stall()

    with Peer(script) as peer:
        policy = RemotePolicy.connect(peer.uri, assume_spec="wbc32-v1", placeholder_cameras=True, task="tidy up")
        (warning,) = policy.warnings
        assert "head, left_wrist see grey" in warning.sentence
        policy.infer(observation())
        policy.close()
        blind = RemotePolicy.connect(peer.uri, assume_spec="wbc32-v1")
        with pytest.raises(ObservationError, match="no image 'head'"):
            blind.infer(observation())
        blind.close()
    sent = unpack(requests[0])
    assert list(sent) == ["observation/state", "observation/image", "observation/wrist_image", "prompt"]
    assert sent["prompt"] == "tidy up"
    for key in ("observation/image", "observation/wrist_image"):
        assert (sent[key].shape, sent[key].dtype, np.unique(sent[key]).tolist()) == ((224, 224, 3), np.uint8, [128])


def test_no_task_is_no_prompt_so_that_a_servers_default_prompt_counts():
    assert "prompt" not in KeyMap().request(np.zeros(32), {}, "")
