"""Torque that motors leave out, or add, of what they are asked for, and the most that they have, by what they tell."""

from __future__ import annotations

import numpy as np

from models.spec import RobotSpec
from wholebody.types import JointCommand, RobotState

COMPARE_EVERY = 5
"""Ticks after which torques are compared; chosen: every 10 ms is soon enough, and a tick is dear."""
TIME_CONSTANT, MAKE_UP_RATE = 0.1, 8.0
"""Time constant of the filter of what is left out [s], and rate at which it is made up for [1/s]; chosen: damped at
a ratio of 0.6, and nearly all of it within 0.5 s."""
LOSS_NONE, SLACK_SHARE = 0.3, 0.05
"""Torque left out that is let be [N m], or share of what is asked for; chosen: what lag and noise of a realistic robot
make in motion."""
MOST = 0.6
"""Largest torque that is added, as a share of the effort limit [no unit]; chosen: more than a motor of half its torque
leaves out."""
MEMORY, KNOWN = 1.0, 0.1
"""Over how long the share that a motor delivers is averaged, and from how much of it on it is known [s]; chosen: a
share is one for long; a robot whose motors deliver half falls within a second."""
LOADED, LOADED_MOTORS = 3.0, 5
"""Mean torque from which that share is known [N m], and motors that say what is usual; chosen: ten times `LOSS_NONE`,
and in the stance as many joints of the legs have it."""
ALIKE, SHARE_MIN, SHARE_MAX = 0.1, 0.4, 2.5
"""Difference of shares that is none, and shares that are made up for at most [no unit]; chosen: torques of a realistic
robot that moves are told within 5 %."""
ALL_ASKED, WEAK = 0.98, 0.3
"""Share of its limit from which a motor is asked for all that it has, and by how much less than others it delivers if
it has less [no unit]; measured: motors that all deliver half seem to differ by 0.18 in the lissajous."""
IN_A_ROW, BELIEVE_AFTER = 15, 4
"""Comparisons in a row after which a motor is believed to have less, and for how many one counts in which it was asked
for all that it has [no unit]; chosen: 0.15 s, and 40 ms, in which torques that are 12 ms late have come."""
SHARE_LEAST = 0.2
"""Least share of the limit of the model that a motor is believed to have [no unit]; chosen: below it nothing stands."""


class TorqueLoss:
    """What to multiply feed-forward torques by, and to add to them, so that motors deliver what they are asked for.

    What is asked for and what is told are known, so the robot has no part in this loop.

    Args:
        spec: The robot.
        order: Place of each motor's joint in Pinocchio's order, shape (n_joints,).
        dt: Control period [s].

    Attributes:
        factor: Of the torques of the program, motor order, shape (n_joints,). added: Then, [N m]. Both are None as long
            as there is nothing to make up for.
        most: The most that each motor has been seen to have, its limit until then, motor order, shape (n_joints,).
    """

    def __init__(self, spec: RobotSpec, order: np.ndarray, dt: float) -> None:
        self._effort, self._order, self._step = spec.effort_max, order, COMPARE_EVERY * dt
        self.reset()

    def reset(self) -> None:
        """Motors deliver what they are asked for."""
        n = len(self._order)
        self._left_out, self._asked = np.zeros((2, n))
        self.added: np.ndarray | None = None
        self.factor: np.ndarray | None = None
        self.most, self._short = self._effort.copy(), np.zeros(n, dtype=int)
        self._given, self._wanted, self._seen = np.zeros((3, n))
        self._watched = 0.0

    def look(self, before: RobotState, state: RobotState, command: JointCommand) -> bool:
        """Compare torques, once in `COMPARE_EVERY` ticks; whether a motor has less than was believed.

        Args:
            before: The state that the command answered.
            state: The next one, with torques.
            command: What was sent, made up for.
        """
        order, c, reported = self._order, command, state.tau[self._order]
        asked = c.tau + c.kp * (c.q - before.q[7:][order]) + c.kd * (c.dq - before.v[6:][order])
        weaker, more = False, 0.0
        self._watched += self._step
        if self.added is not None:
            more = (c.tau - self.added) * (1.0 - 1.0 / self.factor)
            weaker = self._learn(asked, reported)
        asked = np.clip(asked - more, -self._effort, self._effort)
        share = self._step / TIME_CONSTANT
        self._left_out += share * (asked - reported - self._left_out)
        self._asked += share * (np.abs(asked) - self._asked)
        added = np.zeros(len(order)) if self.added is None else self.added
        missing = self._left_out - added
        missing -= np.clip(missing, -(slack := np.maximum(LOSS_NONE, SLACK_SHARE * self._asked)), slack)
        if self.added is not None or missing.any():
            most = MOST * self._effort
            self.added = np.clip(added + MAKE_UP_RATE * self._step * missing, -most, most)
            self.factor = np.ones(len(order)) if self.factor is None else self.factor
        return weaker

    def _learn(self, asked: np.ndarray, told: np.ndarray) -> bool:
        """Learn which share of their torques motors deliver, and the most that they have; whether that is less."""
        given, wanted = np.abs(told), np.abs(asked)
        rate = self._step * (wanted < ALL_ASKED * self._effort)
        self._given += rate * (given - self._given / MEMORY)
        self._wanted += rate * (wanted - self._wanted / MEMORY)
        self._seen += rate * (1.0 - self._seen / MEMORY)
        known = (self._seen > KNOWN) & (self._wanted > LOADED * self._seen)
        shares = self._given[known] / self._wanted[known]
        share, usual = np.ones(len(given)), 1.0
        if len(shares) >= LOADED_MOTORS:
            usual = float(np.median(shares))
            share[:] = usual
        share[known] = shares
        factor = 1.0 / np.clip(share, SHARE_MIN, SHARE_MAX)
        self.factor = np.where(np.abs(share - 1.0) > ALIKE, factor, 1.0)
        return self._is_weaker(given, wanted, share, usual if len(shares) >= LOADED_MOTORS else 0.0)

    def _is_weaker(self, given: np.ndarray, wanted: np.ndarray, share: np.ndarray, usual: float) -> bool:
        """Learn `most` from motors asked for all that they have, and from those that deliver less than others do.

        A share that all motors leave out is one of what they are told, and no sign of less torque.
        """
        np.clip(given, self.most, self._effort, out=self.most)
        most, effort = self._effort * share / usual if usual > 0.0 else self._effort, self._effort
        most = np.where(most < (1.0 - WEAK) * effort, most, effort)
        if self._watched < 2.0 * KNOWN:
            return False
        full = (wanted >= ALL_ASKED * effort) & (given < (1.0 - ALIKE) * np.minimum(share, 1.0) * wanted)
        most = np.maximum(np.where(full, np.minimum(most, given), most), SHARE_LEAST * effort)
        self._short = np.where(most < (1.0 - ALIKE) * self.most, self._short + np.where(full, BELIEVE_AFTER, 1), 0)
        weak = self._short >= IN_A_ROW
        self.most[weak] = most[weak]
        return bool(weak.any())
