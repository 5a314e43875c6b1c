"""How measured joints follow commanded ones, joint by joint: a constant offset, and a delay."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from policy.suspicion.rows import ROWS_MIN

DELAY_MAX = 0.4
"""Longest delay that is looked for [s]; chosen: past what a motor, a network and a recorder take together."""
JOINT_MOVE_MIN = 0.02
"""Least movement of a commanded joint that shows a delay [rad]; chosen: ten times an encoder's noise."""


@dataclass(frozen=True)
class Gap:
    """Difference of a measured joint from the commanded one.

    Attributes:
        joint: Its name.
        offset: Measured less commanded, in the median row, after the delay [rad].
        delay: By how much later it is [s]; None of a joint that hardly moves, or that follows later than `DELAY_MAX`.
        rms: What is left of the difference after both [rad].
    """

    joint: str
    offset: float
    delay: float | None
    rms: float


def joint_gaps(state: np.ndarray, action: np.ndarray, names: Sequence[str], fps: float) -> list[Gap]:
    """Gap of every joint.

    Args:
        state: Measured joints, finite, shape (n, D), [rad].
        action: Commanded ones, likewise.
        names: Of the joints.
        fps: Rows a second [Hz].

    Returns:
        Nothing of fewer than `ROWS_MIN` rows.
    """
    state, action = np.asarray(state, dtype=float), np.asarray(action, dtype=float)
    n = len(action)
    if n < ROWS_MIN or state.shape != action.shape:
        return []
    lags = range(min(int(np.ceil(DELAY_MAX * fps)), n // 2) + 1)
    spread = np.stack([(state[lag:] - action[: n - lag]).std(axis=0) for lag in lags])
    best = spread.argmin(axis=0)
    found = []
    for i, name in enumerate(names):
        is_delayed = np.ptp(action[:, i]) > JOINT_MOVE_MIN and best[i] < len(lags) - 1
        lag = int(best[i]) if is_delayed else 0
        rest = state[lag:, i] - action[: n - lag, i]
        offset = float(np.median(rest))
        rms = float(np.sqrt(np.mean((rest - offset) ** 2)))
        found.append(Gap(name, offset, lag / fps if is_delayed else None, rms))
    return found
