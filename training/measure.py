"""Whether a task was done, from the states of an episode alone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lerobot_robot_wholebody.tasks import REACHED, SIDES, THINGS


def done(states: np.ndarray, names: Sequence[str], task: str) -> bool:
    """Whether it was done at the end of an episode.

    Args:
        states: A row a step, shape (n, S).
        names: Of their numbers.
        task: Its name.
    """
    if task == "reach":
        ways = [[names.index(f"to_goal_{side}_{axis}.pos") for axis in "xyz"] for side in SIDES]
        return bool(np.linalg.norm(states[-1][ways], axis=1).max() <= REACHED)
    first, here = (
        np.array([row[names.index(f"object_{axis}.pos")] for axis in "xyz"]) for row in (states[0], states[-1])
    )
    ways = [[names.index(f"to_object_{side}_{axis}.pos") for axis in "xyz"] for side in SIDES]
    return THINGS[task].far(first, here, here - states[-1][ways]) <= 0.0
