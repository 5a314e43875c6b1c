"""Hostile chunks with a base velocity, in MuJoCo, with `steps: reach`: a line for each seed, and how many fell.

    python -m tests.studies.hostile_walks --first 0 --count 135
    python -m tests.studies.hostile_walks --edge --first 0 --count 50
    python -m tests.studies.hostile_walks --rides

The first 135 seeds are every family of hands in every frame with every velocity; with `--edge` hands are just such as a
robot that steps is led with, and 25 seeds every bound with every velocity. With `--rides` somebody else tells the
velocity, and the chunks lead the hands alone. `--steps never` is the robot that stays on
both feet.
"""

import argparse

from tests.support.hostile_walks import CASES, edge_walk, hostile_walk
from tests.support.walked_chunks import SPEC
from wholebody.config import ControllerConfig
from wholebody.execution.supervisor import Supervisor
from wholebody.sim.plant import MujocoPlant


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--count", type=int, default=CASES)
    parser.add_argument("--steps", default="reach", choices=("never", "recover", "reach"))
    parser.add_argument("--edge", action="store_true", help="hands just inside the bounds of walks")
    parser.add_argument("--rides", action="store_true", help="the velocity is not the chunks'")
    given = parser.parse_args()
    supervisor, plant = Supervisor(SPEC, ControllerConfig(steps=given.steps)), MujocoPlant(SPEC)
    falls, seeds = 0, range(given.first, given.first + given.count)
    for seed in seeds:
        one = (edge_walk if given.edge else hostile_walk)(supervisor, plant, seed, rides=given.rides)
        falls += one.fall is not None
        print(f"{seed} {one}", flush=True)
    print(f"{falls} of {len(seeds)} fell")


if __name__ == "__main__":
    main()
