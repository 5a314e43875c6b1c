"""Whether one state of a robot can follow from another: what no motor and no push can do is a fault of the readings."""

from __future__ import annotations

import numpy as np

from wholebody.estimation.kernels import plausibility as kernel
from wholebody.jit.entry import Entry
from wholebody.types import RobotState

JUMPS = np.array([0.02, 0.03, 0.05])
"""Largest changes by noise from one state to the next of the base's position [m], its orientation [rad] and a joint
[rad]; chosen: ten times what the realistic sensors do, and far below what brings the robot down."""
SPEED_JUMPS = np.array([2.0, 5.0, 20.0])
"""Largest changes by a blow from one control period to the next of the base's speed [m/s], its angular velocity and
a joint's [rad/s]; chosen, no trial is on record."""
ACCELERATIONS = np.array([20.0, 100.0, 100.0])
"""Largest unknown accelerations of base, angular velocity and joint, for the time between the two states [m/s^2,
rad/s^2]; chosen: twice the weight, and what a hip motor does to a leg."""
LIGHT = 3.0
"""Factor on these for fingers, on which little mass hangs; chosen, no trial is on record."""

_follows = Entry(kernel.follows)


class Plausibility:
    """Compares states of one robot.

    Args:
        fingers: Which of its joints are fingers, in the order of its states, shape (n_joints,).
    """

    def __init__(self, fingers: np.ndarray) -> None:
        kind = np.concatenate([[0, 0, 0, 1, 1, 1], np.full(len(fingers), 2)])
        share = np.concatenate([np.ones(6), np.where(fingers, LIGHT, 1.0)])
        self._bounds = JUMPS, share * SPEED_JUMPS[kind], share * ACCELERATIONS[kind]

    def follows(self, before: RobotState, after: RobotState, seconds: float) -> bool:
        """Whether a state can be what has become of another one.

        Args:
            before: Finite.
            after: Finite.
            seconds: Time from one to the other [s].
        """
        # The compiled code takes what it is given as it lies in memory.
        given = [np.ascontiguousarray(x, dtype=float) for x in (before.q, before.v, after.q, after.v)]
        return bool(_follows(*given, float(after.time - before.time), float(seconds), *self._bounds))
