"""What the page of `wholebody live` gets and how soon it acts: a bare websocket client watches and drags the left palm.

    python benchmarks/page.py [--drags 20]

Prints how often a picture came, how long after a drag was sent its palm had moved by 2 mm, and what the loop
says of its ticks meanwhile.
"""

from __future__ import annotations

import argparse
import json
import re
import signal
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from time import monotonic

import msgspec
import numpy as np
from websockets.sync.client import ClientConnection

sys.path.insert(0, str(Path(__file__).parents[1]))
from tests.support.page_watcher import HANDLE, PALM, connected, messages

WAY, PAUSE, MOVED = 0.05, (1.5, 2.5), 0.002
"""How far a drag goes [m], least and longest time between two [s], drawn for each, and what counts as moved [m]."""


def main() -> None:
    """Print the numbers."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--drags", type=int, default=20)
    drags = parser.parse_args().drags
    with TemporaryDirectory() as folder:
        told = Path(folder) / "told.json"
        arguments = [sys.executable, "-c", "from wholebody.cli.main import main; main()", "live", "--json", str(told)]
        process = subprocess.Popen(arguments, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
        address = next(found[0] for line in process.stderr if (found := re.search(r"//[\d.]+:\d+", line)))
        asked = monotonic()
        with connected(address) as page:
            updates, latencies = _watch(page, drags)
        process.send_signal(signal.SIGINT)
        process.communicate()
        loop = json.loads(told.read_text())["loop"]
    seconds = updates[-1] - updates[0]
    print(f"first picture, with all that is drawn before it: {updates[0] - asked:.2f} s after the page was asked for")
    print(f"pictures: {len(updates) / seconds:.1f} a second over {seconds:.0f} s")
    ms = 1e3 * np.array(latencies)
    print(f"drag to {1e3 * MOVED:g} mm of palm: median {np.median(ms):.0f} ms, longest {ms.max():.0f}, {len(ms)} drags")
    print(f"loop: {loop['ticks']} ticks, {loop['missed_ticks']} missed, {loop['gaps']} gaps above 4 ms")


def _watch(page: ClientConnection, drags: int) -> tuple[list[float], list[float]]:
    """Times of pictures [s], and how long it took to move after each drag [s]."""
    updates: list[float] = []
    latencies: list[float] = []
    handle, turned, palm, sent = None, None, None, None
    following, rng = monotonic() + 10.0, np.random.default_rng(0)
    while len(latencies) < drags:
        frame, now = messages(page.recv()), monotonic()
        # A robot that stands still moves by less than a number on the wire; its centre of mass is in every picture.
        if any(message["type"] == "SetPositionMessage" for message in frame):
            updates.append(now)
        for message in frame:
            if message.get("name") == HANDLE and message["type"] == "SetPositionMessage":
                handle = np.array(message["position"])
            if message.get("name") == HANDLE and message["type"] == "SetOrientationMessage":
                turned = message["wxyz"]
            if message.get("name") == PALM and message["type"] == "SetPositionMessage":
                palm = np.array(message["position"])
                if sent is not None and np.linalg.norm(palm - sent[1]) > MOVED:
                    latencies.append(now - sent[0])
                    sent = None
        if now > following and sent is None:
            following = now + rng.uniform(*PAUSE)
            handle = handle + np.array([0.0, 0.0, WAY if len(latencies) % 2 == 0 else -WAY])
            page.send(_drag(handle, turned))
            sent = (now, palm)
    return updates, latencies


def _drag(position: np.ndarray, wxyz: list[float]) -> bytes:
    message = {"type": "TransformControlsUpdateMessage", "name": HANDLE, "wxyz": wxyz, "owner": ""}
    return msgspec.msgpack.encode(message | {"position": position.tolist()})


if __name__ == "__main__":
    main()
