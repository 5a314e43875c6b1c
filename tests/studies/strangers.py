"""Is what is told of chunks that nothing was fitted to true, told of the right place, and does what would do, do?

    python -m tests.studies.strangers --cases 0 200 --out strangers.jsonl [--parts told simulated] [--jobs 2]

Cases are those of `tests.support.stranger_chunks`, each begun in the stance: straight down, beside the body, with an
end in motion, loaded. A line of JSON a case and part is added to the file, and those that it has are not done again: it
can be stopped and begun again. ``told`` is the fast check, asked why, each change that would do
judged again by a checker that knows nothing of it after it went through the numbers of its layout; ``simulated`` is
what becomes of the chunk in MuJoCo.

It is told at the end: disagreements, wrong "feasible" ones, places of causes outside the chunk, and of the infeasible
chunks whose share a change within bounds was found, and which of them are not feasible when applied. The answer is 1
if there is a wrong "feasible", a place outside, or a change that does not do.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from functools import cache
from pathlib import Path
from time import process_time

import numpy as np

from policy.action_spec.codec import decode, encode
from policy.recorded.replay import ReplayPolicy
from tests.support.resumable import side_by_side
from tests.support.sent_chunks import STANCE
from tests.support.stranger_chunks import SPEC, stranger, told_of
from wholebody.episode.run import EpisodeConfig
from wholebody.verdict.check import Checker
from wholebody.verdict.fast import FastChecker

MOVED, SLOWER = 0.15, 3.0
"""How far a change may move a palm [m], and how much slower it may make a chunk."""
HOLD = 2.5
"""Time for which the robot is watched after the last step [s]."""
NEAR = 1e-3
"""Distance of a place that is told from that of the step [m]."""


@cache
def fast(loads):
    """What judges, and what knows nothing of it and judges again."""
    return FastChecker(told_of(loads)), FastChecker(told_of(loads))


@cache
def simulation(loads):
    """What simulates."""
    return Checker(config=told_of(loads), episode=EpisodeConfig(settle=0.1, hold=HOLD), payload_kg=loads)


def told(number):
    """The fast check's answer, and what it offers."""
    case, began = stranger(number), process_time()
    checker, again = fast(case.loads)
    policy = ReplayPolicy(case.chunk, spec=SPEC)
    verdict = checker.check(policy, case.family, policy.duration, start="stance", ask_why=True)
    asked, off = checker.judge.asked(case.chunk)[0], []
    for one, cause in zip(verdict.causes, checker.explainer.asked[1] if verdict.causes else (), strict=True):
        _, side, place = cause.where
        step = round(one.time * case.chunk.fps)
        inside = 0 <= step < len(case.chunk)
        off.append(float(np.linalg.norm(asked[step, side] - place)) if inside else None)
    changes = []
    for one in verdict.would_do:
        if one.chunk is None:
            continue
        chunk = decode(SPEC, encode(SPEC, one.chunk, STANCE), STANCE, fps=one.chunk.fps)
        applied = ReplayPolicy(chunk, spec=SPEC)
        answer = again.check(applied, "", applied.duration, start="stance").verdict
        changes.append(
            {"kind": one.kind, "slower": one.slower, "moved": one.moved, "turned": one.turned, "applied": answer}
        )
    first = verdict.violations[0] if verdict.violations else None
    return {
        "verdict": verdict.verdict, "decided_by": verdict.decided_by, "seconds": process_time() - began,
        "off": off, "changes": changes, "said": [one.sentence for one in verdict.causes],
        "why": first and f"{first.code} {first.value:.3g}",
        "tightest": [f"{one.code} {one.subject} {one.share:.2f}" for one in verdict.margins[:3]],
    }  # fmt: skip


def simulated(number):
    """What becomes of it."""
    case, began = stranger(number), process_time()
    policy = ReplayPolicy(case.chunk, spec=SPEC)
    verdict, _ = simulation(case.loads).check(policy, case.family, policy.duration)
    first = verdict.violations[0] if verdict.violations else None
    return {
        "verdict": verdict.verdict, "fell": verdict.fell, "max": verdict.max_m, "seconds": process_time() - began,
        "why": first and f"{first.code} {first.subject} {first.value:.3g}",
    }  # fmt: skip


PARTS = {"told": told, "simulated": simulated}


def good(change):
    """Whether a change is one that a person would still call the same motion."""
    return change["moved"] <= MOVED and change["slower"] <= SLOWER


def summary(lines):
    """What all of it comes to, and whether it is as it should be."""
    by = {part: {number: one for one in lines for kind, number in [one["case"]] if kind == part} for part in PARTS}
    both = sorted(by["told"].keys() & by["simulated"].keys())
    pairs = {k: (by["told"][k]["verdict"], by["simulated"][k]["verdict"]) for k in both}
    differ = [k for k in both if pairs[k][0] != pairs[k][1]]
    wrong = [k for k in both if pairs[k] == ("feasible", "infeasible")]
    fell = [k for k in both if by["simulated"][k]["fell"]]
    print(f"{len(both)} judged both ways: {len(differ)} differ, wrong feasible {wrong}, fell {fell}")
    for k in differ:
        mine, theirs = by["told"][k], by["simulated"][k]
        print(f"  {k} {stranger(k).family}: {mine['verdict']} ({mine['why']}), {theirs['verdict']} ({theirs['why']})")
    not_done = {k: one for k, one in by["told"].items() if one["verdict"] == "infeasible"}
    outside = [k for k, one in not_done.items() for off in one["off"] if off is None or off > NEAR]
    print(f"{sum(len(one['off']) for one in not_done.values())} causes, of places outside the chunk: {outside}")
    helped = [k for k, one in not_done.items() if any(map(good, one["changes"]))]
    failed = [k for k, one in by["told"].items() for x in one["changes"] if x["applied"] != "feasible"]
    far = [k for k, one in by["told"].items() for x in one["changes"] if not good(x)]
    print(f"{len(helped)} of {len(not_done)} infeasible ones would do, not feasible when applied: {failed}, far: {far}")
    print("  without:", dict(Counter(stranger(k).family for k in not_done if k not in helped)))
    for k in not_done.keys() - set(helped):
        print(f"  {k} {stranger(k).family}: {not_done[k]['changes']} {not_done[k]['said'][:1] or not_done[k]['why']}")
    return not (wrong or outside or failed or far)


def line(case):
    """The line of a part and a number."""
    part, number = case
    found = {"case": case} | PARTS[part](number)
    print(part, number, stranger(number).family, found["verdict"], found["why"] or "", flush=True)
    return found


def main() -> int:
    """Do what is not in the file yet, and say what it comes to."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--cases", type=int, nargs=2, default=(0, 200), metavar=("FIRST", "END"))
    parser.add_argument("--parts", nargs="*", choices=PARTS, default=list(PARTS))
    parser.add_argument("--jobs", type=int, default=1, help="cases at a time, each in a process of its own")
    parser.add_argument("--out", type=Path, required=True, help="a line of JSON for each case and part")
    chosen = parser.parse_args()
    cases = [[part, number] for number in range(*chosen.cases) for part in chosen.parts]
    return int(not summary(side_by_side(line, cases, chosen.out, chosen.jobs)))


if __name__ == "__main__":
    sys.exit(main())
