"""Who falls: hostile chunks, slow paths past the limit of reach, recorded motions, with plans that take their time.

``python -m tests.studies.off_plan hostile --planning 300 --cases 0 330 --out falls.jsonl`` runs the cases 0 to 329 with
plans that take 300 ms, prints one line each and appends it to the file; cases that the file has already are left out,
so an interrupted study goes on where it was. ``--planning x3`` takes the CPU time of each plan as measured, times 3.
The answer is 1 if one of them fell.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
from collections.abc import Callable
from pathlib import Path

from models import g1
from policy.recorded.replay import open_recording
from tests.support.hostile_chunks import EdgeEpisode, Episode
from wholebody.config import ControllerConfig, PlanningConfig
from wholebody.execution.supervisor import Supervisor
from wholebody.sim.plant import MujocoPlant
from wholebody.verdict.check import Checker

CASES = {"hostile": 330, "edge": 100, "motions": 18}
"""How many there are of each family."""


def planning(said: str) -> PlanningConfig:
    """Settings of ``100`` [ms], or of ``x3``."""
    if said.startswith("x"):
        return PlanningConfig(latency="measured", factor=float(said[1:]))
    return PlanningConfig(lead=1e-3 * float(said))


def episodes(kind: type[Episode], config: ControllerConfig) -> Callable[[int], dict]:
    """Runs cases of a family of seeded episodes."""
    robot = Supervisor(g1(), config), MujocoPlant(g1())

    def run(case: int) -> dict:
        result = kind(*robot, case).run()
        return {"fell": result.fall is not None, "off_plan_s": round(result.off_plan, 3), "said": str(result)}

    return run


def motions(config: ControllerConfig) -> Callable[[int], dict]:
    """Runs recorded motions of the folder ``G1_MOTIONS``, by name."""
    files, checker = sorted(Path(os.environ["G1_MOTIONS"]).glob("*.csv")), Checker(config=config)

    def run(case: int) -> dict:
        policy = open_recording(files[case])
        verdict, _ = checker.check(policy, files[case].stem, policy.duration)
        seconds = {key: round(value, 2) for key, value in verdict.seconds.items()}
        said = f"{files[case].stem} {100 * verdict.within_20mm:.1f} % within 20 mm, {seconds} s"
        return {"fell": verdict.fell, "off_plan_s": seconds.get("stop", 0.0), "said": said}

    return run


def main() -> int:
    """Run what is not in the file yet; 1 if anything fell."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("family", choices=CASES)
    parser.add_argument("--planning", default="100", help="time that a plan takes [ms], or x3: as measured, times 3")
    parser.add_argument("--cases", type=int, nargs=2, default=(0, math.inf), metavar=("FIRST", "END"))
    parser.add_argument("--out", type=Path, help="a line of JSON for each case")
    chosen = parser.parse_args()
    config = ControllerConfig(planning=planning(chosen.planning))
    done = {}
    if chosen.out is not None and chosen.out.exists():
        lines = [json.loads(line) for line in chosen.out.read_text().splitlines()]
        done = {(line["family"], line["planning"], line["case"]): line for line in lines}
    run = motions(config) if chosen.family == "motions" else None
    if run is None:
        run = episodes({"hostile": Episode, "edge": EdgeEpisode}[chosen.family], config)
    found = []
    for case in range(int(chosen.cases[0]), int(min(chosen.cases[1], CASES[chosen.family]))):
        known = done.get((chosen.family, chosen.planning, case))
        line = known or {"family": chosen.family, "planning": chosen.planning, "case": case} | run(case)
        found.append(line)
        if known is None and chosen.out is not None:
            with chosen.out.open("a") as file:
                file.write(json.dumps(line) + "\n")
        print(case, "FELL" if line["fell"] else "stands", line["said"], flush=True)
    fell = [line["case"] for line in found if line["fell"]]
    longest = max(found, key=lambda line: line["off_plan_s"], default={"off_plan_s": 0.0, "case": None})
    said = f"longest off a plan {longest['off_plan_s']} s, case {longest['case']}"
    print(f"{len(fell)} of {len(found)} fell: {fell}; {said}")
    return int(bool(fell))


if __name__ == "__main__":
    sys.exit(main())
