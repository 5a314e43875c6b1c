"""Watches how the motors answer, and gives the controller gains and limits that they allow."""

from __future__ import annotations

from collections import deque

import numpy as np

from wholebody.control.base import Controller
from wholebody.control.controller import WholeBodyController
from wholebody.control.gains import GainSchedule
from wholebody.control.torque_loss import COMPARE_EVERY, TorqueLoss
from wholebody.estimation.motor_response import PERIOD_MAX, MotorObserver, MotorResponse
from wholebody.types import JointCommand, RobotState

SHIFT_RATE = 0.2
"""Share of the time by which commands are led ahead or back once a delay is known [no unit]; chosen: 30 ms within
0.15 s, hands a fifth faster meanwhile."""

LATE_MAX, PERIODS_MAX = 0.012, 1.5
"""Time from a command to its torque up to which torques are compared [s], and the longest time between two states for
that [control periods]; chosen: a realistic robot has 7 ms; torques that change by 30 N m/s are off by 0.4 N m then."""
COMMANDS_KEPT = 50
"""Commands that are kept for states that tell of them late [no unit]; chosen: 0.1 s, older than states are."""


class MotorWatch:
    """Lowers the gains of a controller whose motors are slow, or whose commands are late, and raises them again.

    Args:
        controller: Only a `WholeBodyController` that ticks every 4 ms or more often is watched.

    Attributes:
        observer: What finds out how the motors answer, or None. loss: What they leave out, and what makes up for it.
        weaker: Whether a motor has been seen to have less torque than plans count on.
    """

    def __init__(self, controller: Controller) -> None:
        self._controller, self.observer = controller, None
        self._dt, self._ahead, self._shape = controller.config.dt, 0.0, (controller.spec.n_joints,)
        self._before: RobotState | None = None
        self._commands: deque[tuple[float, JointCommand]] = deque(maxlen=COMMANDS_KEPT)
        self._last, self.weaker = 0.0, False
        if isinstance(controller, WholeBodyController) and controller.config.dt <= PERIOD_MAX:
            robot = controller.robot
            self._schedule = GainSchedule(controller.spec, robot, controller.config)
            limbs = [controller.spec.joints[motor].group for motor in robot.motor_to_pin]
            self.loss = TorqueLoss(controller.spec, robot.pin_to_motor, controller.config.dt)
            self.observer = MotorObserver(limbs, robot.pin_to_motor, controller.config.dt)

    @property
    def response(self) -> MotorResponse:
        """How the motors answer, as far as that is known."""
        return MotorResponse() if self.observer is None else self.observer.response

    def reset(self) -> None:
        """Motors are taken to be quick until they are seen."""
        self._ahead = 0.0
        self._commands.clear()
        self._before, self._ticks, self.weaker = None, 0, False
        if self.observer is not None:
            self.observer.reset()
            self.loss.reset()
            self._controller.added = self._controller.factor = None
            self._controller.limit_torques(self.loss.most)
            self._controller.set_gains(self._schedule.gains(self.observer.response))

    def arrival(self, now: float) -> float:
        """Time at which a command of the present reaches the motors [s]: the robot is predicted, and led, for then."""
        most = SHIFT_RATE * self._dt
        self._ahead += min(max(self.response.delay - self._ahead, -most), most)
        return now + self._ahead

    def sent(self, now: float) -> float:
        """Time at which a command was sent that reaches the motors at a given time [s]."""
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
            self._commands.append((self._last, controller.command))
            self._compare(state)
        self._last = now
        if state is not None and observer.look(state, now):
            controller.set_gains(self._schedule.gains(observer.response))

    def _compare(self, state: RobotState | None) -> None:
        """Make up for what motors leave out; not for those that are late, whose torques belong to other commands.

        An old state tells of the command of its own time.
        """
        before, self._before, self._ticks = self._before, state, (self._ticks + 1) % COMPARE_EVERY
        if self._ticks or state is None or before is None or self.response.total > LATE_MAX:
            return
        known = state.tau is not None and np.shape(state.tau) == self._shape and np.isfinite(state.tau).all()
        if known and 0.0 < state.time - before.time < PERIODS_MAX * self._dt:
            command = self._sent_by(before.time + 0.5 * self._dt)
            if command is None:
                return
            if self.loss.look(before, state, command):
                self._controller.limit_torques(self.loss.most)
                self.weaker = True
            self._controller.added, self._controller.factor = self.loss.added, self.loss.factor

    def _sent_by(self, time: float) -> JointCommand | None:
        """The last command that was sent by then [s]; None if that is not known any more."""
        return next((command for sent, command in reversed(self._commands) if sent <= time), None)

    def planned(self) -> np.ndarray | None:
        """What a plan that is asked for now counts on of the model's torques, shares, motor order (n_joints,)."""
        self.weaker = False
        return None if self.observer is None else self.loss.most / self._controller.spec.effort_max
