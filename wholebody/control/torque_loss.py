"""Torque that motors leave out, or add, of what they are asked for, by what they tell of it; it is made up for."""

from __future__ import annotations

import numpy as np

from models.spec import RobotSpec
from wholebody.types import JointCommand, RobotState

EVERY = 5
"""Ticks after which torques are compared; chosen: every 10 ms is soon enough, and a tick is dear."""
TIME_CONSTANT, RATE = 0.1, 8.0
"""Of the filter of what is left out [s], and how fast it is made up for [1/s]; chosen: damped at a ratio of 0.6, and
nearly all of it within 0.5 s."""
SLACK, SLACK_SHARE = 0.3, 0.05
"""Torque left out that is let be [N m], or share of what is asked for; chosen: what lag and noise of a realistic robot
make in motion."""
MOST = 0.6
"""Largest torque that is added, as a share of the effort limit [no unit]; chosen: more than a motor of half its torque
leaves out."""


class TorqueLoss:
    """Torques to add to feed-forward torques, so that motors deliver what they are asked for.

    What is asked for and what is told are known, so the robot has no part in this loop.

    Args:
        spec: The robot.
        order: Place of each motor's joint in Pinocchio's order, shape (n_joints,).
        dt: Control period [s].

    Attributes:
        added: Motor order, shape (n_joints,), [N m]; None as long as there is nothing to make up for.
    """

    def __init__(self, spec: RobotSpec, order: np.ndarray, dt: float) -> None:
        self._effort, self._order, self._step = spec.effort_max, order, EVERY * dt
        self.reset()

    def reset(self) -> None:
        """Motors deliver what they are asked for."""
        self._left_out, self._asked = np.zeros((2, len(self._order)))
        self.added: np.ndarray | None = None

    def look(self, before: RobotState, state: RobotState, command: JointCommand) -> None:
        """Compare torques, once in `EVERY` ticks.

        Args:
            before: The state that the command answered.
            state: The next one, with torques.
            command: What was sent, with what was added.
        """
        order, c = self._order, command
        asked = c.tau + c.kp * (c.q - before.q[7:][order]) + c.kd * (c.dq - before.v[6:][order])
        asked = np.clip(asked, -self._effort, self._effort)
        share = self._step / TIME_CONSTANT
        self._left_out += share * (asked - state.tau[order] - self._left_out)
        self._asked += share * (np.abs(asked) - self._asked)
        added = np.zeros(len(order)) if self.added is None else self.added
        missing = self._left_out - added
        missing -= np.clip(missing, -(slack := np.maximum(SLACK, SLACK_SHARE * self._asked)), slack)
        if self.added is not None or missing.any():
            most = MOST * self._effort
            self.added = np.clip(added + RATE * self._step * missing, -most, most)
