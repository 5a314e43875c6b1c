"""A checkpoint against the dataset it was trained on: rate, names, cameras, tasks, and statistics computed anew.

The q01 and q99 that LeRobot 0.6.1 writes into ``meta/stats.json`` are means of each episode's quantiles, not quantiles
of the data: where episodes differ, much of the data lies outside, and a network trained so is used outside [-1, 1].
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from policy.action_spec.spec import ActionSpec
from policy.dataset.format import read_json
from policy.dataset.forms import v21, v30
from policy.dataset.forms.tables import read_parquet
from policy.dataset.open import check_info
from policy.dataset.stats import statistics
from policy.errors import DatasetError
from policy.findings import Finding, fail
from policy.lerobot.checkpoint import Checkpoint
from policy.lerobot.features import camera_keys, compare_names, relative_step
from policy.lerobot.prompt import longest_prompt, token_count, tokenizer_step
from policy.lerobot.stats import ACTION, RANGES, STATE, mode_of, normaliser

STATS_TOLERANCE = 0.02
"""Part of a number's range by which statistics may differ from those of the data. LeRobot's histograms of 5000 bins
are within 0.0002 of an episode's range; averages over episodes are off by tenths."""


@dataclass(frozen=True)
class TrainingData:
    """A LeRobot dataset folder (v3.0 or v2.1), read without its images.

    Attributes:
        folder: Where ``meta`` and ``data`` are.
        info: Content of ``meta/info.json``.
    """

    folder: Path
    info: Mapping[str, Any]

    @classmethod
    def open(cls, folder: str | Path) -> TrainingData:
        """Read what the dataset says about itself.

        Raises:
            CheckpointError: If there is no dataset.
        """
        file = Path(folder) / "meta" / "info.json"
        try:
            # The same checks as for a dataset that is converted.
            check_info(Path(folder), info := read_json(file))
        except DatasetError as error:
            cure = "give the folder of a LeRobot dataset, the one with meta and data in it"
            raise fail("dataset", f"{file} cannot be read: {error}", cure) from error
        return cls(Path(folder), {"fps": info["fps"], "features": info["features"]})

    @property
    def cameras(self) -> set[str]:
        """Keys of the image features."""
        return {key for key, feature in self.info["features"].items() if feature["dtype"] in ("image", "video")}

    def names(self, key: str) -> list[str] | None:
        """Names of a feature's numbers, None if it gives none."""
        names = self.info["features"].get(key, {}).get("names")
        if isinstance(names, Mapping):
            names = next(iter(names.values()), None)
        return [str(name) for name in names] if isinstance(names, list) and names else None

    @cached_property
    def tasks(self) -> list[str]:
        """Every task of the dataset."""
        meta = self.folder / "meta"
        if (meta / "tasks.jsonl").is_file():
            return list(v21.read_tasks(meta / "tasks.jsonl"))
        return list(v30.read_tasks(self.folder)) if (meta / "tasks.parquet").is_file() else []

    def values(self, key: str) -> np.ndarray:
        """Every number of a feature, shape (frames, n).

        Raises:
            CheckpointError: If it is not there, or not finite.
        """
        import pyarrow

        files = sorted((self.folder / "data").rglob("*.parquet"))
        try:
            columns = [read_parquet(file, [key]).column(key) for file in files]
            rows = np.concatenate([np.stack(column.to_numpy()) for column in columns]).astype(float)
        except (OSError, ValueError, TypeError, KeyError, pyarrow.ArrowException) as error:
            cure = "record or convert the dataset again; a recording without finalize() has no readable files"
            raise fail("dataset", f"{self.folder} has no readable '{key}': {error}", cure) from error
        if not np.isfinite(rows).all():
            frame, i = (int(index) for index in np.argwhere(~np.isfinite(rows))[0])
            text = f"'{key}' of {self.folder} is {rows[frame, i]} at frame {frame}, number {i}"
            raise fail("dataset", text, "remove that episode")
        return rows

    def own_stats(self, key: str) -> Mapping[str, np.ndarray]:
        """What ``meta/stats.json`` says of a feature; empty if nothing."""
        file = self.folder / "meta" / "stats.json"
        if not file.is_file():
            return {}
        try:
            stats = read_json(file).get(key, {})
            return {name: np.asarray(value, dtype=float).ravel() for name, value in stats.items()}
        except (AttributeError, ValueError, TypeError) as error:
            text = f"{file} has statistics of '{key}' that are no numbers: {error}"
            raise fail("dataset", text, "let LeRobot make them anew") from error


def check_training_data(checkpoint: Checkpoint, data: TrainingData) -> list[Finding]:
    """Everything of a checkpoint that its dataset can confirm.

    Raises:
        CheckpointError: If the dataset cannot be read.
    """
    try:
        return _check_training_data(checkpoint, data)
    except DatasetError as error:
        raise fail("dataset", str(error), "record, convert or download the dataset again") from error


