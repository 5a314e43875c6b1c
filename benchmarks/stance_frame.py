"""What a target that is repeated does in the measured pelvis and in the stance: for `docs/policy_contract.md`.

    python benchmarks/stance_frame.py [--held SECONDS] [--every STEPS ...] [--layouts NAME ...]

Both palms reach low ahead (x 0.40, z 0.30 m), which brings the pelvis down and tilts it; then the numbers of the place
where they arrive are decoded anew at each observation. Printed: how far a palm is from where it was after 1, 4,
10 and 60 s.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from models import g1
from policy import builtin
from tests.support.repeated_target import drift
from wholebody.execution.supervisor import Supervisor
from wholebody.sim.plant import MujocoPlant

AFTER = (1.0, 4.0, 10.0, 60.0)
"""When the drift is looked at [s]."""


def main() -> None:
    """Print a line for each layout and rate."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--held", type=float, default=10.0)
    parser.add_argument("--every", type=int, nargs="*", default=[12])
    parser.add_argument("--layouts", nargs="*", default=["wbc32-v1", "wbc32"])
    given = parser.parse_args()
    supervisor, plant = Supervisor(g1()), MujocoPlant(g1())
    for every in given.every:
        for name in given.layouts:
            result, times, away = drift(builtin(name), supervisor, plant, held=given.held, every=every)
            found = [float(np.interp(after, times, away)) for after in AFTER if after <= times[-1] + 0.1]
            said = "  ".join(f"{after:g} s {1e3 * x:.2f} mm" for after, x in zip(AFTER, found, strict=False))
            fall = "stands" if result.fall is None else f"falls at {result.fall.time:.1f} s"
            print(f"{builtin(name).id:<24} a chunk every {every / 30.0:.2f} s: {said}; {fall}", flush=True)


if __name__ == "__main__":
    main()
