"""Is the chunk that is chosen among sixteen the best of them, in MuJoCo?

    python -m tests.studies.best_of --sets 1000 1200 --out best_of.jsonl [--limit-ms 33] [--both | --plans] [--jobs 2]

Sets are those of `tests.support.sampled_chunks`, begun in the stance. A line of JSON a set is added to the file, and
sets that it has are not done again. All chunks of a set are judged by plans. The chunk that `judge_many` puts first is
simulated; where it is not feasible, so are those that plans call better, until one is better in truth. With `--both`
nothing is simulated of sets in which plans call all alike, with `--plans` nothing at all: such sets count for the order
of scores alone.

It is told at the end how often the first is no worse than the best, among all and among sets that hold both feasible
and infeasible chunks by plans, how many pairs of an infeasible chunk and another one are in the order of their scores,
and the processor time. The answer is 1 if that is in less than 95 % of the latter.
"""

from __future__ import annotations

import argparse
import sys
from functools import cache, partial
from math import inf
from pathlib import Path
from time import process_time

import numpy as np

from policy.recorded.replay import ReplayPolicy
from tests.support.resumable import side_by_side
from tests.support.sampled_chunks import sampled_set
from wholebody import RobotState, judge_many
from wholebody.episode.run import EpisodeConfig
from wholebody.verdict.check import Checker
from wholebody.verdict.fast import FastChecker

ORDER = ("feasible", "feasible_after_repair", "infeasible")
BAR = 0.95
"""Share of sets in which the first has to be no worse than the best."""


@cache
def fast():
    """What judges by plans."""
    return FastChecker()


@cache
def simulation():
    """What simulates."""
    return Checker(episode=EpisodeConfig(settle=0.1, hold=2.5))


def truth(chunk):
    """What becomes of a chunk."""
    policy = ReplayPolicy(chunk)
    return simulation().check(policy, "", policy.duration)[0].verdict


def holds_both(plans):
    """Whether a set holds both feasible and infeasible chunks by plans."""
    return {0, 2} <= set(plans)


@cache
def compiled():
    """Whatever the first call compiles."""
    judge_many(sampled_set(0))


def chosen(number, limit, simulates):
    """What one set comes to; where it is in truth, None where that was not looked at.

    Simulated are all sets, those that hold both ("both"), or none ("none").
    """
    compiled()
    chunks, begin = sampled_set(number), fast().judge.stance()
    state, began = RobotState(0.0, begin.body.q, begin.body.v), process_time()
    ranking = judge_many(chunks, state, limit_ms=limit)
    seconds, first = process_time() - began, ranking.best
    free = (False, False)
    by_plans = [ORDER.index(fast().of_chunk(one, begin, "", free, odds=False).verdict) for one in chunks]
    simulated = {"all": True, "both": holds_both(by_plans), "none": False}[simulates]
    mine = best = ORDER.index(truth(chunks[first.index])) if simulated else None
    for i in sorted(range(len(chunks)), key=by_plans.__getitem__):
        if not simulated or best < mine or by_plans[i] >= mine or i == first.index:
            break
        best = min(best, ORDER.index(truth(chunks[i])))
    return {
        "case": number, "seconds": seconds, "score": first.score, "by": first.looked_at, "complete": ranking.complete,
        "mine": mine, "best": best, "plans": by_plans, "scores": [one.score for one in ranking.ranked],
        "order": [one.index for one in ranking.ranked],
    }  # fmt: skip


def summary(lines):
    """What all sets come to, and whether the bar is met."""
    known = [one for one in lines if one["mine"] is not None]
    both, mixed = ([one for one in some if holds_both(one["plans"])] for some in (known, lines))
    for name, some in (("simulated", known), ("that hold both", both)):
        good = sum(one["mine"] <= one["best"] for one in some)
        print(f"sets {name}: {len(some)}, the first no worse than the best in {good}")
    good, bad = (
        np.array([score for one in lines for i, score in zip(one["order"], one["scores"], strict=True)
                  if (one["plans"][i] == 2) is infeasible])
        for infeasible in (False, True)
    )  # fmt: skip
    apart = (good[:, None] < bad).mean() + 0.5 * (good[:, None] == bad).mean()
    print(f"{len(lines)} sets, of them {len(mixed)} that hold both by plans")
    print(f"pairs of an infeasible chunk and another one in order: {100 * apart:.1f} %")
    times = 1e3 * np.array([one["seconds"] for one in lines])
    print(f"processor time: median {np.median(times):.1f} ms, p99 {np.quantile(times, 0.99):.1f} ms")
    return all(one["mine"] <= one["best"] for one in both) or np.mean([x["mine"] <= x["best"] for x in both]) >= BAR


def main() -> int:
    """Do what is not in the file yet, and say what it comes to."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--sets", type=int, nargs=2, default=(1000, 1200), metavar=("FIRST", "END"))
    parser.add_argument("--limit-ms", type=float, default=inf)
    less = parser.add_mutually_exclusive_group()
    less.add_argument("--both", dest="simulates", action="store_const", const="both", default="all",
                      help="simulate sets alone in which plans call not all alike")  # fmt: skip
    less.add_argument("--plans", dest="simulates", action="store_const", const="none", help="simulate nothing")
    parser.add_argument("--jobs", type=int, default=1, help="sets at a time, each in a process of its own")
    parser.add_argument("--out", type=Path, required=True, help="a line of JSON for each set")
    asked = parser.parse_args()
    run = partial(chosen, limit=asked.limit_ms, simulates=asked.simulates)
    return int(not summary(side_by_side(run, range(*asked.sets), asked.out, asked.jobs)))


if __name__ == "__main__":
    sys.exit(main())
