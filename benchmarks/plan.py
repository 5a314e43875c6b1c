"""How long the plan of a chunk takes, over scripts and hostile chunks, in the closed loop with MuJoCo.

    python benchmarks/plan.py [--seeds 0 1 7] [--seconds 6] [--motions FOLDER] [--measured]

Thread CPU time; work is what `planning.budget` counts. With `--measured` a plan is cut by its own CPU time too, as
beside a loop on the wall clock, and the last line says how much of what it was given the slowest one took.
A chunk takes one trajectory, or several where it is too fast or out of reach. The second table has
the parts of a linearisation, and the step [us a knot]. After it is the time of one
`pinocchio.computeRNEADerivatives` of the same robot [us], to compare machines by.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from time import thread_time

import numpy as np
import pinocchio as pin

sys.path.insert(0, str(Path(__file__).parents[1]))

from models import g1
from policy.recorded.replay import open_recording
from policy.scripted.library import lissajous, reach, wave
from tests.support.hostile_chunks import FAMILIES, Episode
from wholebody.config import ControllerConfig
from wholebody.episode.run import run_episode
from wholebody.execution.supervisor import Supervisor
from wholebody.planning.chunk_planner import ChunkPlanner
from wholebody.sim.plant import MujocoPlant
from wholebody.trajopt import entry_points
from wholebody.trajopt.optimizer import TrajectoryOptimizer
from wholebody.trajopt.problem import TrajectoryProblem
from wholebody.trajopt.workspace import KnotMotion
from wholebody.verdict.check import Checker

HEADINGS = (
    "Motion", "chunks", "ms a chunk: median", "max", "plans a chunk", "knots", "ms a plan: median", "max",
    "linearisations a plan", "ms each", "ms a step", "work a chunk: median", "max",
)  # fmt: skip
CPU_LIMIT = 5
"""Which argument of `ChunkPlanner.plan` says how much time it has."""
PARTS = ("place", "measure", "describe", "rates", "assemble", "step")


class Parts:
    """Times of the compiled parts of a plan, per knot."""

    def __init__(self) -> None:
        self.of: dict[str, list[float]] = {}
        for name in PARTS:
            setattr(entry_points, name, self._timed(name, getattr(entry_points, name)))

    def _timed(self, name: str, entry: Callable) -> Callable:
        def timed(*arguments: object) -> object:
            begin = thread_time()
            answer = entry(*arguments)
            knots = next(one.q.shape[0] for one in arguments if isinstance(one, KnotMotion))
            if not (name == "place" and arguments[-1] - arguments[-2] == 1):  # one knot of the first motion
                self.of.setdefault(name, []).append(1e6 * (thread_time() - begin) / knots)
            return answer

        return timed

    def cells(self) -> list[str]:
        """Mean of each part, and begin anew."""
        means = [f"{np.mean(self.of.get(name, [np.nan])):.0f}" for name in PARTS]
        self.of.clear()
        return means


class Times:
    """Times of all calls of some methods."""

    def __init__(self, *methods: tuple[type, str]) -> None:
        self.of: dict[str, list[float]] = {}
        self.knots: list[int] = []
        self.work: list[float] = []
        self.share: list[float] = []
        for owner, name in methods:
            setattr(owner, name, self._timed(f"{owner.__name__}.{name}", getattr(owner, name)))

    def _timed(self, label: str, call: Callable) -> Callable:
        def timed(owner: object, *arguments: object, **options: object) -> object:
            begin = thread_time()
            answer = call(owner, *arguments, **options)
            self.of.setdefault(label, []).append(1e3 * (thread_time() - begin))
            if label == "TrajectoryOptimizer.plan":
                self.knots.append(len(arguments[2]))
            if label == "ChunkPlanner.plan":
                self.work.append(answer.report.work)
                self.share.append(self.of[label][-1] / (1e3 * arguments[CPU_LIMIT]))
            return answer

        return timed

    def row(self, name: str) -> list[str]:
        """Cells of the table, and begin anew."""
        chunks, plans, linear, steps = (
            np.array(self.of.get(label, [np.nan]))
            for label in (
                "ChunkPlanner.plan",
                "TrajectoryOptimizer.plan",
                "TrajectoryProblem.linearise",
                "TrajectoryProblem.step",
            )
        )
        cells = [
            name, f"{len(chunks)}", f"{np.median(chunks):.0f}", f"{chunks.max():.0f}",
            f"{len(plans) / len(chunks):.1f}", f"{np.mean(self.knots):.0f}", f"{np.median(plans):.0f}",
            f"{plans.max():.0f}", f"{len(linear) / len(plans):.1f}", f"{np.mean(linear):.1f}", f"{np.mean(steps):.1f}",
            f"{np.median(self.work):.0f}", f"{np.max(self.work):.0f}",
        ]  # fmt: skip
        self.of.clear()
        self.knots.clear()
        self.work.clear()
        return cells


def motions(folder: Path, times: Times, model: pin.Model, config: ControllerConfig) -> None:
    """Print how long plans of recorded motions take, also in units timed beside each, and as a share of their check."""
    checker, rows, every, work, checks = Checker(config=config), [], [], [], 0.0
    planning = checker.supervisor.config.planning
    print("\n| Recorded motion | chunks | ms a chunk: median | max | units: median | work: max | share of the check |")
    print(f"|{'---|' * 7}")
    for file in sorted(folder.glob("*.csv")):
        policy = open_recording(file)
        begin = thread_time()
        checker.check(policy, file.stem, policy.duration)
        took, ms = 1e3 * (thread_time() - begin), np.array(times.of["ChunkPlanner.plan"])
        checks += took
        every.extend(ms)
        work.extend(times.work)
        units = 1e3 * np.median(ms) / yardstick(model)
        cells = np.median(ms), ms.max(), units, max(times.work), 100.0 * ms.sum() / took
        times.row(file.stem)
        rows.append(cells)
        print(f"| {file.stem} | {len(ms)} | {' | '.join(f'{x:.0f}' for x in cells)} % |", flush=True)
    whole, within, lead = np.median(rows, axis=0), np.array(work) <= planning.budget, 1e3 * planning.lead
    print("\n| Over all motions | measured | bar |\n|---|---|---|")
    print(f"| chunk, in units: median of the medians | {whole[2]:.0f} | 2500 |")
    shares = 100.0 * sum(every) / checks, whole[4], max(row[4] for row in rows)
    print(f"| share of a check: all together, median, largest | {', '.join(f'{x:.0f}' for x in shares)} % | 40 % |")
    print(f"| work within its budget of {planning.budget:.0f} | {100.0 * within.mean():.1f} % | 100 % |")
    print(f"| work of a chunk: 95 %, largest | {np.quantile(work, 0.95):.0f}, {max(work):.0f} | |")
    print(f"| within the lead of {lead:.0f} ms of CPU time | {100.0 * np.mean(np.array(every) <= lead):.1f} % | |")
    print(f"| ms a chunk: 95 %, largest | {np.quantile(every, 0.95):.0f}, {max(every):.0f} | |")


def main() -> None:
    """Print a table in Markdown."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--seeds", type=int, nargs="*", default=[0, 1, 5, 6, 7], help="cases of tests/support/hostile_chunks.py"
    )
    parser.add_argument("--seconds", type=float, default=6.0, help="of each script")
    parser.add_argument("--measured", action="store_true", help="cut plans by their CPU time")
    parser.add_argument("--motions", type=Path, help="folder of recorded motions, which are checked one by one")
    options, spec = parser.parse_args(), g1()
    config = ControllerConfig()
    if options.measured:
        config = replace(config, planning=replace(config.planning, latency="measured"))
    supervisor, plant = Supervisor(spec, config), MujocoPlant(spec)
    Episode(supervisor, plant, 10).feasible()  # compiles
    times = Times(
        (ChunkPlanner, "plan"), (TrajectoryOptimizer, "plan"),
        (TrajectoryProblem, "linearise"), (TrajectoryProblem, "step"),
    )  # fmt: skip
    parts = Parts()
    print(f"| {' | '.join(HEADINGS)} |\n|{'---|' * len(HEADINGS)}")
    scripts = {
        "lissajous": lissajous(),
        "reach high": reach(0.25, 1.5),
        "reach low": reach(0.4, 0.3),
        "reach": reach(0.45, 0.6),
        "wave": wave(),
    }
    for name, policy in scripts.items():
        run_episode(policy, supervisor, plant, duration=options.seconds)
        print(f"| {' | '.join(times.row(name))} |", flush=True)
    plain = parts.cells()
    for seed in options.seeds:
        Episode(supervisor, plant, seed).run()
        print(f"| {' | '.join(times.row(f'hostile: {list(FAMILIES)[seed % len(FAMILIES)]}'))} |", flush=True)
    print("\n| Part, us a knot | scripts | hostile |\n|---|---|---|")
    for row in zip(PARTS, plain, parts.cells(), strict=True):
        print(f"| {' | '.join(row)} |")
    model = supervisor.planner.optimizer.body.model
    print(f"\ncomputeRNEADerivatives: {yardstick(model):.1f} us")
    if options.motions:
        motions(options.motions, times, model, config)
    if options.measured:
        plans, most = len(times.share), 100.0 * max(times.share)
        print(f"\nof the CPU time that it was given, the slowest of {plans} plans took {most:.0f} %")


def yardstick(model: pin.Model) -> float:
    """Time of a known computation on this machine [us]."""
    data, q, v = model.createData(), pin.neutral(model), np.zeros(model.nv)
    times = []
    for _ in range(2000):
        begin = thread_time()
        pin.computeRNEADerivatives(model, data, q, v, v)
        times.append(1e6 * (thread_time() - begin))
    return float(np.median(times))


if __name__ == "__main__":
    main()
