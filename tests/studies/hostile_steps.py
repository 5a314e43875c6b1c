"""Who falls and who steps of hostile chunks and edge cases, without steps and with those that catch the robot.

    python -m tests.studies.hostile_steps hostile --first 0 --count 330 --out steps.jsonl
    python -m tests.studies.hostile_steps edge --first 0 --count 100 --out steps.jsonl --jobs 2

Cases are those of `tests.support.hostile_chunks`, the first 33 hostile ones every family from every start. A line a
case and setting, steps counted by feet that are lifted; what the file has already is not run again. The last lines
count falls and steps, and name the cases that fall with steps, that step though they stand without, and that do
something else though no foot was lifted. The answer is 1 if there are any.
"""

import argparse
import hashlib
import sys
from functools import cache
from pathlib import Path

from models import g1
from tests.support.hostile_chunks import EdgeEpisode, Episode
from tests.support.resumable import side_by_side
from wholebody.config import ControllerConfig
from wholebody.execution.supervisor import Supervisor
from wholebody.sim.plant import MujocoPlant

FAMILIES = {"hostile": (Episode, 330), "edge": (EdgeEpisode, 100)}
"""Episodes of each family, and how many there are."""


class Watched:
    """A supervisor, and when it lifted a foot [s], with a digest of what it commanded."""

    def __init__(self, supervisor):
        self._of, self.lifted, self.digest, self._stands = supervisor, [], hashlib.sha256(), (True, True)

    def __getattr__(self, name):
        return getattr(self._of, name)

    def step(self, state):
        command = self._of.step(state)
        stands = self._of.contacts.at(0.0).stands
        if not all(stands) and stands != self._stands:
            self.lifted.append(round(state.time, 3))
        self._stands = stands
        for numbers in (command.q, command.dq, command.tau):
            self.digest.update(numbers.tobytes())
        return command


@cache
def robot(steps):
    """Supervisor and plant of a setting."""
    return Supervisor(g1(), ControllerConfig(steps=steps)), MujocoPlant(g1())


def run(case):
    """A line of family, number and setting."""
    family, number, steps = case
    supervisor, plant = robot(steps)
    watched = Watched(supervisor)
    one = FAMILIES[family][0](watched, plant, number).run()
    line = {
        "case": case,
        "fell": one.fall is not None,
        "lifted": watched.lifted,
        "digest": watched.digest.hexdigest(),
        "said": str(one),
    }
    print(family, number, steps, f"{len(watched.lifted)} steps {watched.lifted};", one, flush=True)
    return line


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("family", choices=FAMILIES)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--count", type=int, default=330)
    parser.add_argument("--steps", nargs="+", default=["never", "recover"], choices=("never", "recover", "reach"))
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--out", type=Path, required=True, help="a line of JSON for each case and setting")
    given = parser.parse_args()
    numbers = range(given.first, min(given.first + given.count, FAMILIES[given.family][1]))
    cases = [[given.family, number, steps] for steps in given.steps for number in numbers]
    found = {tuple(line["case"]): line for line in side_by_side(run, cases, given.out, given.jobs)}
    wrong = []
    for steps in given.steps:
        lines = [found[given.family, number, steps] for number in numbers]
        fell = [line["case"][1] for line in lines if line["fell"]]
        stepped = [line["case"][1] for line in lines if line["lifted"]]
        print(f"{steps}: {len(fell)} of {len(lines)} fell: {fell}; {len(stepped)} stepped: {stepped}")
        wrong += fell if steps != "never" else []
    for steps in set(given.steps) - {"never"} if "never" in given.steps else ():
        both = [
            (number, found[given.family, number, "never"], found[given.family, number, steps]) for number in numbers
        ]
        needless = [number for number, never, one in both if one["lifted"] and not never["fell"]]
        other = [number for number, never, one in both if not one["lifted"] and one["digest"] != never["digest"]]
        print(f"{steps} steps where none fell without: {needless}; moves otherwise without a step: {other}")
        wrong += needless + other
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
