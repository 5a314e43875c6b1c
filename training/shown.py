"""``python -m training.shown PLAIN WHOLE``: copy a dataset with a column of what is shown of the task.

`lerobot-record` writes those numbers into ``observation.state``; ACT and Diffusion want pictures, or them alone in
``observation.environment_state``, as the environment has them.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

STATE, SHOWN = "observation.state", "observation.environment_state"


def add_shown(plain: Path, whole: Path) -> None:
    """Copy the dataset of a folder to another one, with the column."""
    from lerobot.datasets.dataset_tools import add_features
    from lerobot.datasets.lerobot_dataset import LeRobotDataset

    dataset = LeRobotDataset("loop/recorded", root=plain)
    names = dataset.features[STATE]["names"]
    shown = [name for name in names if name.startswith(("goal_", "object_"))]
    columns = [names.index(name) for name in shown]
    values = np.array(dataset.hf_dataset.with_format("numpy")[STATE], dtype=np.float32)[:, columns]
    feature = {"dtype": "float32", "shape": (len(shown),), "names": shown}
    add_features(dataset, {SHOWN: (values, feature)}, output_dir=whole, repo_id="loop/data")


if __name__ == "__main__":
    add_shown(Path(sys.argv[1]), Path(sys.argv[2]))
