"""What the gate is worth: who falls of hostile cases behind it, with plans alone, and as they are given.

``python -m tests.studies.gate gated --cases 0 100 --out gate.jsonl`` runs the cases 0 to 99 of
`tests.support.hostile_chunks` behind the gate, prints a line each and appends it to the file; ``planned`` and
``as_given`` run the same ones without. Cases that the file has already are left out, so an interrupted study goes on
where it was. The answer is 1 if one of them fell that was not followed as given.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from dataclasses import asdict
from pathlib import Path
from time import process_time
from typing import get_args

from tests.support.hostile_chunks import Episode
from wholebody.verdict.check import Checker
from wholebody.verdict.verdict import Follow


def run(checker: Checker, case: int) -> dict:
    """A case, and what the gate made of its chunks."""
    if checker.gate is not None:
        checker.gate.begin((False, False))
    begin = process_time()
    result = Episode(checker.supervisor, checker.plant, case).run()
    seconds, summary = process_time() - begin, None
    if checker.gate is not None:
        summary = asdict(checker.gate.summary(checker.supervisor.handover.late))
    simulated = float(checker.plant.data.time)
    return {
        "fell": result.fall is not None,
        "kind": result.kind,
        "said": str(result),
        "gate": summary,
        "cpu_ms_per_s": round(1e3 * seconds / simulated, 1),
    }


def main() -> int:
    """Run what is not in the file yet; 1 if anything fell behind the gate, or by its plan."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("follow", choices=get_args(Follow))
    parser.add_argument("--cases", type=int, nargs=2, default=(0, 100), metavar=("FIRST", "END"))
    parser.add_argument("--out", type=Path, help="a line of JSON for each case")
    chosen, done, found = parser.parse_args(), {}, []
    if chosen.out is not None and chosen.out.exists():
        lines = map(json.loads, chosen.out.read_text().splitlines())
        done = {(line["follow"], line["case"]): line for line in lines}
    checker = Checker(follow=chosen.follow)
    for case in range(*chosen.cases):
        known = done.get((chosen.follow, case))
        line = known or {"follow": chosen.follow, "case": case} | run(checker, case)
        found.append(line)
        if known is None and chosen.out is not None:
            with chosen.out.open("a") as file:
                file.write(json.dumps(line) + "\n")
        print(case, "FELL" if line["fell"] else "stands", line["said"], line["gate"] or "", flush=True)
    fell = [line["case"] for line in found if line["fell"]]
    passed = Counter()
    for line in found:
        passed.update(
            {name: line["gate"][name] for name in ("cleared", "repaired", "rejected")} if line["gate"] else {}
        )
    print(f"{chosen.follow}: {len(fell)} of {len(found)} fell: {fell}; chunks {dict(passed)}")
    return int(bool(fell) and chosen.follow != "as_given")


if __name__ == "__main__":
    sys.exit(main())
