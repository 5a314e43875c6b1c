"""Chunks, what the fast check says of each, and what becomes of it in MuJoCo: what a probability can be fitted to.

``python -m tests.studies.outcomes --cases 0 100 --out outcomes.jsonl`` adds a line a case and world to the file; lines
that it has already are left out, so an interrupted run goes on where it was. Cases are those of
`tests.support.verdict_agreement`: hostile families, hands sent to random places and, where G1_MOTIONS names a folder,
chunks of recorded motions. Worlds are ``true``, and ``realistic`` with an own seed a case. Nothing is fitted here.

A line has the family, the group that must not be split (the clip of a recorded motion, else the case), the least room
to each kind of bound in the fast check's terms, and of each way to follow the chunk whether the robot fell, until 4 s
after the last step, and whether both palms were within 20 mm of every step.
"""

from __future__ import annotations

import argparse
import json
import os
from collections import Counter
from dataclasses import replace
from pathlib import Path
from time import process_time

import numpy as np

from policy.chunk import ActionChunk
from tests.support.verdict_agreement import case
from wholebody.sim.robot_errors import REALISTIC_ROBOT
from wholebody.sim.sensors import REALISTIC_READINGS
from wholebody.types import RobotState
from wholebody.verdict.check import Checker
from wholebody.verdict.fast import FastChecker
from wholebody.verdict.trial import run_chunk

FOLLOWS = ("as_given", "planned")
FOLLOWED = 0.02
"""Distance of a palm from a step up to which it is followed [m]; definition."""


def group(number: int, family: str, motions: str) -> str:
    """What belongs to one side of a split: the clip, which is what the case's seed draws first, else the case."""
    if family != "recorded":
        return f"case {number}"
    return Path(np.random.default_rng(number).choice(sorted(map(str, Path(motions).glob("*.csv"))))).stem


def checkers(world: str, number: int) -> dict[str, Checker]:
    """A plant and what follows a chunk in it, by the way in which it does."""
    if world == "true":
        return {follow: Checker(follow=follow) for follow in FOLLOWS}
    errors, readings = (replace(one, seed=number) for one in (REALISTIC_ROBOT, REALISTIC_READINGS))
    return {follow: Checker(follow=follow, errors=errors, sensors=readings) for follow in FOLLOWS}


def outcomes(fast: FastChecker, by_follow: dict[str, Checker], chunk: ActionChunk) -> dict:
    """What the fast check says of a chunk that begins in the stance, and what becomes of it there."""
    begin = fast.judge.stance()
    verdict = fast.of_chunk(chunk, begin, "", (False, False))
    line = {
        "verdict": verdict.verdict,
        "moved_m": verdict.moved_max_m,
        "turned_rad": verdict.moved_turn_max_rad,
        "time_factor": verdict.time_factor,
        "room": {one.code: round(one.share, 4) for one in verdict.margins},
    }
    for follow, checker in by_follow.items():
        found = run_chunk(checker, chunk, RobotState(0.0, begin.body.q, begin.body.v))
        worst = float(found.errors.max()) if len(found.errors) else None
        kept = not found.fell and worst is not None and worst <= FOLLOWED
        line[follow] = {"fell": found.fell, "time": found.time, "worst_m": worst, "followed": kept}
    return line


def main() -> None:
    """Run what is not in the file yet, and count."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, nargs=2, default=(0, 100), metavar=("FIRST", "END"))
    parser.add_argument("--worlds", nargs="*", choices=("true", "realistic"), default=["true", "realistic"])
    parser.add_argument("--out", type=Path, required=True, help="a line of JSON for each case and world")
    chosen, motions = parser.parse_args(), os.environ.get("G1_MOTIONS", "")
    lines = [json.loads(line) for line in chosen.out.read_text().splitlines()] if chosen.out.exists() else []
    done = {(line["case"], line["world"]) for line in lines}
    fast, true = FastChecker(), checkers("true", 0)
    for number in range(*chosen.cases):
        family, chunk = case(number, motions)
        for world in chosen.worlds:
            if (number, world) in done:
                continue
            began = process_time()
            line = {"case": number, "world": world, "family": family, "group": group(number, family, motions)}
            line |= outcomes(fast, true if world == "true" else checkers(world, number), chunk)
            line["cpu_s"] = round(process_time() - began, 2)
            lines.append(line)
            with chosen.out.open("a") as file:
                file.write(json.dumps(line) + "\n")
    for world in chosen.worlds:
        mine = [line for line in lines if line["world"] == world]
        table = Counter((line["verdict"], f) for line in mine for f in FOLLOWS if line[f]["fell"])
        said = ", ".join(f"{follow} {verdict}: {n} fell" for (verdict, follow), n in sorted(table.items()))
        followed = sum(line["planned"]["followed"] for line in mine)
        spent = sum(line["cpu_s"] for line in mine)
        print(f"{world}: {len(mine)} chunks, {spent:.0f} s; {said or 'none fell'}; {followed} followed within 20 mm")


if __name__ == "__main__":
    main()
