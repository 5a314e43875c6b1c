"""Recorded motions that walk, with `steps: reach`, in MuJoCo: twelve that are made, or those of a folder that travel.

    python -m tests.studies.recorded_walks --out walks.jsonl
    python -m tests.studies.recorded_walks --motions FOLDER --seconds 12 --out moves.jsonl
    python -m tests.studies.recorded_walks --motions FOLDER --planned --out planned.jsonl
    python -m tests.studies.recorded_walks --realistic 2 --out walks.jsonl

A line a motion, added to the file as it is there; what the file has is not run again. The true robot, or with
`--realistic` that many seeds of realistic worlds, the state estimated. The pelvis is compared with the recorded one
where that is then, the base between the soles likewise; palms about that base, the worse of both in each row. With
`--planned` nothing is simulated: how much slower each would be walked, and in what share of its rows no hand is drawn
in by more than 30 mm.
"""

import argparse
from functools import partial
from pathlib import Path

import numpy as np

from policy.recorded.motion_csv import Motion, motion_chunk, read_motion_csv, travels
from policy.recorded.replay import ReplayPolicy
from policy.recorded.walked_motion import WalkedWay, hands_of
from tests.support.made_walks import WALKS, made_walk
from tests.support.recorded_walks import LIMITS, NEAR, replayed
from tests.support.resumable import finished
from wholebody.verdict.fast import FastChecker


def motions(folder, seconds):
    """Motions by name."""
    if folder is None:
        return {name: made_walk(walk) for name, walk in WALKS.items()}
    found = {path.stem: read_motion_csv(path) for path in sorted(folder.glob("*.csv"))}
    return {name: shortened(motion, seconds) for name, motion in found.items() if travels(motion) is not None}


def shortened(motion, seconds):
    """The first so many seconds of a motion [s]."""
    frames = slice(None, int(seconds * motion.fps) + 1)
    return Motion(motion.fps, motion.T_world_base[frames], motion.q_body[frames])


def walked(motion, seed):
    """Numbers of a motion that is walked with."""
    numbers, verdict, _ = replayed(motion, seed=seed)
    return numbers | {"infeasible": float(verdict.verdict == "infeasible")}


def planned(motion):
    """What is made of a motion before it is walked."""
    walk, recorded = WalkedWay.of(motion, LIMITS), hands_of(motion)
    drawn = [np.linalg.norm(T[:, :3, 3] - recorded[hand][:, :3, 3], axis=1) for hand, T in walk.hands.items()]
    return {"factor": float(walk.times[-1] / motion.duration), "kept": float((np.maximum(*drawn) <= NEAR).mean())}


def stayed(motion):
    """Whether a robot that stays is told to be feasible by the fast check, and whether the reason is the feet."""
    policy = ReplayPolicy(motion_chunk(motion), name="stays")
    verdict = FastChecker().check(policy, "stays", min(policy.duration, 4.0), odds=False)
    codes = {one.code.value for one in verdict.violations}
    return {"feasible": float(verdict.verdict == "feasible"), "hands_only": float("hands_only" in codes)}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", help="of the motions; all if none")
    parser.add_argument("--motions", type=Path, help="folder of motions .csv at 60 frames a second")
    parser.add_argument("--seconds", type=float, default=1e3, help="how much of each of them [s]")
    parser.add_argument("--realistic", type=int, default=0, metavar="SEEDS")
    parser.add_argument("--stays", action="store_true", help="what the fast check says of a robot that stays")
    parser.add_argument("--planned", action="store_true", help="what is made of them, nothing simulated")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--jobs", type=int, default=1)
    given = parser.parse_args()
    named = motions(given.motions, given.seconds)
    named = {name: named[name] for name in given.names or named}
    if given.stays or given.planned:
        kind, run = ("planned", planned) if given.planned else ("stays", stayed)
        cases = [(kind, name, partial(run, motion)) for name, motion in named.items()]
    else:
        worlds = range(given.realistic) if given.realistic else [None]
        cases = [
            ("walks" if seed is None else f"seed {seed}", name, partial(walked, motion, seed))
            for name, motion in named.items()
            for seed in worlds
        ]
    for group, found in finished(cases, given.out, given.jobs).items():
        keys = next(iter(found.values()))
        for key in keys:
            values = np.array([numbers[key] for numbers in found.values()])
            print(f"{group} {key}: {values.min():.3f} least, {np.median(values):.3f} median, {values.max():.3f} most")


if __name__ == "__main__":
    main()
