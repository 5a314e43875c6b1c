"""How long it takes from the first import to the first tick; the compile cache is warm (`wholebody warmup`).

    python benchmarks/start.py [--repeats 5] [--check CHUNK.npz]

Elapsed time since the start of the import, and CPU time, in fresh interpreters [s]. With ``--check``, in turn with it,
the same of ``wholebody check`` on a chunk file: until its plans have said what they say, and the first simulated tick.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys

import numpy as np

BEGIN = """
from time import perf_counter, process_time
def now():
    return perf_counter(), process_time()
times = [now()]
"""
END = """
print([[now - begin for now, begin in zip(time, times[0])] for time in times[1:]])
"""
STEPS = ("import wholebody", "modules", "robot and controller", "first tick")
LOOP = """
import wholebody
times.append(now())
import numpy as np
from models import g1
from models.pinocchio_model import stance_q
from wholebody.execution.supervisor import Supervisor
from wholebody.types import RobotState
times.append(now())
spec = g1()
supervisor = Supervisor(spec)
times.append(now())
state = RobotState(0.0, stance_q(spec, supervisor.robot.model), np.zeros(supervisor.robot.nv))
supervisor.reset(state)
supervisor.step(state)
times.append(now())
"""
CHECK_STEPS = ("check: its command", "check: fast answer", "check: first simulated tick")
CHECK = """
from contextlib import contextmanager
import wholebody.cli.main
from wholebody.cli import judging
from wholebody.cli.options import Input, Judging, Sampling, Simulation
times.append(now())
class Simulated(Exception):
    pass
def stop(time, end):
    times.append(now())
    raise Simulated
@contextmanager
def progress_bar(*_, **__):
    yield stop
def timed(judge, policy, name):
    answer = fast_verdict(judge, policy, name)
    times.append(now())
    return answer
fast_verdict, judging.progress_bar = judging.InputJudge._fast_verdict, progress_bar
judging.InputJudge._fast_verdict = timed
judging._sentence = lambda *_: None
judging.InputJudge(Input(), Simulation(), Sampling(), Judging(), quiet=True).answer(FILE)
"""


def main() -> None:
    """Print a table in Markdown."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--check", default="", metavar="CHUNK.npz")
    chosen = parser.parse_args()
    programs = [(STEPS, LOOP)]
    if chosen.check:
        programs.append((CHECK_STEPS, f"FILE = {chosen.check!r}\n{CHECK}"))
    # In turn, so that both see the same load.
    runs = [[_run(program) for _, program in programs] for _ in range(chosen.repeats)]
    print("| Until | median | least | most | CPU time, median |\n|---|---|---|---|---|")
    for k, (steps, _) in enumerate(programs):
        spent = np.array([run[k] for run in runs])
        for i, name in enumerate(steps):
            times, cpu = spent[:, i].T
            print(f"| {name} | {np.median(times):.3f} | {times.min():.3f} | {times.max():.3f} | {np.median(cpu):.3f} |")


def _run(program: str) -> list[list[float]]:
    """Elapsed and CPU time until each step [s]."""
    command = [sys.executable, "-W", "ignore", "-c", BEGIN + program + END]
    return json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)


if __name__ == "__main__":
    main()
