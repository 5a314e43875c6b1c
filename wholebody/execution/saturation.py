"""Hands that ask for more torque than there is give way first."""

from __future__ import annotations

from math import exp

import numpy as np

from models.spec import RobotSpec
from wholebody.robot.state import Robot

SPENT = 0.998
"""Share of the torque that the program may use from which a joint has none left; chosen: above what rounding leaves."""
TIME_CONSTANT = 0.03
"""Of the filter of how often that is so [s]; chosen: a motion that spends its torque for some hundredths of a second
between two knots is not meant."""
OFTEN = 0.5
"""Share of the time in which a joint has none left from which its hand gives way; chosen: half of it."""

ERROR_SLOW, ERROR_STOP = 0.005, 0.025
"""Errors of a palm from which such a hand begins to give way and has given way [m]; chosen: one that is where it should
be asks for nothing more."""


class Saturation:
    """Says how far each hand is trusted, by the torques of its arm and of the waist.

    Where one of them is spent, a hand that is held on to is paid for by all of the body: it dives, because what sinks
    weighs less. The posture that is planned is left over to follow; its torques have room.

    Args:
        spec: The robot. robot: Its model.
        tau_max: Torques that the program may use, Pinocchio order, shape (n_joints,), [N m].
    """

    def __init__(self, spec: RobotSpec, robot: Robot, tau_max: np.ndarray) -> None:
        names = robot.joint_names
        arms = [[i for i, name in enumerate(names) if _carries(name, tool.side)] for tool in spec.tools]
        self._joints, self._often = np.array(arms), np.zeros(np.shape(arms))
        self._limit = SPENT * tau_max[self._joints]

    def trust(self, tau: np.ndarray, error: np.ndarray, elapsed: float, least: float) -> np.ndarray:
        """Factor on the weight of each hand, shape (2,), from ``least`` to 1.

        Args:
            tau: Torques of the last tick, Pinocchio order, shape (n_joints,), [N m].
            error: Distance of each palm from where it is commanded to be, shape (2,), [m].
            elapsed: Time since the tick before it [s].
            least: Least trust.
        """
        keep = exp(-elapsed / TIME_CONSTANT)
        self._often *= keep
        self._often += (1.0 - keep) * (np.abs(tau[self._joints]) >= self._limit)
        room = (1.0 - self._often.max(axis=1)) / (1.0 - OFTEN)
        return np.clip(np.maximum(room, (ERROR_STOP - error) / (ERROR_STOP - ERROR_SLOW)), least, 1.0)


def _carries(joint: str, side: str) -> bool:
    """Whether the weight of a hand goes through a joint."""
    parts = ("shoulder", "elbow", "wrist")
    return joint.startswith("waist_") or (joint.startswith(f"{side}_") and any(part in joint for part in parts))
