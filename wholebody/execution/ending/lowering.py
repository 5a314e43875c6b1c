"""From standing into a crouch that needs nobody, and back."""

from __future__ import annotations

import numpy as np

from wholebody.control.base import Controller
from wholebody.execution import statuses
from wholebody.execution.ending.crouch import crouch
from wholebody.execution.planted_feet import PlantedFeet
from wholebody.execution.standing import Reflex
from wholebody.types import RobotState

AT_REST = 0.05
"""Speed of any joint or the base below which the robot has come to rest in its crouch [rad/s, m/s]; chosen: twice what
an estimator makes of one that stands."""


class Lowering:
    """What the reflex is asked for while the robot is lowered or raised.

    Args:
        controller: Of the robot on its feet.
        reflex: Goes there.
        planted: Has the feet and the stance on them.

    Attributes:
        active: Whether the robot is lowered, raised, or on its way: no chunk is followed then.
        stays: Whether it is in its crouch, at rest.
    """

    def __init__(self, controller: Controller, reflex: Reflex, planted: PlantedFeet) -> None:
        self._controller, self._reflex, self._planted = controller, reflex, planted
        self.active = self.stays = self._down = False

    def begin(self, state: RobotState, *, down: bool) -> None:
        """Go into the crouch, or out of it, from any state."""
        robot, planted = self._controller.robot, self._planted
        posture = crouch(robot.spec, robot.model, planted.feet) if down else planted.stance
        self._reflex.go_to(state, posture, statuses.LOWERING if down else statuses.RAISING)
        self.active, self.stays, self._down = True, False, down

    def look(self, state: RobotState) -> None:
        """Notice that the robot has arrived."""
        if not self.active or self.stays or not self._reflex.has_arrived or np.abs(state.v).max() > AT_REST:
            return
        if self._down:
            self.stays, self._reflex.status = True, statuses.LOWERED
        else:
            self.active = False
            self._reflex.end()
