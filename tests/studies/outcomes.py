"""Chunks of many kinds, what the fast check says of each, and what becomes of it in MuJoCo: what odds are fitted to.

``python -m tests.studies.outcomes --cases 0 100 --out outcomes.jsonl`` adds a line a case to the file; those that it
has already are left out, so an interrupted run goes on where it was. Several ``--cases`` are done side by side, so that
the file has a share of each at any time. Cases are those of `tests.support.outcome_cases`: hostile families, scripts,
random places, noise, chunks that come in the midst of another one and, where G1_MOTIONS names a folder, chunks of
recorded motions, each begun with the hands at its first step or in the stance, in the true world or a realistic one
with a seed of its own. Nothing is fitted here.

A case is followed no longer than until its outcome is decided (`tests.support.outcome_runs`). ``--full`` simulates
until 4 s after the last step, or the fall. ``--timestep 0.001`` does the same cases with a shorter physics step,
``--draw 1`` the realistic ones in another realistic world: where the answer differs, no prediction can be right.

A line has the family, the group that must not be split (clip, script and seed, else the case), the quantities of
`wholebody.verdict.calibration`, and of each way to follow the chunk whether the robot fell, until 4 s after the last
step or at rest, and whether both palms were within 20 mm of every step that is due once a plan may be there.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
from collections import Counter
from dataclasses import asdict, replace
from pathlib import Path
from time import process_time

from tests.support.outcome_cases import Case, outcome_case
from tests.support.outcome_lines import read_lines
from tests.support.outcome_runs import run_case
from wholebody.sim.plant import MujocoPlant
from wholebody.sim.robot_errors import REALISTIC_ROBOT, RealisticPlant
from wholebody.sim.sensors import REALISTIC_READINGS, Sensors
from wholebody.types import RobotState
from wholebody.verdict.calibration.quantities import quantities
from wholebody.verdict.check import TIMESTEP, Checker
from wholebody.verdict.fast import FastChecker

FOLLOWS = ("as_given", "planned")
DRAWS = 1_000_000
"""What lies between the seeds of two realistic worlds for the same case."""


class Worlds:
    """The true world and realistic ones, with a physics step [s], and what follows chunks there."""

    def __init__(self, timestep: float = TIMESTEP) -> None:
        self._timestep, self._checkers = (
            timestep,
            {follow: Checker(follow=follow, timestep=timestep) for follow in FOLLOWS},
        )
        self._spec, self._dt = self._checkers["planned"].supervisor.spec, self._checkers["planned"].supervisor.config.dt
        self._estimating = Checker(follow="as_given", errors=REALISTIC_ROBOT, sensors=REALISTIC_READINGS).sensors
        self._true: MujocoPlant = self._checkers["planned"].plant

    def checkers(self, world: str, seed: int) -> dict[str, Checker]:
        """By how a chunk is followed, in one and the same world."""
        plant, sensors = self._true, None
        if world == "realistic":
            readings, errors = replace(REALISTIC_READINGS, seed=seed), replace(REALISTIC_ROBOT, seed=seed)
            sensors = Sensors(self._spec, readings, self._dt, self._estimating.estimator)
            plant = RealisticPlant(self._spec, errors, encoders=sensors, control_dt=self._dt, timestep=self._timestep)
        for checker in self._checkers.values():
            checker.plant, checker.sensors = plant, sensors
        return self._checkers


def line_of(case: Case, fast: FastChecker, worlds: Worlds, *, draw: int = 0, whole: bool = False) -> dict:
    """What the fast check says of a chunk, and what becomes of it."""
    judge, began = fast.judge, process_time()
    begin = at = judge.stance() if case.start == "stance" else judge.first_pose(case.before or case.chunk)
    if case.before is not None:
        at = judge.later(judge.judge(case.before, begin).plan, case.begins)
    found = judge.judge(case.chunk, at)
    line = {name: getattr(case, name) for name in ("family", "group", "start", "world", "begins")}
    line |= {"steps": len(case.chunk), "fps": case.chunk.fps, "strategy": found.plan.report.strategy}
    numbers = quantities(judge, case.chunk, at, found)
    line["quantities"] = {name: float(f"{value:.5g}") for name, value in numbers.items()}
    line["fast_s"] = round(process_time() - began, 3)
    for follow, checker in worlds.checkers(case.world, case.number + DRAWS * draw).items():
        line[follow] = asdict(run_case(checker, case, RobotState(0.0, begin.body.q, begin.body.v), whole=whole))
    return line | {"cpu_s": round(process_time() - began, 2)}


def revision() -> str:
    """Of the code that runs."""
    said = subprocess.run(("git", "rev-parse", "--short", "HEAD"), capture_output=True, text=True, check=False)
    return said.stdout.strip()


def main() -> None:
    """Run what is not in the file yet, and count."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, nargs=2, action="append", required=True, metavar=("FIRST", "END"))
    parser.add_argument("--out", type=Path, required=True, help="a line of JSON for each case")
    parser.add_argument("--known", type=Path, help="outcomes of another file that need not be done once more")
    parser.add_argument("--full", action="store_true", help="until 4 s after the last step, or the fall")
    parser.add_argument("--draw", type=int, default=0, help="another realistic world for each case")
    parser.add_argument("--timestep", type=float, default=TIMESTEP, help="physics step [s]")
    chosen, motions = parser.parse_args(), os.environ.get("G1_MOTIONS", "")
    lines = [json.loads(line) for line in chosen.out.read_text().splitlines()] if chosen.out.exists() else []
    known = [] if chosen.known is None else read_lines(chosen.known)
    done = {line["case"] for line in lines} | {line["case"] for line in known if line["draw"] == chosen.draw}
    fast, worlds, run = FastChecker(), Worlds(chosen.timestep), revision()
    share = {n: (n - first) / (end - first) for first, end in chosen.cases for n in range(first, end)}
    for number in sorted(share.keys() - done, key=share.get):
        case = outcome_case(number, motions)
        if chosen.draw and case.world == "true":
            continue
        line = line_of(case, fast, worlds, draw=chosen.draw, whole=chosen.full)
        line = {"case": number, "draw": chosen.draw, "revision": run} | line
        lines.append(line)
        with chosen.out.open("a") as file:
            file.write(json.dumps(line) + "\n")
    for family in sorted({line["family"] for line in lines}):
        mine = [line for line in lines if line["family"] == family]
        fell = Counter(follow for line in mine for follow in FOLLOWS if line[follow]["fell"])
        followed, spent = sum(line["planned"]["followed"] for line in mine), sum(line["cpu_s"] for line in mine)
        said = ", ".join(f"{follow} {fell[follow]} fell" for follow in FOLLOWS)
        late = sum(1 for line in mine for follow in FOLLOWS if line[follow]["fell"] and line[follow]["rest_s"])
        print(f"{family}: {len(mine)} chunks, {spent:.0f} s; {said}, {late} after a rest; {followed} followed")


if __name__ == "__main__":
    main()
