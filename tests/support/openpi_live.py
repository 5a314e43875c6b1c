"""openpi's own peers, for an environment of their own (openpi-client needs numpy below 2): `make test-openpi`.

``client URI`` is openpi's client with what its LIBERO example sends, the state read from standard input; it prints what
it got as JSON. ``server [CHECKOUT]`` serves a policy that reads what openpi's LIBERO policy reads, until it is ended;
it prints its address. The server is that of a checkout of openpi, which no package index has, or without one a few
lines around openpi-client's own packing that behave like it. ``record`` prints the request of ``openpi_session.json``.
"""

import asyncio
import base64
import json
import socket
import sys
import traceback
from pathlib import Path

import numpy as np
from openpi_client import base_policy, msgpack_numpy, websocket_client_policy

TASK = "pick up the can"


def example(state, *, side=224):
    """An observation under the keys of openpi's LIBERO example."""
    image = (np.arange(side * side * 3) * 14 % 256).astype(np.uint8).reshape(side, side, 3)
    return {
        "observation/state": np.asarray(state, dtype=np.float32),
        "observation/image": image,
        "observation/wrist_image": image + 1,
        "prompt": TASK,
    }


class Libero(base_policy.BasePolicy):
    """Reads the four keys of LIBERO; its chunk leaves the robot where the state says it is."""

    def infer(self, obs):
        for key in ("observation/image", "observation/wrist_image"):
            if obs[key].shape != (224, 224, 3) or obs[key].dtype != np.uint8:
                raise ValueError(f"{key} is {obs[key].dtype} {obs[key].shape}")
        if not obs["prompt"]:
            raise ValueError("no prompt")
        return {"actions": np.tile(np.asarray(obs["observation/state"], dtype=np.float32), (10, 1))}


class StandIn:
    """Speaks as openpi's server does: metadata first, an answer a request, a traceback as text and the end."""

    def __init__(self, policy, host, port, metadata):
        self.policy, self.host, self.port, self.metadata = policy, host, port, metadata

    def serve_forever(self):
        asyncio.run(self.serve())

    async def serve(self):
        import websockets.asyncio.server as websockets

        async with websockets.serve(self.talk, self.host, self.port, compression=None, max_size=None) as server:
            await server.serve_forever()

    async def talk(self, socket):
        await socket.send(msgpack_numpy.packb(self.metadata))
        async for frame in socket:
            try:
                answer = self.policy.infer(msgpack_numpy.unpackb(frame))
            except Exception:
                await socket.send(traceback.format_exc())
                await socket.close(1011)
                raise
            await socket.send(msgpack_numpy.packb(answer | {"server_timing": {"infer_ms": 0.0}}))


def server(checkout=None):
    kind = StandIn
    if checkout:
        sys.path.insert(0, str(Path(checkout) / "src"))
        from openpi.serving.websocket_policy_server import WebsocketPolicyServer as kind
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    print(f"ws://127.0.0.1:{port} {kind.__name__}", flush=True)
    kind(Libero(), host="127.0.0.1", port=port, metadata={}).serve_forever()


def client(uri):
    policy = websocket_client_policy.WebsocketClientPolicy(host=uri)
    state = json.loads(sys.stdin.read())
    answers = [policy.infer(example(state)) for _ in range(2)]
    said = {"metadata": sorted(policy.get_server_metadata()), "answer": sorted(answers[0])}
    print(json.dumps(said | {"actions": [answer["actions"].tolist() for answer in answers]}))


def record():
    """The request of the recording: a small image, and the state that stands there."""
    state = np.frombuffer(base64.b64decode(sys.stdin.read()), dtype=np.float32)
    small = example(state, side=6) | {"observation/image": _small(0), "observation/wrist_image": _small(1)}
    print(base64.b64encode(msgpack_numpy.packb(small)).decode())


def _small(offset):
    return ((np.arange(2 * 3 * 3) * 14) + offset).astype(np.uint8).reshape(2, 3, 3)


if __name__ == "__main__":
    {"client": client, "server": server, "record": record}[sys.argv[1]](*sys.argv[2:])