def _check_training_data(checkpoint: Checkpoint, data: TrainingData) -> list[Finding]:
    config, spec = checkpoint.network.config, checkpoint.spec
    findings = [*_check_rate(spec, data), *_check_cameras(config, data), *_check_tasks(checkpoint, data)]
    pre, post = normaliser(checkpoint.preprocessor), normaliser(checkpoint.postprocessor, inverse=True)
    relative = relative_step(checkpoint.preprocessor) is not None
    parts = [(ACTION, "ACTION", post, spec), (STATE, "STATE", pre, checkpoint.state)]
    for key, kind, step, layout in parts:
        if step is None or layout is None:
            continue
        names = data.names(key)
        if names:
            findings += compare_names("dataset", key, names, layout, f"{data.folder}")
        if key == ACTION and relative:
            text = "statistics of relative actions depend on how training cut its chunks; they are not recomputed"
            findings.append(Finding("dataset", "warning", text))
        else:
            findings += _check_stats(key, mode_of(step, kind), step.stats.get(key, {}), layout, data)
    if not findings:
        text = f"rate, cameras, tasks and statistics are those of {data.folder}"
        return [Finding("dataset", "ok", text)]
    return findings


def _check_rate(spec: ActionSpec, data: TrainingData) -> Iterator[Finding]:
    fps = float(data.info["fps"])
    if fps != spec.fps:
        text = f"{data.folder} has {fps:g} frames/s, '{spec.name}' plays chunks at {spec.fps:g} Hz"
        cure = f"motions would be {spec.fps / fps:.2g} times as fast: write fps {fps:g} into action_spec.json"
        yield Finding("dataset", "error", text, cure)


def _check_cameras(config: Any, data: TrainingData) -> Iterator[Finding]:
    wanted = set(camera_keys(config).values())
    missing = sorted(wanted - data.cameras)
    if missing:
        text = f"{data.folder} has the cameras {', '.join(sorted(data.cameras)) or 'none'}, not {', '.join(missing)}"
        yield Finding(
            "dataset", "error", text, "the checkpoint was trained on another dataset, or cameras were renamed"
        )


def _check_tasks(checkpoint: Checkpoint, data: TrainingData) -> Iterator[Finding]:
    config, step = checkpoint.network.config, tokenizer_step(checkpoint.preprocessor)
    if step is None:
        return
    counts = [(token_count(step, longest_prompt(config, checkpoint.state, task)), task) for task in data.tasks]
    most, task = max(counts, default=(0, ""))
    if most > step.max_length:
        text = f"the task '{task}' makes a prompt of up to {most} tokens; {step.max_length} are kept, from the left"
        yield Finding("dataset", "error", text, "shorten the task and train again: the network never saw its end")
    if any(not task.strip() for _, task in counts):
        yield Finding("dataset", "warning", "some episodes have no task", "give every episode its task")


def _check_stats(
    key: str, mode: str, stored: Mapping[str, Any], layout: ActionSpec, data: TrainingData
) -> Iterator[Finding]:
    if mode not in RANGES or any(name not in stored for name in RANGES[mode]):
        return
    values = data.values(key)
    if values.shape[1] != layout.dim:
        text = f"'{key}' of {data.folder} has {values.shape[1]} numbers; '{layout.name}' has {layout.dim}"
        yield Finding("dataset", "error", text, "give the dataset that the checkpoint was trained on")
        return
    first, second = (np.asarray(stored[name], dtype=float).ravel() for name in RANGES[mode])
    if len(first) != layout.dim:
        text = f"{key} is converted before it is normalised; its statistics are not recomputed"
        yield Finding("dataset", "warning", text)
        return
    true = statistics(values)
    off = _difference(mode, (first, second), tuple(true[name] for name in RANGES[mode]))
    if not off.max() > STATS_TOLERANCE:
        return
    i, (low, high) = int(off.argmax()), RANGES[mode]
    text = (
        f"{key} {layout.feature_names[i]}: {low} {first[i]:.4g} and {high} {second[i]:.4g} in the checkpoint, "
        f"{true[low][i]:.4g} and {true[high][i]:.4g} in the data"
    )
    if mode != "MEAN_STD":
        outside = float(((values < first) | (values > second)).mean())
        text += f"; {100.0 * outside:.1f} % of the data lie outside -1 to 1"
    own = data.own_stats(key)
    trained_so = all(
        name in own and np.allclose(own[name], value, rtol=1e-4, atol=1e-6)
        for name, value in zip(RANGES[mode], (first, second), strict=True)
    )
    if trained_so:
        # The network was trained with these, so it must be run with them.
        cure = (
            "meta/stats.json has the same, as LeRobot writes them: means over episodes. Run it with them; for the next "
            "training, make the processors with policy.dataset.stats.statistics"
        )
        yield Finding("dataset", "warning", text, cure)
    else:
        yield Finding("dataset", "error", text, "the processors were saved with statistics of other data")


def _difference(mode: str, stored: tuple[np.ndarray, np.ndarray], true: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """How far statistics are from the true ones, in ranges (standard deviations for mean and std), shape (n,)."""
    width = true[1] if mode == "MEAN_STD" else true[1] - true[0]
    # Where data do not move, any range is a choice; it counts only if the data are outside.
    scale = np.maximum(width, np.abs(stored[1] if mode == "MEAN_STD" else stored[1] - stored[0]))
    scale = np.where(scale > 0.0, scale, 1.0)
    return np.maximum(np.abs(stored[0] - true[0]), np.abs(stored[1] - true[1])) / scale
