"""What a policy on another computer costs beside its own time: requests over loopback, for several images.

python benchmarks/remote.py [REQUESTS]
"""

import dataclasses
import subprocess
import sys

import numpy as np

from policy.anchor import Anchor
from policy.observation import Observation
from policy.remote import RemotePolicy

SIZES = {"no image": None, "3 x 224 x 224": (224, 224), "3 x 640 x 480": (480, 640), "3 x 1280 x 720": (720, 1280)}
CAMERAS = ("head", "left_wrist", "right_wrist")
SERVE = "import sys; sys.argv[1:] = ['serve-policy', 'wave', '--port', '0']; from wholebody.cli import main; main()"


def main(requests: int = 200) -> None:
    """Serve a script from another process and ask it."""
    anchor = Anchor.nominal()
    still = Observation(0.0, anchor.q_body, anchor.q_lhand, anchor.q_rhand, anchor.T_world_base, task="wave")
    with subprocess.Popen([sys.executable, "-c", SERVE], stdout=subprocess.PIPE, text=True) as server:
        try:
            policy = RemotePolicy.connect(server.stdout.readline().split()[-1])
            print(f"| Images | Sent [MB] | Beside the policy's own time, median [ms] | 99 % [ms] |\n{'|---' * 4}|")
            for name, size in SIZES.items():
                images = {} if size is None else {camera: np.zeros((*size, 3), np.uint8) for camera in CAMERAS}
                cost = measure(policy, dataclasses.replace(still, images=images), requests)
                sent = sum(image.nbytes for image in images.values()) / 1e6
                print(f"| {name} | {sent:.1f} | {np.median(cost):.1f} | {np.percentile(cost, 99):.1f} |", flush=True)
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


if __name__ == "__main__":
    main(*(int(argument) for argument in sys.argv[1:]))
