"""The studies that take hours, each into files of its own; what is there already is not measured again.

    python -m tests.studies FOLDER [--only NAME...] [--jobs 2]

`FOLDER/NAME.jsonl` has a line a case, `FOLDER/NAME.txt` what the study said; its last lines are printed. Those of
recorded motions run where G1_MOTIONS names a folder of them.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from itertools import product
from pathlib import Path

PLANNING = ("100", "300", "x3")
LOADS = ("reach", "ready", "change", "lean", "grasp", "hostile")
TOUCH = ("touch", "brush", "pulls", "bumps", "handed", "tasks")
SENSES = {"glitches": 20, "delay": 1, "realistic": 20, "hostile": 5, "friction": 40, "masses": 20, "ground": 40}
"""Studies of `benchmarks/senses.py`, and how many seeds each has."""
LIMITS, ROBOTS = ("loads", "slope", "delay", "friction", "model", "motors", "pushes"), {"true": 3, "realistic": 3}
"""Tables of `benchmarks/limits.py`, and how many seeds each robot has there."""
SAID = 12
"""Lines of a study that are printed."""


def studies() -> dict[str, list[str]]:
    """Arguments of each study, by name."""
    found = {"variants": ["-m", "tests.studies.lissajous_variants"], "repairs": ["-m", "tests.studies.repairs"]}
    families = ("hostile", "edge", *(("motions",) if os.environ.get("G1_MOTIONS") else ()))
    for family in families:
        for planning in PLANNING:
            found[f"{family}-{planning}"] = ["-m", "tests.studies.off_plan", family, "--planning", planning]
    for follow in ("gated", "as_given"):
        found[f"gate-{follow}"] = ["-m", "tests.studies.gate", follow]
    for family in LOADS:
        found[f"loads-{family}"] = ["-m", "tests.studies.loads", family]
    for kind in TOUCH:
        found[f"touch-{kind}"] = ["-m", "tests.studies.touch", kind]
    for name, seeds in SENSES.items():
        found[f"senses-{name}"] = ["benchmarks/senses.py", name, "--seeds", "0", str(seeds)]
    for name in ("drift", *(("motions",) if os.environ.get("G1_MOTIONS") else ())):
        found[f"realistic-{name}"] = ["benchmarks/realistic.py", name, "--seeds", "0", "20"]
    for table, (robot, seeds) in product(LIMITS, ROBOTS.items()):
        found[f"limits-{table}-{robot}"] = ["benchmarks/limits.py", table, "--robot", robot, "--seeds", "0", str(seeds)]
    return found


def main() -> int:
    """Run what is asked for, and print what it said; 1 if any study failed."""
    known = studies()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", nargs="*", choices=known, default=list(known))
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="studies at a time")
    chosen = parser.parse_args()
    chosen.folder.mkdir(parents=True, exist_ok=True)

    def run(name: str) -> int:
        said = chosen.folder / f"{name}.txt"
        arguments = [sys.executable, *known[name], "--out", str(chosen.folder / f"{name}.jsonl")]
        with said.open("w") as file:
            environment = {**os.environ, "OMP_NUM_THREADS": "1"}
            code = subprocess.call(arguments, stdout=file, stderr=subprocess.STDOUT, env=environment)
        print("\n  ".join([f"{name}: exit {code}", *said.read_text().splitlines()[-SAID:]]), flush=True)
        return code

    with ThreadPoolExecutor(chosen.jobs) as pool:
        return int(any(list(pool.map(run, chosen.only))))


if __name__ == "__main__":
    sys.exit(main())
