"""A robot that is being lost: noticed while it can still be let down, and damped once it lies."""

from __future__ import annotations

from wholebody.control.base import Controller
from wholebody.estimation.steady_clock import CONSISTENT
from wholebody.execution import standing, statuses
from wholebody.execution.ending.descent import Descent
from wholebody.execution.feet.stepping import Stepping
from wholebody.execution.planted_feet import PlantedFeet
from wholebody.execution.state_monitor import StateMonitor
from wholebody.execution.states import Event, Machine, State
from wholebody.types import JointCommand, RobotState, StatusReport

LOST = (State.DESCENDING, State.FALLEN)
"""States of a robot that is led by nothing else."""
LASTS = 4.0
"""Time after which a descent is over [s]; measured: it lies, or kneels on its palms, after 2."""


class Falling:
    """Says when a robot is lost, and leads it from then on.

    Args:
        controller: Of the robot.
        monitor: Says whether it stands.
        planted: Says whether it hangs.
        stepping: Says where it steps.
        states: What the robot follows.

    Attributes:
        status: What a person sees of it then.
        descends: Whether it is let down; otherwise its joints are only damped, once it has fallen.
    """

    def __init__(
        self, controller: Controller, monitor: StateMonitor, planted: PlantedFeet, stepping: Stepping, states: Machine
    ) -> None:
        self._controller, self._monitor, self._planted, self._states = controller, monitor, planted, states
        self._stepping = stepping
        self._descent, self._since = Descent(controller.robot), 0.0
        self.descends, self._over = self._descent.known, 0
        self.status: StatusReport = statuses.STANDING_LOST

    def command(self, state: RobotState, blind: bool) -> JointCommand | None:
        """What a robot that is lost is commanded for one control period; None for one that is not.

        Args:
            state: As measured.
            blind: Whether it is predicted for long: then nobody knows.
        """
        states, robot = self._states, self._controller.robot
        if self._monitor.standing_lost or self._planted.hangs(state):
            states.on(Event.FELL)
        elif states.now not in LOST and self._is_over(blind):
            states.on(Event.LOST_FOR_GOOD)
            self._since = state.time
            self._descent.begin(state, complex(*robot.com_velocity[:2]))
        if states.now is State.DESCENDING and state.time - self._since > LASTS:
            states.on(Event.DOWN)
        if states.now is State.DESCENDING:
            self.status = statuses.DESCENDING
            return self._descent.command(state)
        if states.now is State.FALLEN:
            self.status = statuses.HANGS if self._planted.hung else statuses.STANDING_LOST
            return standing.damping_command(self._controller.spec, robot, state)
        return None

    def _is_over(self, blind: bool) -> bool:
        """Whether nothing brings the robot back, in several states in a row, none of them a fault."""
        if blind or not self.descends:
            self._over = 0
        elif self._monitor.bridged == 0.0:
            self._over = self._over + 1 if self._stepping.is_over() else 0
        return self._over >= CONSISTENT
