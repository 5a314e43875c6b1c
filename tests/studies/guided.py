"""Do costs of `wholebody.guide` tell what is infeasible, do steps along them mend it, and does guidance of π0.5?

    python -m tests.studies.guided --out guided.jsonl [--strangers 3000 3400] [--sets 3000 3008]

Strangers are chunks of families that nothing was fitted to (`tests.support.stranger_chunks`): each is judged by plans;
where it is infeasible, so is what a gradient step and the Gauss-Newton step of `Guide.corrected` make of it. Sets are
those of `tests.support.sampled_chunks`, as what a tiny π0.5 answers whose noise they are, with and without guidance.
A line of JSON each is added to the file, and what it has is not done again.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from functools import cache
from pathlib import Path

import numpy as np

from policy.action_spec.anchor import Anchor
from policy.action_spec.codec import decode, encode
from tests.support.guided_pi05 import guided_pi05, samples_of
from tests.support.sampled_chunks import sampled_set
from tests.support.stranger_chunks import SPEC, stranger, told_of
from wholebody.guide.denoising import guided
from wholebody.guide.guide import Guide
from wholebody.verdict.fast import FastChecker
from wholebody.verdict.given.many import score

FREE = (False, False)


@cache
def checker():
    """What judges by plans."""
    return FastChecker()


@cache
def guide(fps, loads=(0.0, 0.0)):
    """What is asked for costs."""
    return Guide(SPEC, told_of(loads), fps=fps)


def verdict_of(chunk):
    """What a plan makes of a chunk that is begun in the stance."""
    return checker().of_chunk(chunk, checker().judge.stance(), "", FREE, odds=False)


def descended(actions, of):
    """Raw actions (1, H, A) after one gradient step of the cost, in terms of what a repair may change."""
    import torch

    numbers = torch.tensor(actions, requires_grad=True)
    of(numbers).total.sum().backward()
    unit, bounds = np.zeros(actions.shape[2]), checker().config.verdict
    for slot in SPEC.slots:
        unit[slot.indices] = bounds.palm_repair if slot.kind == "position" else bounds.turn_repair
    return actions - actions.shape[1] * unit**2 * numbers.grad.numpy()


def of_stranger(number):
    """What one stranger comes to."""
    one, anchor = stranger(number), Anchor.nominal()
    checker().judge.carry(*one.loads)
    verdict, actions = verdict_of(one.chunk), encode(SPEC, one.chunk, anchor)[None]
    of, bounds = guide(one.chunk.fps, one.loads), checker().config.verdict
    found = {
        "stranger": number,
        "family": one.family,
        "infeasible": verdict.verdict == "infeasible",
        "worst": float(of.worst(actions)[0]),
        "score": score(verdict, bounds),
    }
    if found["infeasible"]:
        for name, changed in (("gradient", descended(actions, of)), ("corrected", of.corrected(actions))):
            chunk = decode(SPEC, changed[0], anchor, fps=one.chunk.fps)
            found[name] = score(verdict_of(chunk), bounds)
    return found


def of_set(number, policy):
    """How many samples of one set plans call infeasible, as they are and guided."""
    checker().judge.carry(0.0, 0.0)
    found, of = {"set": number}, guide(policy.spec.fps)
    for name in ("plain", "guided"):
        if name == "guided":
            with guided(policy, of):
                chunks = samples_of(policy, sampled_set(number))
        else:
            chunks = samples_of(policy, sampled_set(number))
        found[name] = sum(verdict_of(one).verdict == "infeasible" for one in chunks)
    return found | {"of": len(chunks)}


def order(good, bad):
    """Share of pairs of a good and a bad one in which the latter is larger."""
    good, bad = np.array(good)[:, None], np.array(bad)
    return (good < bad).mean() + 0.5 * (good == bad).mean()


def summary(lines):
    """What all come to."""
    strangers = [one for one in lines if "stranger" in one]
    for family in ("all", *sorted({one["family"] for one in strangers})):
        some = [one for one in strangers if family in ("all", one["family"])]
        good, bad = ([one["worst"] for one in some if one["infeasible"] is kind] for kind in (False, True))
        print(f"{family}: {len(bad)} of {len(some)} infeasible, area under the curve {order(good, bad):.3f}")
    bad = [one for one in strangers if one["infeasible"]]
    for name in ("gradient", "corrected"):
        lower, mended = (sum(one[name] < bar(one) for one in bad) for bar in (lambda one: one["score"], lambda _: 1.0))
        print(f"{name}: lowers the score in {lower} of {len(bad)}, {mended} are infeasible no more")
    sets = [one for one in lines if "set" in one]
    plain, led, of = (sum(one[name] for one in sets) for name in ("plain", "guided", "of"))
    print(f"pi05: {plain} of {of} infeasible, guided {led}")


def main() -> int:
    """Do what is not in the file yet, and say what it comes to."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--strangers", type=int, nargs=2, default=(3000, 3400), metavar=("FIRST", "END"))
    parser.add_argument("--sets", type=int, nargs=2, default=(3000, 3008), metavar=("FIRST", "END"))
    parser.add_argument("--out", type=Path, required=True, help="a line of JSON for each")
    asked = parser.parse_args()
    lines = list(map(json.loads, asked.out.read_text().splitlines())) if asked.out.exists() else []
    known = {(name, one[name]) for one in lines for name in ("stranger", "set") if name in one}
    with tempfile.TemporaryDirectory() as folder, asked.out.open("a") as file:
        policy = guided_pi05(folder)
        todo = [("stranger", n, of_stranger) for n in range(*asked.strangers)]
        todo += [("set", n, lambda n: of_set(n, policy)) for n in range(*asked.sets)]
        for kind, number, what in todo:
            if (kind, number) not in known:
                lines.append(what(number))
                file.write(json.dumps(lines[-1]) + "\n")
                file.flush()
    summary(lines)
    return 0


if __name__ == "__main__":
    sys.exit(main())
