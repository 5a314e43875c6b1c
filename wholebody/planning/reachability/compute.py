"""Compute a map: pairs are drawn, the still-posture search says which are held, and a network is fitted to that."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from models.spec import RobotSpec
from wholebody.config import ControllerConfig
from wholebody.errors import InputError
from wholebody.planning.posture import PostureSolver
from wholebody.planning.reachability.network import Network, fit, inputs, untrained
from wholebody.planning.reachability.pairs import HIGH, LOAD_KNOWN, LOW, TURNS, Pairs, draw, draw_often_asked

STARTS = 6
"""Postures from which each search begins; chosen: of 183 pairs near the border that any search held, 5 find 172 and 12
find 179."""
HOPELESS = 0.45
"""Miss of the first start past which there is no other [m]; measured: of 350 pairs, those that a later start holds were
missed by up to 0.33."""
ROUND = 1000
"""Pairs that are searched for between two fits; chosen."""
POOL = 20
"""Pairs from which one is chosen, the nearer to the border the likelier."""
ANYWHERE = 0.2
"""Share of those that are taken wherever they are; chosen: the network is to be surprised, too."""
EPOCHS, EPOCHS_LAST = 8, 100
"""Times that every pair is seen by a fit in between, and by the last one; chosen: after more it is surer than right."""


class Samples:
    """Pairs and how far they are missed, kept in a file after every round, so that a run goes on where one ended.

    Args:
        path: The file.
        made_for: Of which robot and bounds they are.

    Raises:
        InputError: If the file has those of others.

    Attributes:
        pairs: n of them.
        missed: As `PostureSolver.missed` says, shape (n,), [m].
        spent: CPU time so far [s].
    """

    def __init__(self, path: Path, made_for: str) -> None:
        self._path, self._basis = path, made_for
        self.pairs, self.missed, self.spent = draw(0, np.random.default_rng(0)), np.zeros(0), 0.0
        if path.exists():
            with np.load(path, allow_pickle=False) as file:
                self.pairs = Pairs(file["points"], file["turns"], file["loads"])
                self.missed, self.spent, found = file["missed"], float(file["spent"]), str(file["basis"])
            if found != made_for:
                raise InputError(
                    f"{path} has pairs of another robot or other bounds; give it another name or remove it"
                )

    @property
    def held(self) -> np.ndarray:
        """Which are held, shape (n,)."""
        return self.missed == 0.0

    def add(self, pairs: Pairs, missed: np.ndarray, spent: float) -> None:
        """Keep what was found, and the CPU time that it took [s]."""
        self.pairs, self.missed = Pairs.of([self.pairs, pairs]), np.concatenate([self.missed, missed])
        self.spent += spent
        kept = self._path.with_suffix(".part.npz")
        fields = {"points": self.pairs.points, "turns": self.pairs.turns, "loads": self.pairs.loads}
        np.savez_compressed(kept, **fields, missed=self.missed, spent=self.spent, basis=self._basis)
        kept.replace(self._path)

    def card(self) -> dict:
        """What a map is made from."""
        return {
            "basis": self._basis,
            "pairs": len(self.missed),
            "held": round(float(self.held.mean()), 4),
            "cpu_s": round(self.spent),
            "starts": STARTS,
            "low": LOW.tolist(),
            "high": HIGH.tolist(),
            "load_known": LOAD_KNOWN,
            "turns": list(TURNS),
        }


def search(solver: PostureSolver, pairs: Pairs, starts: int = STARTS, hopeless: float = HOPELESS) -> np.ndarray:
    """How far pairs are missed, 0 where a still posture holds them, shape (n,), [m]."""
    missed = np.zeros(len(pairs))
    for i in range(len(pairs)):
        solver.body.carry(pairs.loads[i])
        free = TURNS[pairs.turns[i]].free
        missed[i] = solver.missed(pairs.poses(i), orientation_free=free, starts=starts, hopeless=hopeless)
    return missed


def compute(
    spec: RobotSpec,
    config: ControllerConfig,
    samples: Samples,
    seconds: float,
    tell: Callable[[str], None],
    at_once: int = ROUND,
) -> Network:
    """A network fitted to what is found in a CPU time, that of runs before it counted in.

    Args:
        spec: The robot.
        config: Bounds and margins.
        samples: Where what is found is kept.
        seconds: CPU time [s]; fits at the end come on top.
        tell: Gets a line a round.
        at_once: Pairs that are searched for between two fits.
    """
    solver, network = PostureSolver(spec, config), untrained(np.random.default_rng(0))
    while samples.spent < seconds:
        begin, generator = time.process_time(), np.random.default_rng(len(samples.held))
        chosen = draw(at_once, generator)
        if len(samples.held):
            x = inputs(samples.pairs)
            network = fit(network, x, samples.missed, EPOCHS, generator)
            chosen = _near_the_border(network, at_once, generator)
        samples.add(chosen, search(solver, chosen), time.process_time() - begin)
        tell(f"{len(samples.held)} pairs, {samples.held.mean():.0%} held, {samples.spent:.0f} of {seconds:.0f} s")
    generator = np.random.default_rng(0)
    return fit(untrained(generator), inputs(samples.pairs), samples.missed, EPOCHS_LAST, generator)


def logits(network: Network, pairs: Pairs) -> np.ndarray:
    """Logarithm of the odds that pairs are held, shape (n,)."""
    w1, b1, w2, b2, w3, b3 = network.layers
    x = inputs(pairs)
    hidden = np.maximum(np.maximum(x @ w1 + b1, 0.0) @ w2 + b2, 0.0)
    return (hidden @ w3).sum(axis=0) + b3[0]


def _near_the_border(network: Network, n: int, generator: np.random.Generator) -> Pairs:
    """Pairs drawn with a chance that is the greater the less the network is sure of them."""
    pool = draw_often_asked(POOL * n, generator)
    unsure = 1.0 / (2.0 + 2.0 * np.cosh(logits(network, pool)))  # p (1 - p)
    chance = (1.0 - ANYWHERE) * unsure / unsure.sum() + ANYWHERE / len(pool)
    return pool[generator.choice(len(pool), n, replace=False, p=chance)]
