"""Walks in MuJoCo by the walker alone: on the spot, at speeds, stopped at random, pushed; a line each.

    python -m tests.studies.walks spot 0 5 --realistic
    python -m tests.studies.walks speeds 0 1
    python -m tests.studies.walks stops 0 20
    python -m tests.studies.walks pushes 0 8 --impulse 8
    python -m tests.studies.walks pushes 0 24 --impulse 8 --speed "0.2 ahead"
    python -m tests.studies.walks grounds 0 1 --ground "2 cm" "friction 0.5"

The numbers are those of seeds, of directions for pushes; the last line has medians and worst. The robot has 43 joints.
"""

import argparse
from itertools import product

import numpy as np

from tests.support.walks import GROUNDS, START, rms, walk
from wholebody.walking.places import Velocity

SPEEDS = {
    "0.1 ahead": Velocity(0.1 + 0j),
    "0.2 ahead": Velocity(0.2 + 0j),
    "0.3 ahead": Velocity(0.3 + 0j),
    "0.4 ahead": Velocity(0.4 + 0j),
    "0.5 ahead": Velocity(0.5 + 0j),
    "0.2 back": Velocity(-0.2 + 0j),
    "0.25 back": Velocity(-0.25 + 0j),
    "0.15 aside": Velocity(0.15j),
    "0.2 aside": Velocity(0.2j),
    "0.5 rad/s": Velocity(0j, 0.5),
    "0.3, 0.3 rad/s": Velocity(0.3 + 0j, 0.3),
} | {f"mixed-{k}": Velocity(complex(x, y), 0.29) for k, (x, y) in enumerate(product((0.23, -0.145), (0.115, -0.115)))}
WALKING, AFTER = 4.0, 4.5
"""Time for which a speed is told, and that is waited after it [s]."""


def told(velocity, stop):
    def tell(one, time):
        wanted = velocity if time < stop else Velocity()
        if one.guide.wanted != wanted:
            one.guide.follow(wanted)

    return tell


def spot(seeds, realistic, **_):
    for seed in seeds:

        def tell(one, time):
            one.marches = time < 20.0

        yield f"spot {seed}", walk(tell, 20.0 + AFTER, seed=seed if realistic else None), 20.0


def speeds(seeds, realistic, speed, **_):
    for name in speed or SPEEDS:
        for seed in seeds:
            stop = START + WALKING
            yield (
                f"{name}, {seed}",
                walk(told(SPEEDS[name], stop), stop + AFTER, seed=seed if realistic else None),
                stop,
            )


def grounds(seeds, realistic, ground, **_):
    """Walks at some speeds where it is told nothing of the floor, or of what it holds."""
    for where in ground or GROUNDS:
        for name in ("0.3 ahead", "0.2 back", "0.15 aside"):
            for seed in seeds:
                stop, seeded = START + WALKING, seed if realistic else None
                one = walk(told(SPEEDS[name], stop), stop + AFTER, seed=seeded, ground=where)
                yield f"{where}: {name}, {seed}", one, stop


def stops(seeds, realistic, **_):
    for seed in seeds:
        rng = np.random.default_rng(seed)
        velocity = Velocity(complex(rng.uniform(-0.2, 0.4), rng.uniform(-0.12, 0.12)), rng.uniform(-0.4, 0.4))
        stop = START + rng.uniform(1.5, 3.0)
        result = walk(told(velocity, stop), stop + AFTER, seed=seed if realistic else None)
        yield f"stop {seed} of {velocity.way:.2f}, {velocity.turn:.2f}", result, stop


def pushes(seeds, realistic, impulse, speed, **_):
    """Pushed for 0.1 s at the torso in eight directions, 0 ahead, to the left first: on the spot, or while walking.

    On the spot each direction comes 0.09 s later, and walking each round of them 0.25 s later.
    """
    for name in speed or [None]:
        for seed in seeds:
            angle, walks = 0.25 * np.pi * seed, name is not None
            force = 10.0 * impulse * np.array([np.cos(angle), np.sin(angle), 0.0])
            begin, stop = (START + 2.0 + 0.25 * (seed // 8), START + 4.5) if walks else (3.0 + 0.09 * seed, 6.0)

            def march(one, time):
                one.marches = time < 6.0

            push = ("torso_link", force, begin, 0.1)
            tell = told(SPEEDS[name], stop) if walks else march
            result = walk(tell, stop + AFTER, seed=seed if realistic else None, pushes=[push])
            where = f"{name}, {begin:.2f} s" if walks else "on the spot"
            yield f"push {impulse:g} N s at {45 * (seed % 8)} deg, {where}", result, stop


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=("spot", "speeds", "stops", "pushes", "grounds"))
    parser.add_argument("first", type=int)
    parser.add_argument("last", type=int)
    parser.add_argument("--realistic", action="store_true", help="seeds of realistic worlds, the state estimated")
    parser.add_argument("--impulse", type=float, default=8.0, help="of a push [N s]")
    parser.add_argument(
        "--speed", nargs="+", choices=SPEEDS, help="speeds to walk with; if not given all, pushes on the spot"
    )
    parser.add_argument("--ground", nargs="+", choices=GROUNDS, help="grounds to walk on; all if not given")
    given = parser.parse_args()
    runs = {"spot": spot, "speeds": speeds, "stops": stops, "pushes": pushes, "grounds": grounds}[given.what]
    found = []
    told_of = {"impulse": given.impulse, "speed": given.speed, "ground": given.ground}
    for name, one, stop in runs(range(given.first, given.last), given.realistic, **told_of):
        off = 1e3 * one.errors[250:]
        row = (rms(off), off.max(), off[-1], one.stopped - stop, one.made)
        found.append((one.fell is not None, one.stands, *row))
        drift = "; the base was estimated {:.1f} mm off, {:.1f} as told".format(*(1e3 * np.array(one.drift)))
        end = f"fell at {one.fell:.2f} s" if one.fell is not None else "stands" if one.stands else "steps on"
        print(
            f"{name}: {end}; palms {row[0]:.2f} mm RMS, {row[1]:.1f} at most, {row[2]:.2f} at the end; stood after "
            f"{row[3]:.2f} s; {one.made} steps; {one.load:.0f} N; {one.missed} ticks not whole"
            + drift
            * given.realistic,
            flush=True,
        )
    fell, stands, root, most, last, after, _ = np.array(found, dtype=float).T
    print(
        f"{int(fell.sum())} of {len(fell)} fell, {int(stands.sum())} stand; palms {np.median(root):.2f} mm RMS "
        f"(worst {root.max():.2f}), {most.max():.1f} at most, {last.max():.2f} at the end; stood after "
        f"{np.median(after):.2f} s (worst {after.max():.2f})"
    )


if __name__ == "__main__":
    main()
