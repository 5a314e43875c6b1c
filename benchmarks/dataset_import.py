"""How long the importer takes to read actions by name, beside reading the same features as they are.

    python benchmarks/dataset_import.py

Sets in the format v3.0 with as many episodes and columns each, written with pyarrow; both read all episodes, in turn,
in one process. The importer opens the set, finds the columns by name and puts them in the order of a layout; the plain
reader opens it and reads its features. Processor time, the least of some rounds; the ratio is what matters.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from policy.dataset.checks import column_layout
from policy.dataset.format import _file, vectors
from policy.dataset.naming.sources import find_source
from policy.dataset.open import open_dataset
from tests.support.other_forms import JOINT28
from tests.support.written_datasets import write_dataset

PARTS = {".left_arm": JOINT28[:7], ".right_arm": JOINT28[7:14], ".left_hand": JOINT28[14:21],
         ".right_hand": JOINT28[21:]}  # fmt: skip


def plain(folder: Path) -> float:
    """Read the features of the actions of every episode; the sum of them, so that they are read."""
    dataset, total = open_dataset(folder), 0.0
    features = [key for key in dataset.features if key.startswith("action")]
    for episode in dataset.episodes:
        rows = dataset.table(episode, features)
        for key in features:
            width = dataset.features[key]["shape"][0]
            total += float(vectors(rows.column(key), width, key, episode).sum())
    return total


def named(folder: Path) -> float:
    """Read the actions of every episode by name, in the order of their layout."""
    dataset, total = open_dataset(folder), 0.0
    source = find_source(dataset, "action")
    layout = column_layout(dataset, source)
    pick = layout.columns_of(layout.whole_spec)
    for episode in dataset.episodes:
        rows = dataset.table(episode, list(source.features))
        total += float(source.of(rows, episode, pick).sum())
    return total


def seconds(read, folder: Path) -> float:
    """Processor time of one reading, from the files [s]."""
    _file.cache_clear()
    begin = time.process_time()
    read(folder)
    return time.process_time() - begin


def main() -> None:
    """Print a row a set."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--episodes", type=int, default=200)
    parser.add_argument("--frames", type=int, default=600)
    parser.add_argument("--rounds", type=int, default=15)
    given = parser.parse_args()
    rng = np.random.default_rng(0)
    rows = [rng.uniform(-0.3, 0.3, (given.frames, 28)) for _ in range(given.episodes)]
    whole = [{"action": x, "observation.state": x} for x in rows]
    backwards = dict.fromkeys(("action", "observation.state"), JOINT28[::-1])
    split = [{f"{key}{part}": x[:, [JOINT28.index(n) for n in names]] for key in ("action", "observation.state")
              for part, names in PARTS.items()} for x in rows]  # fmt: skip
    names = {f"{key}{part}": names for key in ("action", "observation.state") for part, names in PARTS.items()}
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        sets = {
            "named": write_dataset(place / "a", whole, dict.fromkeys(backwards, JOINT28)),
            "named, another order": write_dataset(place / "b", whole, backwards),
            "split into four": write_dataset(place / "c", split, names),
        }
        least = {name: [np.inf, np.inf] for name in sets}
        for _ in range(given.rounds):
            for name, one in sets.items():
                for i, read in enumerate((plain, named)):
                    least[name][i] = min(least[name][i], seconds(read, one))
    print(f"{given.episodes} episodes of {given.frames} rows, the least of {given.rounds} rounds, ms")
    for name, (as_it_is, by_name) in least.items():
        print(f"{name:<24} plain {1e3 * as_it_is:7.1f}   by name {1e3 * by_name:7.1f}   ratio {by_name / as_it_is:.2f}")


if __name__ == "__main__":
    main()
