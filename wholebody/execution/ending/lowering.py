"""From standing into a crouch that needs nobody, and back."""

from __future__ import annotations

import numpy as np

from wholebody.control.base import Controller
from wholebody.execution import statuses
from wholebody.execution.ending.crouch import crouch
from wholebody.execution.planted_feet import PlantedFeet
from wholebody.execution.standing import Reflex
from wholebody.execution.states import ENDING, Event, Machine, State
from wholebody.types import RobotState

AT_REST_SPEED = 0.05
"""Speed of any joint or the base below which the robot has come to rest in its crouch [rad/s, m/s]; chosen: twice what
an estimator makes of one that stands."""


class Lowering:
    """What the reflex is asked for while the robot is lowered or raised.

    Args:
        controller: Of the robot on its feet.
        reflex: Goes there.
        planted: Has the feet and the stance on them.
        states: What the robot follows.
    """

    def __init__(self, controller: Controller, reflex: Reflex, planted: PlantedFeet, states: Machine) -> None:
        self._controller, self._reflex, self._planted, self._states = controller, reflex, planted, states

    @property
    def active(self) -> bool:
        """Whether the robot is lowered, raised, or on its way: no chunk is followed then."""
        return self._states.now in ENDING

    @property
    def stays(self) -> bool:
        """Whether the robot is in its crouch, at rest."""
        return self._states.now is State.LOWERED

    def begin(self, state: RobotState, *, down: bool) -> None:
        """Go into the crouch, or out of it, from any state."""
        robot, planted = self._controller.robot, self._planted
        posture = crouch(robot.spec, robot.model, planted.feet) if down else planted.stance
        self._reflex.go_to(state, posture, statuses.LOWERING if down else statuses.RAISING)
        self._states.on(Event.LOWER if down else Event.RAISE)

    def look(self, state: RobotState) -> None:
        """Notice that the robot has arrived."""
        if not self.active or self.stays or not self._reflex.has_arrived or np.abs(state.v).max() > AT_REST_SPEED:
            return
        self._states.on(Event.ARRIVED)
        if self.stays:
            self._reflex.status = statuses.LOWERED
        else:
            self._reflex.end()
