"""Whether a task was done, from the states of an episode alone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lerobot_robot_wholebody.target import Numbers, palm_of
from lerobot_robot_wholebody.tasks import REACHED, SIDES, THINGS
from policy.geometry.rotations import rot6d_to_matrix
from policy.geometry.se3 import make_transform


def done(states: np.ndarray, names: Sequence[str], task: str) -> bool:
    """Whether it was done at the end of an episode.

    Args:
        states: A row a step, shape (n, S).
        names: Of their numbers.
        task: Its name.
    """
    last = dict(zip(names, states[-1].tolist(), strict=True))
    if task == "reach":
        return bool(max(_far(last, side) for side in SIDES) <= REACHED)
    about = THINGS[task]
    first, here = (
        np.array([row[names.index(f"object_{axis}.pos")] for axis in "xyz"]) for row in (states[0], states[-1])
    )
    return bool((here - first) @ np.array(about.way) >= about.least)


def _far(state: dict[str, float], side: str) -> float:
    """Distance of a palm from its goal [m]."""
    numbers = Numbers()
    wrist = [state[f"{side}_wrist_{axis}.pos"] for axis in "xyz"]
    R = rot6d_to_matrix(np.array([state[f"{side}_wrist_r6_{i}.pos"] for i in range(6)]), "cols")
    goal = [state[f"goal_{side}_{axis}.pos"] for axis in "xyz"]
    return float(np.linalg.norm(palm_of(make_transform(R, np.array(wrist)), side, numbers) - goal))
