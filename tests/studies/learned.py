"""``python -m tests.studies.learned [NAME [FIRST [COUNT]]] [--gate] [--realistic]``: a policy in the package.

It is run as ``wholebody run NAME`` does, `--realistic` in the world of each seed. Told of each seed: what became of its
task when the policy last looked, how far the scene's thing was lifted, the verdict, and falls.
"""

import sys
from dataclasses import replace

import numpy as np

from policy.learned import LEARNED, NAMES
from policy.learned.library import learned_policy
from policy.learned.reach import REACHED
from wholebody.cli.simulated import SCENE_OF
from wholebody.sim.robot_errors import REALISTIC_ROBOT
from wholebody.sim.sensors import REALISTIC_READINGS
from wholebody.verdict.check import Checker


def checker_of(name, seed, options):
    """What runs the policy in the world of a seed."""
    follow = "gated" if "--gate" in options else "planned"
    errors, sensors = None, None
    if "--realistic" in options:
        errors, sensors = replace(REALISTIC_ROBOT, seed=seed), replace(REALISTIC_READINGS, seed=seed)
    return Checker(SCENE_OF.get(name, "floor"), errors=errors, sensors=sensors, follow=follow)


def main(name=LEARNED, first="0", count="100", *options):
    checker, off, fell, goal = None, [], 0, REACHED if name == LEARNED else 0.0
    for seed in range(int(first), int(first) + int(count)):
        if checker is None or "--realistic" in options:
            checker = checker_of(name, seed, options)
        policy, heights = learned_policy(name, seed), []

        def look(time, end, plant=checker.plant, heights=heights):
            heights += plant.objects()[:1, 2].tolist()

        verdict, _ = checker.check(policy, policy.name, policy.duration, progress=look)
        risen = max(heights, default=0.0) - (heights or [0.0])[0]
        off.append(policy.off)
        fell += verdict.fell
        said = f"{policy.told}; lifted {1e3 * risen:.0f} mm" if name != LEARNED else policy.told
        print(f"{seed}: {said}; {verdict.verdict}, fell {verdict.fell}", flush=True)
    far = " / ".join(f"{1e3 * one:.0f}" for one in np.quantile(off, (0.5, 0.9, 1.0)))
    print(f"done {sum(one <= goal for one in off)} of {len(off)}, {fell} fell; {far} mm off (50, 90, 100 %)")


if __name__ == "__main__":
    names = sys.argv[1:]
    main(*names if names and names[0] in NAMES else (LEARNED, *names))
