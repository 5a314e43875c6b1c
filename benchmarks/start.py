"""How long it takes from the first import to the first tick; the compile cache is warm (`wholebody warmup`).

    python benchmarks/start.py [--repeats 5]

Elapsed time since the start of the import, in fresh interpreters [s].
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys

import numpy as np

STEPS = ("import wholebody", "modules", "robot and controller", "first tick")

ONCE = """
from time import perf_counter
times = [perf_counter()]
import wholebody
times.append(perf_counter())
import numpy as np
from models import g1
from models.pinocchio_model import stance_q
from wholebody.execution.supervisor import Supervisor
from wholebody.types import RobotState
times.append(perf_counter())
spec = g1()
supervisor = Supervisor(spec)
times.append(perf_counter())
state = RobotState(0.0, stance_q(spec, supervisor.robot.model), np.zeros(supervisor.robot.nv))
supervisor.reset(state)
supervisor.step(state)
times.append(perf_counter())
print([time - times[0] for time in times[1:]])
"""


def main() -> None:
    """Print a table in Markdown."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=5)
    runs = [_run() for _ in range(parser.parse_args().repeats)]
    print("| Until | median | least | most |\n|---|---|---|---|")
    for name, times in zip(STEPS, np.array(runs).T, strict=True):
        print(f"| {name} | {np.median(times):.3f} | {times.min():.3f} | {times.max():.3f} |")


def _run() -> list[float]:
    answer = subprocess.run([sys.executable, "-W", "ignore", "-c", ONCE], capture_output=True, text=True, check=True)
    return json.loads(answer.stdout)


if __name__ == "__main__":
    main()
