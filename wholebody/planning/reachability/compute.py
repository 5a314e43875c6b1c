"""Compute a map: pairs are drawn, the still-posture search says which are held, and a network is fitted to that."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from models.spec import RobotSpec
from wholebody.config import ControllerConfig
from wholebody.errors import InputError
from wholebody.planning.posture import STARTS_MAX, PostureSolver
from wholebody.planning.reachability.network import Network, fit, inputs, likely, logits, untrained
from wholebody.planning.reachability.pairs import BOX_HIGH, BOX_LOW, LOAD_KNOWN, TURNS, Pairs, draw, draw_often_asked

HOPELESS = 0.45
"""Miss of the first start past which there is no other [m]; measured: of 350 pairs, those that a later start holds were
missed by up to 0.33."""
PAIRS_A_ROUND = 1000
"""Pairs that are searched for between two fits; chosen."""
POOL = 20
"""Pairs from which one is chosen, the nearer to the border the likelier."""
SHARE_ANYWHERE = 0.2
"""Share of those that are taken wherever they are; chosen: the network is to be surprised, too."""
EPOCHS = 8
"""Times that every pair is seen by a fit in between; chosen."""
TEACHERS, TEACHER, TEACHER_EPOCHS, DROPPED = 4, (192, 4), 120, 0.1
"""Networks fitted in the end, their width and hidden layers, times that they see every pair, and share of neurons
dropped; measured: deeper ones are right more often, and too slow to be asked by everyone."""
TAUGHT, LESSONS = 8, 40
"""Pairs that the map is taught for each that was searched for, by what the mean of those says of them, and times that
it sees them; measured: it is then right nearly as often as they are."""


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
        """Keep new samples, and the CPU time that they took [s]."""
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
            "starts": STARTS_MAX,
            "low": BOX_LOW.tolist(),
            "high": BOX_HIGH.tolist(),
            "load_known": LOAD_KNOWN,
            "turns": list(TURNS),
        }


def search(solver: PostureSolver, pairs: Pairs, starts: int = STARTS_MAX, hopeless: float = HOPELESS) -> np.ndarray:
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
    at_once: int = PAIRS_A_ROUND,
) -> Network:
    """Network fitted to the samples that a CPU time allows, earlier runs included.

    Args:
        spec: The robot.
        config: Bounds and margins.
        samples: Where what is found is kept.
        seconds: CPU time [s]; fits at the end come on top.
        tell: Gets a line a round.
        at_once: Pairs that are searched for between two fits.
    """
    solver, network = PostureSolver(spec, config), untrained(np.random.default_rng(0))
    while samples.spent < seconds or not len(samples.held):
        begin, generator = time.process_time(), np.random.default_rng(len(samples.held))
        chosen = draw(at_once, generator)
        if len(samples.held):
            x = inputs(samples.pairs)
            network = fit(network, x, samples.held, EPOCHS, generator)
            chosen = _near_the_border(network, at_once, generator)
        samples.add(chosen, search(solver, chosen), time.process_time() - begin)
        tell(f"{len(samples.held)} pairs, {samples.held.mean():.0%} held, {samples.spent:.0f} of {seconds:.0f} s")
    tell("fitting: some minutes for each ten of the search")
    return taught(samples)


def taught(samples: Samples) -> Network:
    """A network that says of any pair what several, each fitted to the samples, say of it in the mean."""
    return pupil([teacher(samples, seed) for seed in range(TEACHERS)], TAUGHT * len(samples.held))


def teacher(samples: Samples, seed: int) -> Network:
    """A deep network fitted to the samples."""
    generator = np.random.default_rng(seed)
    network = untrained(generator, *TEACHER)
    return fit(network, inputs(samples.pairs), samples.held, TEACHER_EPOCHS, generator, dropped=DROPPED)


def pupil(teachers: list[Network], n: int) -> Network:
    """A network that is asked in microseconds, fitted to what its teachers say of n pairs."""
    generator = np.random.default_rng(len(teachers))
    asked = draw_often_asked(n, generator)
    answers = np.mean([logits(one, asked) for one in teachers], axis=0)
    return fit(untrained(generator), inputs(asked), likely(answers), LESSONS, generator)


def _near_the_border(network: Network, n: int, generator: np.random.Generator) -> Pairs:
    """Pairs drawn with a probability that grows with the network's uncertainty."""
    pool = draw_often_asked(POOL * n, generator)
    likelihood = likely(logits(network, pool))
    unsure = likelihood * (1.0 - likelihood)
    chance = (1.0 - SHARE_ANYWHERE) * unsure / unsure.sum() + SHARE_ANYWHERE / len(pool)
    return pool[generator.choice(len(pool), n, replace=False, p=chance)]
