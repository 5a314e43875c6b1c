"""Chunks, what the fast check says of each, and what becomes of it in MuJoCo: what a probability can be fitted to.

``python -m tests.studies.outcomes --cases 0 100 --out outcomes.jsonl`` adds a line a case to the file; those that it
has already are left out, so an interrupted run goes on where it was. Cases are those of `tests.support.outcome_cases`:
hostile families, scripts, random places, noise and, where G1_MOTIONS names a folder, chunks of recorded motions, each
begun with the hands at its first step or in the stance, in the true world or a realistic one with a seed of its own.
``--full`` simulates until 4 s after the last step also where the robot is at rest before that, and says in each line
since when it was, which shows whether anything happens afterwards. ``--timestep 0.001`` does the same cases with a
shorter physics step: where the answer differs, no prediction can be right. Nothing is fitted here.

A line has the family, the group that must not be split (clip, script and seed, else the case), the quantities of
`wholebody.verdict.calibration`, and of each way to follow the chunk whether the robot fell, until 4 s after the last
step or at rest for `STILL`, and whether both palms were within 20 mm of every step that
is due once a plan may be there.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
from collections import Counter
from dataclasses import replace
from pathlib import Path
from time import process_time

import numpy as np

from tests.support.outcome_cases import Case, outcome_case
from wholebody.sim.plant import MujocoPlant
from wholebody.sim.robot_errors import REALISTIC_ROBOT, RealisticPlant
from wholebody.sim.sensors import REALISTIC_READINGS, Sensors
from wholebody.types import RobotState
from wholebody.verdict.calibration.quantities import quantities
from wholebody.verdict.check import TIMESTEP, Checker
from wholebody.verdict.fast import FastChecker
from wholebody.verdict.trial import Outcome, run_chunk

FOLLOWS = ("as_given", "planned")
FOLLOWED = 0.02
"""Distance of a palm from a step up to which it is followed [m]; definition."""
STILL, SLOW, LOOK = 0.5, (0.02, 0.05, 0.15), 0.02
"""How long [s] pelvis [m/s], [rad/s] and joints [rad/s] are slow until a robot is at rest, looked at so often [s]."""


class AtRest:
    """Whether a robot has been slow for `STILL`; `since` when [s]."""

    def __init__(self, until: float = STILL) -> None:
        self.since, self._until, self._slow, self._next = None, until, None, 0.0

    def __call__(self, state: RobotState) -> bool:
        if state.time < self._next:
            return False
        self._next = state.time + LOOK - 1e-9
        parts = state.v[:3], state.v[3:6], state.v[6:]
        slow = all(np.abs(part).max() < bound for part, bound in zip(parts, SLOW, strict=True))
        self._slow = (self._slow or state.time) if slow else None
        at_rest = slow and state.time > self._slow + STILL
        if at_rest and self.since is None:
            self.since = state.time
        return at_rest and state.time > self._slow + self._until


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


def outcome(found: Outcome, rest: AtRest, due: int) -> dict:
    """What a line says of one way to follow a chunk of which so many steps are due once it may be planned."""
    errors = found.errors
    worst = float(errors.max()) if len(errors) else None
    kept = not found.fell and len(errors) >= due and worst <= FOLLOWED
    return {
        "fell": found.fell,
        "time": found.time,
        "cause": found.cause,
        "worst_m": worst,
        "rms_m": float(np.sqrt((errors**2).mean())) if len(errors) else None,
        "turn_rad": float(found.turns.max()) if len(errors) else None,
        "steps": len(errors),
        "followed": bool(kept),
        "rest_s": rest.since,
    }


def line_of(case: Case, fast: FastChecker, worlds: Worlds, *, full: bool = False) -> dict:
    """What the fast check says of a chunk, and what becomes of it."""
    judge, began = fast.judge, process_time()
    begin = judge.stance() if case.start == "stance" else judge.first_pose(case.chunk)
    found = judge.judge(case.chunk, begin)
    line = {name: getattr(case, name) for name in ("family", "group", "start", "world")}
    line |= {"steps": len(case.chunk), "fps": case.chunk.fps, "strategy": found.plan.report.strategy}
    numbers = quantities(judge, case.chunk, begin, found)
    line["quantities"] = {name: float(f"{value:.5g}") for name, value in numbers.items()}
    line["fast_s"] = round(process_time() - began, 3)
    for follow, checker in worlds.checkers(case.world, case.number).items():
        rest = AtRest(np.inf if full else STILL)
        one = run_chunk(checker, case.chunk, RobotState(0.0, begin.body.q, begin.body.v), settled=rest)
        lead = checker.supervisor.config.planning.lead
        line[follow] = outcome(one, rest, len(case.chunk) - int(lead * case.chunk.fps) - 2)
    return line | {"cpu_s": round(process_time() - began, 2)}


def revision() -> str:
    """Of the code that runs."""
    said = subprocess.run(("git", "rev-parse", "--short", "HEAD"), capture_output=True, text=True, check=False)
    return said.stdout.strip()


def main() -> None:
    """Run what is not in the file yet, and count."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, nargs=2, default=(0, 100), metavar=("FIRST", "END"))
    parser.add_argument("--out", type=Path, required=True, help="a line of JSON for each case")
    parser.add_argument("--full", action="store_true", help="until 4 s after the last step also where it is at rest")
    parser.add_argument("--timestep", type=float, default=TIMESTEP, help="physics step [s]")
    chosen, motions = parser.parse_args(), os.environ.get("G1_MOTIONS", "")
    lines = [json.loads(line) for line in chosen.out.read_text().splitlines()] if chosen.out.exists() else []
    done, fast, worlds, run = {line["case"] for line in lines}, FastChecker(), Worlds(chosen.timestep), revision()
    for number in range(*chosen.cases):
        if number in done:
            continue
        line = {"case": number, "revision": run} | line_of(
            outcome_case(number, motions), fast, worlds, full=chosen.full
        )
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
