"""Statistics of a dataset: of all frames alike, where LeRobot 0.6.1 averages the quantiles of episodes.

A network that normalises by quantiles sees its training data in [-1, 1] only if q01 and q99 are those of the data. The
mean of each episode's quantiles is narrower wherever episodes differ.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from policy.action_spec.slot import UNITS
from policy.action_spec.spec import ActionSpec
from policy.errors import DatasetError

QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}
"""Quantiles that LeRobot's normalisers may ask for."""
WIDTH_MIN = 1e-3
"""Least distance from q01 to q99 of a number that moves, in SI: a millimetre, a milliradian, a thousandth. A
demonstration resolves no less; dividing by it turns encoder noise (about 1e-4 rad) into a tenth of the range."""
DEVIATIONS_99 = 4.65
"""Distance from the 1 % to the 99 % quantile of a normal distribution, in standard deviations."""


def statistics(values: np.ndarray) -> dict[str, np.ndarray]:
    """What LeRobot stores of a column, over frames (n,) or (n, D): each (D,), and ``count`` (1,)."""
    # In double: single precision loses the mean of a large index.
    columns = np.asarray(values, dtype=float).reshape(len(values), -1)
    found = {
        "min": columns.min(axis=0),
        "max": columns.max(axis=0),
        "mean": columns.mean(axis=0),
        "std": columns.std(axis=0),
        "count": np.array([len(columns)]),
    }
    return found | dict(zip(QUANTILES, np.quantile(columns, list(QUANTILES.values()), axis=0), strict=True))


def merged(parts: Sequence[Mapping[str, Mapping[str, Any]]]) -> dict[str, dict[str, Any]]:
    """Statistics over all episodes from those of each; of quantiles, which cannot be merged, none.

    Args:
        parts: By feature and name; a feature that one part lacks is left out.

    Raises:
        DatasetError: If they are no numbers, or of different shapes.
    """
    keys = [key for key in (parts[0] if parts else {}) if all(key in part for part in parts)]
    try:
        return {key: _merged([part[key] for part in parts]) for key in keys}
    except (ValueError, TypeError, KeyError, IndexError, OverflowError) as error:
        raise DatasetError(f"the statistics of the episodes are no tables of the same shape: {error}") from error


def narrow(stats: Mapping[str, np.ndarray], layout: ActionSpec, least: float = WIDTH_MIN) -> np.ndarray:
    """Numbers of a layout that hardly move: indices whose q01 and q99 are nearer than ``least`` in SI."""
    return np.flatnonzero(~(stats["q99"] - stats["q01"] >= in_units(layout, least)))


def widened(stats: Mapping[str, np.ndarray], widths: np.ndarray) -> dict[str, np.ndarray]:
    """Statistics with a floor under every range that a normaliser divides by; centres stay.

    Args:
        stats: As from `statistics`.
        widths: Least distance between min and max, and q01 and q99, of each number (D,); 0 changes nothing.
    """
    changed = dict(stats)
    for low, high in (("min", "max"), ("q01", "q99"), ("q10", "q90")):
        # What LeRobot divides by between q10 and q90 must be no less either.
        missing = np.maximum(widths - (stats[high] - stats[low]), 0.0)
        changed[low], changed[high] = stats[low] - 0.5 * missing, stats[high] + 0.5 * missing
    changed["std"] = np.maximum(stats["std"], widths / DEVIATIONS_99)
    return changed


def plain(stats: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, Any]]:
    """Statistics as lists, for JSON and parquet."""
    return {key: {name: np.asarray(value).tolist() for name, value in found.items()} for key, found in stats.items()}


def _merged(parts: list[Mapping[str, Any]]) -> dict[str, Any]:
    by_name = {
        name: np.stack([np.asarray(part[name], dtype=float) for part in parts])
        for name in ("min", "max", "mean", "std", "count")
    }
    shape = (-1,) + (1,) * (by_name["mean"].ndim - 1)
    count = by_name["count"].reshape(shape)
    share = count / count.sum()
    mean = (share * by_name["mean"]).sum(axis=0)
    spread = (share * (by_name["std"] ** 2 + (by_name["mean"] - mean) ** 2)).sum(axis=0)
    return {
        "min": by_name["min"].min(axis=0).tolist(),
        "max": by_name["max"].max(axis=0).tolist(),
        "mean": mean.tolist(),
        "std": np.sqrt(spread).tolist(),
        "count": [int(count.sum())],
    }


def in_units(layout: ActionSpec, least: float) -> np.ndarray:
    """A width in SI in the numbers of a layout, shape (dim,)."""
    return np.concatenate([np.full(slot.size, least / abs(UNITS[slot.kind][slot.unit][0])) for slot in layout.slots])
