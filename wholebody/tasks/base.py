"""A task asks for an acceleration: minimise ``sum_i weight_i (J_i dv - target_i)^2``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from wholebody.robot.state import Robot


@dataclass(frozen=True)
class Objective:
    """One weighted least-squares term.

    Attributes:
        J: Task Jacobian, shape (k, nv).
        target: Desired ``J dv``, shape (k,): acceleration wanted minus the drift.
        weight: Non-negative weight per row, shape (k,), [1/(unit of target)^2].
    """

    J: np.ndarray
    target: np.ndarray
    weight: np.ndarray


class Task(Protocol):
    """Anything that turns the robot's state and its own reference into an `Objective`."""

    def objective(self, robot: Robot) -> Objective:
        """Objective at the robot's present state."""
        ...


def limited(vector: np.ndarray, largest: float) -> np.ndarray:
    """The vector, shortened to a largest norm: keeps its direction."""
    norm = float(np.linalg.norm(vector))
    return vector if norm <= largest else vector * (largest / norm)
