"""Hands that ask for more torque than there is give way first."""

from __future__ import annotations

from math import exp

import numpy as np

from models.spec import RobotSpec
from wholebody.execution.kernels import saturation as kernel
from wholebody.execution.kernels.plan_follower import TRUST_MIN
from wholebody.jit.entry import Entry
from wholebody.robot.state import Robot

SPENT_SHARE = 0.998
"""Share of the torque that the program may use from which a joint has none left; chosen: above what rounding leaves."""
TIME_CONSTANT = 0.03
"""Time constant of the filter of how often torque is spent [s]; chosen: a motion that spends its torque for some
hundredths of a second between two knots is not meant."""
SPENT_OFTEN = 0.5
"""Share of the time in which a joint has none left from which its hand gives way; chosen: half of it."""

ERROR_SLOW, ERROR_STOP = 0.005, 0.025
"""Errors of a palm from which such a hand begins to give way and has given way [m]; chosen: one that is where it should
be asks for nothing more."""

OFF_SLOW, OFF_STOP = 0.08, 0.3
"""Distances of a joint from its plan at which both hands begin to give way, and have given way, while the waist has no
torque left [rad]; measured, loads put into a hand of a robot that leans (`tests.studies.loads change` and `lean`): none
of 108 falls, 34 of them, the right hand, looked at afterwards; with 0.12 and 0.3 or 0.08 and 0.2 one of them does."""
SPENT_LONG = 0.3
"""Time for which a joint of the waist has had no torque left after which a body that is off its plan does not come back
to it [s]; chosen: ten times the filter's, less than a trunk takes to sink by what a plan from there could mend."""

_trust = Entry(kernel.trust)


class Saturation:
    """Says how far each hand is trusted, by the torques of its arm and of the waist.

    Where one of them is spent, a hand that is held on to is paid for by all of the body: it dives, because what sinks
    weighs less. The posture that is planned is left over to follow; its torques have room. So it is where a palm is
    where it should be only because its arm makes up for a trunk that sinks. Where a joint of the waist has none for
    `SPENT_LONG` all the same, as that of a robot that is heavier than its model, the posture cannot be held either.

    Args:
        spec: The robot. robot: Its model.
        tau_max: Torques that the program may use, Pinocchio order, shape (n_joints,), [N m]; may change.
    """

    def __init__(self, spec: RobotSpec, robot: Robot, tau_max: np.ndarray) -> None:
        # The weight of a hand goes through the waist and its own arm.
        sides = [np.concatenate([spec.limbs["waist"], spec.limbs[f"{tool.side}_arm"]]) for tool in spec.tools]
        arms = [np.sort(robot.joint_indices([spec.joint_names[i] for i in side])) for side in sides]
        self._joints, self._often = np.array(arms), np.zeros(np.shape(arms))
        waist = robot.joint_indices([spec.joint_names[i] for i in spec.limbs["waist"]])
        self._waist = np.flatnonzero(np.isin(arms[0], waist)).tolist()
        self.begin_anew()
        self._tau_max, self._trust = tau_max, np.ones(2)
        self._settings = np.array([SPENT_OFTEN, ERROR_SLOW, ERROR_STOP, TRUST_MIN, SPENT_SHARE])
        v, m = np.zeros(1), np.zeros((2, 3))
        self._native = _trust.native(v, self._joints, v, self._often, m, v, 0.0, self._settings, self._trust)

    @property
    def sinks(self) -> bool:
        """Whether a joint of the waist has had no torque left for so long that the trunk sinks."""
        return max(self._waist_spent, default=0.0) > SPENT_LONG

    @property
    def waist_is_spent(self) -> bool:
        """Whether a joint of the waist has no torque left now."""
        return max(self._waist_spent, default=0.0) > 0.0

    @staticmethod
    def trust_off_plan(distance: float) -> float:
        """Factor on the weight of both hands while that is so, by how far a joint is from its plan [rad]."""
        return min(max((OFF_STOP - distance) / (OFF_STOP - OFF_SLOW), TRUST_MIN), 1.0)

    def begin_anew(self) -> None:
        """Count the time for which the waist has had none left from zero."""
        self._waist_spent = [0.0] * len(self._waist)
        """Time for which each joint of the waist has been spent [s]."""

    def trust(self, tau: np.ndarray, palms: np.ndarray, row: np.ndarray, elapsed: float) -> tuple[float, float]:
        """Factor on the weight of each hand, from `TRUST_MIN` to 1.

        Args:
            tau: Torques of the last tick, Pinocchio order, shape (n_joints,), [N m].
            palms: Where the palm points are, shape (2, 3), [m].
            row: Packed reference with where they are commanded to be.
            elapsed: Time since the tick before it [s].
        """
        keep = exp(-elapsed / TIME_CONSTANT)
        self._native(tau, self._joints, self._tau_max, self._often, palms, row, keep, self._settings, self._trust)
        often = self._often[0]
        spent = [often[k] > SPENT_OFTEN for k in self._waist]
        self._waist_spent = [(s + elapsed) * now for s, now in zip(self._waist_spent, spent, strict=True)]
        left, right = self._trust.tolist()
        return left, right
