"""A body that waits for fast hands: low, its centre of mass over the soles, where the arms have the most room."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from policy.scripted.policy import minimum_jerk
from wholebody.control.base import Controller
from wholebody.errors import InputError
from wholebody.execution.ending.crouch import crouch
from wholebody.execution.ending.way_back import WayBack
from wholebody.execution.planted_feet import PlantedFeet
from wholebody.planning.trajectory import SampledTrajectory

KNEE, LEAN = 1.85, 0.15
"""Angles of knees and trunk (forward) of the waiting posture [rad]; measured: the mean of a plan that knows all of a
lissajous of 0.15 m, 1.1 m/s; from the stance, arms that fold reach no closer than 0.12 m of it."""
REACH = 0.52
"""Distance of a palm from its shoulder there up to which it is in reach [m]; chosen: an arm is straight at 0.55 m, a
lissajous of 0.15 m comes to 0.49 m."""
WAY_DOWN = 0.6
"""Time in which the body goes there [s]; chosen: at 3.5 m/s^2 at most."""


class ReadyBody:
    """Says where the body waits, and the way there.

    Args:
        controller: Of the robot on its feet.
        planted: Has the feet.

    Attributes:
        row: Where the body is to be now.
    """

    def __init__(self, controller: Controller, planted: PlantedFeet) -> None:
        self._controller, self._planted = controller, planted
        self._kept: tuple[object, np.ndarray] | None = None
        self._way: WayBack | None = None
        self._time = 0.0
        self.row: SampledTrajectory

    def begin(self, palms: np.ndarray) -> bool:
        """Begin to wait for palms (2, 3) in world, from where the robot is.

        False for those out of reach from there, and for a robot whose crouch is not known.
        """
        robot, feet = self._controller.robot, self._planted.feet
        if self._kept is None or self._kept[0] is not self._planted.contacts:
            try:
                posture = crouch(robot.spec, robot.model, feet, KNEE, LEAN, 0.0)
            except InputError:
                return False
            self._kept, model, data = (self._planted.contacts, posture), robot.model, robot.scratch
            pin.forwardKinematics(model, data, posture)
            first = [robot.arm_joints(tool.side)[0] for tool in robot.spec.tools]
            self._shoulders = np.stack([data.oMi[model.getJointId(name)].translation for name in first])
        if not self.reaches(palms):
            return False
        self.row = SampledTrajectory.still(robot, robot.q.copy())
        self._way, self._time = WayBack(robot, self.row, self._kept[1]), 0.0
        return True

    def reaches(self, palms: np.ndarray) -> bool:
        """Whether palms (2, 3) in world are in reach of a body that waits; False where it has not begun to."""
        if self._kept is None:
            return False
        return bool(np.linalg.norm(palms - self._shoulders, axis=1).max() <= REACH)

    @property
    def is_over(self) -> bool:
        """Whether the body waits where it is to wait."""
        return self._way is None or self._way.is_over

    def advance(self, elapsed: float) -> SampledTrajectory:
        """Where the body is to be that much later [s], one row, with the velocity of the way there."""
        way = self._way
        before, self._time = float(minimum_jerk(self._time / WAY_DOWN)), self._time + elapsed
        share = 1.0 if self._time >= WAY_DOWN else float(minimum_jerk(self._time / WAY_DOWN))
        self.row = way.advance((share - before) * max(way.seconds, 1e-9))
        return self.row
