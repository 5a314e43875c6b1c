"""From quantities of a chunk to probabilities: a fitted model in a file, read with checks."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path

import numpy as np

from wholebody.errors import InputError
from wholebody.verdict.calibration.odds import Chance, Odds
from wholebody.verdict.calibration.scale import Scale
from wholebody.verdict.calibration.trees import Trees

VERSION = 2
"""Version of the file's layout."""
SHIPPED = Path(__file__).with_name("g1_dex3.npz")
"""Fitted to the default settings."""
ANSWERS = ("fall_as_given", "followed")
WORLD = "realistic"
"""World that the probabilities are about; chosen: what a robot with errors as assumed would do."""
INTERVAL_LEVEL = 0.9
"""Level of the intervals [no unit]; chosen."""
QUANTITIES_NAMED = 3
"""Quantities at most by which an unlike chunk is described."""
_SCALE = ("unit", "mean", "spread", "low", "high")


class Calibration:
    """Probabilities of what becomes of a chunk.

    Args:
        names: Of the quantities, in their order; that of `with_world` is the last one.
        scale: Of the quantities.
        trees: By the order of `ANSWERS`.
        shape: Inverse covariance of the standard quantities fitted to, shape (n, n).
        card: What it was fitted to: ``alarm``, the probability of a fall from which an alarm is due or 0, ``near``, the
            distance up to which a chunk is like those, ``covers``, what else some of those were (begun in motion),
            and whatever else is to be known of it.
    """

    def __init__(self, names: Sequence[str], scale: Scale, trees: Trees, shape: np.ndarray, card: Mapping) -> None:
        self.names, self.scale, self.trees, self.shape, self.card = tuple(names), scale, trees, shape, dict(card)

    @staticmethod
    def read(path: Path) -> Calibration:
        """A model from a file.

        Raises:
            InputError: If it is none, or one of another version.
        """
        wrong = f"{path} is no calibration; `python -m tests.studies.calibrate` writes one"
        try:
            with np.load(path, allow_pickle=False) as file:
                card = json.loads(str(file["card"]))
                scale = Scale(*(np.asarray(file[name], float) for name in _SCALE))
                bound, leaf, shape = (np.asarray(file[name], float) for name in ("bound", "leaf", "shape"))
                trees = Trees(np.asarray(file["quantity"], int), bound, leaf)
        except (KeyError, ValueError, EOFError) as error:
            raise InputError(wrong) from error
        if not isinstance(card, dict) or card.get("version") != VERSION:
            raise InputError(f"{path} is a calibration of another version than {VERSION}; fit it anew")
        names = card.get("names", ())
        n = len(names)
        sound = all(getattr(scale, name).shape == (n,) for name in _SCALE) and shape.shape == (n, n)
        sound = sound and trees.sound(n) and len(trees.leaf) == len(ANSWERS)
        sound = sound and all(np.isfinite(part).all() for part in (shape, *(getattr(scale, name) for name in _SCALE)))
        if not sound or not {"alarm", "near", "chunks"} <= card.keys():
            raise InputError(wrong)
        return Calibration(names, scale, trees, shape, card)

    def write(self, path: Path) -> None:
        """Write it to a file, in single precision, and what the trees add up in half precision."""
        card = json.dumps({**self.card, "version": VERSION, "names": self.names})
        arrays = {name: getattr(self.scale, name) for name in _SCALE} | {"shape": self.shape}
        single = {name: value.astype(np.float32) for name, value in (arrays | {"bound": self.trees.bound}).items()}
        trees = {"quantity": self.trees.quantity.astype(np.uint8), "leaf": self.trees.leaf.astype(np.float16)}
        np.savez_compressed(path, card=card, **trees, **single)

    def rows(self, found: Sequence[Mapping[str, float]], world: str | Sequence[str] = WORLD) -> np.ndarray:
        """Quantities as numbers, shape (m, n)."""
        worlds = [world] * len(found) if isinstance(world, str) else world
        both = [with_world(one, world) for one, world in zip(found, worlds, strict=True)]
        return np.array([[one[name] for name in self.names] for one in both]).reshape(-1, len(self.names))

    def draws(self, x: np.ndarray) -> np.ndarray:
        """Probabilities by every draw of the data, of quantities (m, n), shape (2, draws, m).

        None is nearer to 0 or 1 than a share can be that so many chunks never showed (the rule of succession).
        """
        least = 1.0 / (self.card["chunks"] + 2.0)
        return np.clip(self.trees.probabilities(x), least, 1.0 - least)

    def probabilities(self, x: np.ndarray) -> np.ndarray:
        """Means of the draws, shape (2, m)."""
        return self.draws(x).mean(axis=1)

    def distance(self, x: np.ndarray) -> np.ndarray:
        """How far quantities (m, n) are from the middle of those fitted to, the fitted ones' mean square being 1."""
        z = self.scale.standard(x)
        return np.sqrt(np.einsum("mi,ij,mj->m", z, self.shape, z) / len(self.names))

    def unlike(self, x: np.ndarray) -> tuple[str, ...]:
        """Quantities in which the chunk farthest out of (m, n) is unlike those fitted to; none if it is like them."""
        distance = self.distance(x)
        worst = int(distance.argmax())
        if distance[worst] <= self.card["near"]:
            return ()
        z = self.scale.standard(x[worst])
        away = np.maximum(z - self.scale.high, self.scale.low - z)
        order = np.argsort(-away if (away > 0.0).any() else -np.abs(z))[:QUANTITIES_NAMED]
        return tuple(self.names[i] for i in order if away[i] > 0.0 or not (away > 0.0).any())

    def odds(
        self, found: Sequence[tuple[float, Mapping[str, float]]], other: Sequence[str] = (), world: str = WORLD
    ) -> Odds | None:
        """Odds of an input; None where no chunk was judged.

        Args:
            found: When each chunk begins [s], and its quantities.
            other: In what else the input may be unlike those fitted to; what those cover is not told.
            world: ``true`` or ``realistic``.
        """
        if not found:
            return None
        x, other = (
            self.rows([one for _, one in found], world),
            [one for one in other if one not in self.card.get("covers", ())],
        )
        draws = self.draws(x)
        falls, follows = draws.mean(axis=1)
        fall, followed, bound = int(falls.argmax()), int(follows.argmin()), self.card["alarm"]
        return Odds(
            fall_as_given=_chance(draws[0, :, fall]), fall_s=found[fall][0],
            followed=_chance(draws[1, :, followed]), followed_s=found[followed][0],
            alarm=bool(falls[fall] >= bound) if bound > 0.0 else None, unlike=(*other, *self.unlike(x)),
            chunks=len(found), fitted_to=int(self.card["chunks"]), world=world,
        )  # fmt: skip


def with_world(found: Mapping[str, float], world: str) -> dict[str, float]:
    """Quantities, and whether the world is realistic."""
    return {**found, "realistic": float(world == "realistic")}


def _chance(draws: np.ndarray) -> Chance:
    low, high = np.quantile(draws, (0.5 - 0.5 * INTERVAL_LEVEL, 0.5 + 0.5 * INTERVAL_LEVEL))
    p = float(draws.mean())  # past the interval where a few draws are far from all others
    return Chance(p=p, low=min(float(low), p), high=max(float(high), p))


@lru_cache(maxsize=1)
def shipped() -> Calibration:
    """The model that comes with the package."""
    return Calibration.read(SHIPPED)
