"""How often the map of reachability says what the search for still postures says, on pairs of palms drawn at random.

    python tests/support/reachability_agreement.py [KEPT.npz] [FIRST] [LAST]

Pair i is drawn by its own seed, whatever the map was made from; half have empty hands. The search begins from 12
postures, as `wholebody.solve` does. What it finds is kept in KEPT.npz every 50 pairs, and a later run goes on from
there.
"""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

from models import g1
from wholebody.config import ControllerConfig
from wholebody.planning.posture import STARTS_MAX, PostureSolver
from wholebody.planning.reachability.compute import Samples, search
from wholebody.planning.reachability.pairs import TURNS, Pairs, draw
from wholebody.planning.reachability.reach_map import basis, map_for

KEPT = Path(__file__).parents[1] / "studies" / "stored" / "reachability.npz"
SEED, AT_ONCE = 20_000_000, 50


def main(kept=KEPT, first=0, last=2000):
    spec, config = g1(), ControllerConfig()
    samples, solver = Samples(Path(kept), basis(spec, config)), PostureSolver(spec, config)
    for i in range(int(first) + len(samples.pairs), int(last), AT_ONCE):
        chosen = Pairs.of([draw(1, np.random.default_rng(SEED + k)) for k in range(i, min(i + AT_ONCE, int(last)))])
        samples.add(chosen, search(solver, chosen, STARTS_MAX, np.inf), 0.0)
    told = map_for(basis(spec, config))
    if told is None:
        return
    rooms, held = told.rooms(samples.pairs), samples.held
    print(agreement("all", rooms, held))
    for number, turn in enumerate(TURNS):
        mine = samples.pairs.turns == number
        print(agreement(turn, rooms[mine], held[mine]))
    empty = samples.pairs.loads.max(axis=1) == 0.0
    print(
        agreement("empty hands", rooms[empty], held[empty]), agreement("loaded", rooms[~empty], held[~empty]), sep="\n"
    )
    for sure in (2.0, 4.0):
        some = np.abs(rooms) > sure
        share = np.mean((rooms > 0.0) == held, where=some)
        print(f"of {some.mean():.1%} with odds of more than {np.exp(sure):.0f}: {share:.2%}")
    print(f"highest odds against a pair that is held: {np.exp(-rooms[held].min()):.0f}")


def agreement(name, rooms, held):
    """A line of the table."""
    yes = rooms > 0.0
    shares = (np.mean(yes == held), np.mean(yes[held]), np.mean(~yes[~held]), np.mean(np.abs(rooms) < 2.0))
    return f"| {name} | {len(held)} | {held.mean():.1%} | " + " | ".join(f"{share:.1%}" for share in shares) + " |"


if __name__ == "__main__":
    main(*sys.argv[1:])
