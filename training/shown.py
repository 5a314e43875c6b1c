"""``python -m training.shown PLAIN WHOLE``: copy a dataset with a column of what is shown of the task.

`lerobot-record` writes those numbers into ``observation.state``; ACT and Diffusion want pictures, or them alone in
``observation.environment_state``, as the environment has them.

Statistics are those of all frames, with a floor under each range: LeRobot divides by the standard deviation, which of a
hand that is never turned is 0, and then a thousandth of a degree is a hundred deviations.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from policy.dataset.stats import statistics, widened

STATE, SHOWN, ACTION = "observation.state", "observation.environment_state", "action"
LEAST = 0.05
"""Least range of a number, whatever it is [m, or no unit]; chosen: its standard deviation is then 1 cm, or half a
degree in a rotation, which is more than a robot that stands still is off, and less than any task moves a hand."""


def shown_columns(names: Sequence[str]) -> list[int]:
    """Columns of what is shown of a task, of the state's names."""
    return [k for k, name in enumerate(names) if name.startswith(("to_goal_", "to_streak_", "object_", "to_object_"))]


def add_shown(plain: Path, whole: Path) -> None:
    """Copy the dataset of a folder to another one, with the column."""
    from lerobot.datasets.dataset_tools import add_features
    from lerobot.datasets.io_utils import write_stats
    from lerobot.datasets.lerobot_dataset import LeRobotDataset

    dataset = LeRobotDataset("loop/recorded", root=plain)
    names = dataset.features[STATE]["names"]
    columns = shown_columns(names)
    shown = [names[column] for column in columns]
    values = np.array(dataset.hf_dataset.with_format("numpy")[STATE], dtype=np.float32)[:, columns]
    feature = {"dtype": "float32", "shape": (len(shown),), "names": shown}
    made = add_features(dataset, {SHOWN: (values, feature)}, output_dir=whole, repo_id="loop/data")
    frames = made.hf_dataset.with_format("numpy")
    stats = made.meta.stats | {
        name: widened(statistics(np.stack(frames[name])), np.full(made.features[name]["shape"], LEAST))
        for name in (STATE, SHOWN, ACTION)
    }
    write_stats(stats, whole)


if __name__ == "__main__":
    add_shown(Path(sys.argv[1]), Path(sys.argv[2]))
