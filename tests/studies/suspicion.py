"""How often what is wrong with recordings is found, and how often nothing is: ``MOTIONS=FOLDER make studies`` or

    MOTIONS=FOLDER python -m tests.studies.suspicion [--copies 100] [--clean 200] [--seed 1] [--only NAME ...]

Motions (``.csv``, 36 columns, 60 Hz) are split by clip before they are cut: every second one, by name, gave
`TYPICAL` and the thresholds, the others are measured. Each copy is a piece of 2 to 5 s at 30 Hz of a measured clip
with one corruption of `tests.support.corruptions`; fingers open and close as made there. A clean piece with any
hypothesis is a false alarm.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path

import numpy as np

from policy.recorded.motion_csv import read_motion_csv
from tests.support.corruptions import CORRUPTIONS, clean, corrupted, findings


def main() -> None:
    """Print a row a corruption, and the false alarms."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--copies", type=int, default=100)
    parser.add_argument("--clean", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", nargs="*", choices=CORRUPTIONS, default=list(CORRUPTIONS), help="corruptions to make")
    parser.add_argument("--train", action="store_true", help="the clips of the thresholds instead")
    given = parser.parse_args()
    files = sorted(Path(os.environ["MOTIONS"]).glob("*.csv"))[0 if given.train else 1 :: 2]
    motions = [read_motion_csv(file) for file in files]
    rng = np.random.default_rng(given.seed)
    alarms: dict[str, int] = {}
    false = 0
    for _ in range(given.clean):
        found = [one.check for one in findings(clean(motions, rng))]
        false += bool(found)
        for code in found:
            alarms[code] = alarms.get(code, 0) + 1
    print(f"{len(files)} clips; clean: {false} of {given.clean} with a hypothesis {alarms or ''}")
    for name, (corrupt, codes) in ((name, CORRUPTIONS[name]) for name in given.only):
        hits, others = 0, {}
        for _ in range(given.copies):
            found = [one.check for one in findings(corrupted(corrupt, clean(motions, rng), rng))]
            hits += any(code in codes for code in found)
            for code in found:
                if code not in codes:
                    others[code] = others.get(code, 0) + 1
        print(f"{name:<34} {hits:>4} of {given.copies}  {others or ''}", flush=True)


if __name__ == "__main__":
    main()
