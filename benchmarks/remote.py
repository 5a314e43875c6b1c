"""What a policy on another computer costs beside its own time: requests over loopback, for several images.

python benchmarks/remote.py [REQUESTS]
"""

import dataclasses
import os
import subprocess
import sys
from pathlib import Path
from time import process_time

import numpy as np

from policy.action_spec.anchor import Anchor
from policy.observation import Observation
from policy.remote.client import RemotePolicy

SIZES = {"no image": None, "3 x 224 x 224": (224, 224), "3 x 640 x 480": (480, 640), "3 x 1280 x 720": (720, 1280)}
CAMERAS = ("head", "left_wrist", "right_wrist")
SERVE = (
    "import sys; sys.argv[1:] = ['serve-policy', 'wave', '--port', '0']; from wholebody.cli.main import main; main()"
)


def main(requests: int = 200) -> None:
    """Serve a script from another process and ask it."""
    anchor = Anchor.nominal()
    still = Observation(0.0, anchor.q_body, anchor.q_lhand, anchor.q_rhand, anchor.T_world_base, task="wave")
    with subprocess.Popen([sys.executable, "-c", SERVE], stdout=subprocess.PIPE, text=True) as server:
        try:
            policy = RemotePolicy.connect(server.stdout.readline().split()[-1])
            print("| Images | Sent [MB] | Beside the policy's own time, median, 99 % [ms] | CPU of both sides [ms] |")
            print(f"{'|---' * 4}|")
            for name, size in SIZES.items():
                images = {} if size is None else {camera: np.zeros((*size, 3), np.uint8) for camera in CAMERAS}
                before = cpu(server.pid)
                cost = measure(policy, dataclasses.replace(still, images=images), requests)
                busy = 1e3 * (cpu(server.pid) - before) / requests
                sent, worst = sum(image.nbytes for image in images.values()) / 1e6, np.percentile(cost, 99)
                print(f"| {name} | {sent:.1f} | {np.median(cost):.1f}, {worst:.1f} | {busy:.1f} |", flush=True)
            policy.close()
        finally:
            server.terminate()


def measure(policy: RemotePolicy, still: Observation, requests: int) -> np.ndarray:
    """Round trip less the policy's own time, of each request, [ms]."""
    policy.reset()
    cost = []
    for k in range(requests):
        policy.infer(dataclasses.replace(still, time=0.02 * k))
        cost.append(policy.timing["round_trip_ms"] - policy.timing["infer_ms"])
    return np.array(cost[5:])


def cpu(server: int) -> float:
    """CPU time that this process and the server have used, [s]; Linux only."""
    fields = Path(f"/proc/{server}/stat").read_text().rsplit(")", 1)[1].split()
    return process_time() + sum(int(field) for field in fields[11:13]) / os.sysconf("SC_CLK_TCK")


if __name__ == "__main__":
    main(*(int(argument) for argument in sys.argv[1:]))
