"""``python -m tests.studies.learned [FIRST [COUNT]] [--gate]``: the policy in the package as ``wholebody run`` runs it.

Told of each seed: how far the farther palm is from its goal when the policy last looked, the verdict, and falls.
"""

import sys

import numpy as np

from policy.learned.reach import REACHED, LearnedReach
from wholebody.verdict.check import Checker


def main(first="0", count="100", *options):
    checker = Checker(follow="gated" if "--gate" in options else "planned")
    off, fell = [], 0
    for seed in range(int(first), int(first) + int(count)):
        policy = LearnedReach(seed)
        verdict, _ = checker.check(policy, policy.name, policy.duration)
        off.append(policy.off)
        fell += verdict.fell
        print(f"{seed}: {1e3 * policy.off:.0f} mm off, {verdict.verdict}, fell {verdict.fell}", flush=True)
    far = " / ".join(f"{1e3 * one:.0f}" for one in np.quantile(off, (0.5, 0.9, 1.0)))
    print(f"reached {sum(one <= REACHED for one in off)} of {len(off)}, {fell} fell; {far} mm off (50, 90, 100 %)")


if __name__ == "__main__":
    main(*sys.argv[1:])
