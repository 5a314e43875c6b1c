"""Watches how the motors answer, and gives the controller gains that they allow."""

from __future__ import annotations

from wholebody.control.base import Controller
from wholebody.control.controller import WholeBodyController
from wholebody.control.gains import GainSchedule
from wholebody.estimation.motor_response import PERIOD_MAX, MotorObserver, MotorResponse
from wholebody.types import RobotState

SHIFT = 0.2
"""Share of the time by which commands are led ahead or back once a delay is known [no unit]; chosen: 30 ms within
0.15 s, hands a fifth faster meanwhile."""


class MotorWatch:
    """Lowers the gains of a controller whose motors are slow, or whose commands are late, and raises them again.

    Args:
        controller: Only a `WholeBodyController` that ticks every 4 ms or more often is watched.

    Attributes:
        observer: What finds out how the motors answer, or None.
    """

    def __init__(self, controller: Controller) -> None:
        self._controller, self.observer = controller, None
        self._dt, self._ahead = controller.config.dt, 0.0
        if isinstance(controller, WholeBodyController) and controller.config.dt <= PERIOD_MAX:
            robot = controller.robot
            self._schedule = GainSchedule(controller.spec, robot, controller.config)
            limbs = [controller.spec.joints[motor].group for motor in robot.motor_to_pin]
            self.observer = MotorObserver(limbs, robot.pin_to_motor, controller.config.dt)

    @property
    def response(self) -> MotorResponse:
        """How the motors answer, as far as that is known."""
        return MotorResponse() if self.observer is None else self.observer.response

    def reset(self) -> None:
        """Motors are taken to be quick until they are seen."""
        self._ahead = 0.0
        if self.observer is not None:
            self.observer.reset()
            self._controller.set_gains(self._schedule.gains(self.observer.response))

    def arrival(self, now: float) -> float:
        """When a command of the present time reaches the motors [s]: for then the robot is predicted, and led."""
        most = SHIFT * self._dt
        self._ahead += min(max(self.response.delay - self._ahead, -most), most)
        return now + self._ahead

    def sent(self, now: float) -> float:
        """When a command was sent that reaches the motors at a time [s]."""
        return now - self._ahead

    def look(self, state: RobotState | None, now: float) -> None:
        """Take in a state before the tick that answers it.

        Args:
            state: As measured; None if there is none that can be used.
            now: Present time [s].
        """
        observer, controller = self.observer, self._controller
        if observer is None:
            return
        if controller.command is not None:
            observer.sent(controller.command)
        if state is not None and observer.look(state, now):
            controller.set_gains(self._schedule.gains(observer.response))
