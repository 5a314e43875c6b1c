"""Are planted chunks repaired, how much does that change, and is a slow-down the least one?

    python -m tests.studies.repairs --out OUT.jsonl --cases 0 20 [--kinds KIND ...]

repairs the planted cases 0 to 19 of each kind of `tests/support/planted_causes.py`, adds a line for each to OUT.jsonl,
and prints what all of its lines come to. Cases that are there already are left out: it can be stopped and begun again.

A chunk that is repaired is encoded, decoded and judged again as it is played back, by a checker of its own. The
least slow-down is found by bisection to 0.5 %: that of what a repair has to be, feasible as it is played back, and that
of what one plan for all of the chunk can do. One feasible chunk a seed has to come back as it is, to 1e-9.
"""

import argparse
import json
from pathlib import Path
from time import thread_time

import numpy as np

from policy.action_spec.codec import decode, encode
from tests.support.planted_causes import KINDS, chunk_of, holder, moved, planted
from tests.support.sent_chunks import SPEC, STANCE
from wholebody.verdict.fast import FastChecker
from wholebody.verdict.repair import SLOWER_MAX, slowed

FINE = 8
"""Halvings of the range of slow-downs: 4 to the power of 1 / 256 is 0.5 %."""


def least_slowdown(holds, chunk):
    """By bisection; None where even the largest does not do."""
    low, high = 0.0, np.log(SLOWER_MAX)
    if not holds(slowed(chunk, SLOWER_MAX)):
        return None
    for _ in range(FINE):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if holds(slowed(chunk, float(np.exp(middle)))) else (middle, high)
    return float(np.exp(high))


def case(kind, seed):
    one = planted(kind, seed)
    checker, began = holder(one.config, one.scene), thread_time()
    begin = checker.judge.stance() if one.from_stance else None
    repairer = checker.repairer(one.chunk, begin)
    change = repairer.repaired()
    spent = thread_time() - began
    start = begin or checker.judge.first_pose(one.chunk)
    singles = [] if repairer.holds(one.chunk) else checker.explainer.single_changes(one.chunk, start).all()
    within = checker.config.verdict
    cured = [x.kind for x in singles if x.moved <= within.palm_repair and x.turned <= within.turn_repair]
    out = {"kind": kind, "seed": seed, "cured_by": cured, "seconds": spent, "change": None}
    if change is None:
        return out
    again, chunk = FastChecker(one.config, one.scene), decode(SPEC, encode(SPEC, change.chunk, STANCE), STANCE)
    out |= {"change": change.kind, "slower": change.slower, "moved": change.moved, "turned": change.turned}
    out["holds"] = again.repairer(chunk, begin).lasts(chunk)
    if change.kind == "slower" and change.slower > 1.0:
        for name, holds in (("least", repairer.lasts), ("least_by_one_plan", repairer.holds)):
            out[name] = least_slowdown(holds, repairer.inside)
    return out


def unchanged(seed):
    """Largest change of a feasible chunk."""
    rng = np.random.default_rng(seed)
    chunk = chunk_of(moved(rng.uniform([0.22, 0.1, 0.8], [0.3, 0.25, 1.0]), 1.4))
    change = holder(planted("floor", 0).config).repairer(chunk).repaired()
    return max(
        float(np.abs(b - a).max()) for a, b in zip(chunk.arrays().values(), change.chunk.arrays().values(), strict=True)
    )


def told(rows):
    # What the hands carry is none of the chunk's numbers.
    cured = [row for row in rows if set(row["cured_by"]) - {"lighter"}]
    done = [row for row in rows if row["change"]]
    slow = [row for row in done if row["slower"] > 1.0]
    bent = [row for row in done if row["change"] != "slower"]
    again = sum(bool(row["change"]) for row in cured)
    print(f"some single change cures {len(cured)} of {len(rows)}; of those repaired {again}")
    print(f"repaired in all {len(done)}; hold when judged again {sum(row['holds'] for row in done)}")
    if bent:
        most = [1e3 * np.median([row["moved"] for row in bent]), np.rad2deg(np.median([row["turned"] for row in bent]))]
        print(f"bent {len(bent)}: median {most[0]:.1f} mm and {most[1]:.1f} deg")
    if slow:
        print(f"slowed {len(slow)}: median {np.median([row['slower'] for row in slow]):.2f}")
    for name, said in (("least", "over the least"), ("least_by_one_plan", "over the least by one plan")):
        off = np.array([row["slower"] / row[name] - 1.0 for row in slow if row.get(name)])
        if len(off):
            within = f"{(off <= 0.05).sum()} of {len(off)} within 5 %"
            print(f"slow-down {said}: median {100 * np.median(off):.1f} %, worst {100 * off.max():.1f} %, {within}")
    print(f"{np.median([row['seconds'] for row in rows]):.2f} s of CPU time median")


def main(path, first, last, kinds):
    path, rows = Path(path), []
    if path.exists():
        rows = [json.loads(line) for line in path.read_text().splitlines()]
    known = {(row["kind"], row["seed"]) for row in rows}
    for seed in range(first, last):
        for kind in kinds or KINDS:
            if (kind, seed) in known:
                continue
            rows.append(case(kind, seed))
            with path.open("a") as out:
                out.write(json.dumps(rows[-1]) + "\n")
            print(rows[-1], flush=True)
    told(rows)
    print(f"a feasible chunk changes by {max(map(unchanged, range(first, last))):.1e} at most")


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--out", required=True)
    parser.add_argument("--cases", type=int, nargs=2, default=(0, 20))
    parser.add_argument("--kinds", nargs="*", choices=KINDS)
    chosen = parser.parse_args()
    main(chosen.out, *chosen.cases, chosen.kinds)
