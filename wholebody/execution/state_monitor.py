"""States that cannot be used, not finite, old, out of order or frozen: the robot is predicted along its plan."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wholebody.control.tick_report import TickReport
from wholebody.errors import InputError
from wholebody.robot.state import Robot
from wholebody.types import Reason, RobotState, Status, StatusReport, check_state

TOLERATED = 0.01
"""Time without a new state that is bridged without a word [s]; chosen: five samples at 500 Hz."""
GO_ON = 0.1
"""Time without a usable state after which the plan is brought to a stop [s]; derived: an error grows 1.4 times
meanwhile, at the 3.5/s of a pendulum of 0.8 m."""
BRIDGED_MAX = 0.5
"""Time after which the robot is taken to be at rest where it was predicted last [s]; chosen, no trial is on record."""
MOVING = 0.02
"""Largest speed below which a state that repeats itself to the bit is that of a robot at rest [m/s, rad/s]; chosen, no
trial is on record."""
ROUNDING = 1e-9
"""Of times that are sums of control periods [s]; chosen: far below a period."""


class StateMonitor:
    """Says which state the controller gets.

    Where there is no usable one, the state before is carried on with the accelerations of the last whole-body program:
    that is what the plan asks for and what the robot was commanded to do.

    Args:
        robot: Its model.

    Attributes:
        bridged: Time since the last usable state [s]; 0 if the present one is.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self.bridged = 0.0
        self._measured: RobotState | None = None
        self._present: RobotState | None = None

    def reset(self, state: RobotState) -> None:
        """Begin with a valid state."""
        self._measured = self._present = state
        self.bridged = 0.0

    def usable(
        self, state: RobotState, now: float, elapsed: float, tick: TickReport | None
    ) -> tuple[RobotState, StatusReport | None]:
        """The state to go on with, and what is wrong with the measured one.

        Args:
            state: As measured.
            now: Present time [s].
            elapsed: Time since the last call [s].
            tick: What the last tick did, or None before the first.
        """
        fault = self._fault(state, elapsed)
        if fault is None:
            self._measured = self._present = state
            self.bridged = 0.0
            return state, None
        self.bridged += elapsed
        self._present = self._predicted(now, elapsed, tick)
        reason, detail = fault
        silent = reason is not Reason.STATE_INVALID and self.bridged <= TOLERATED
        return self._present, None if silent else StatusReport(Status.HOLD, reason, detail)

    def _fault(self, state: RobotState, elapsed: float) -> tuple[Reason, str] | None:
        try:
            check_state(state, self._robot.n_joints)
        except InputError as error:
            return Reason.STATE_INVALID, str(error)
        last = self._measured
        if state.time < last.time - ROUNDING:
            said = f"the state of {state.time:.4f} s came after that of {last.time:.4f} s"
            return Reason.STATE_OUT_OF_ORDER, said
        if elapsed <= ROUNDING:
            return None
        if state.time <= last.time + ROUNDING:
            return Reason.STATE_STALE, f"no new state for {self.bridged + elapsed:.3f} s"
        same = np.array_equal(state.q, last.q) and np.array_equal(state.v, last.v)
        if same and np.abs(state.v).max() > MOVING:
            return Reason.STATE_FROZEN, f"the state moves, and repeats itself to the bit for {self.bridged:.3f} s"
        return None

    def _predicted(self, now: float, elapsed: float, tick: TickReport | None) -> RobotState:
        q, v, dv = self._present.q, self._present.v, None
        if tick is not None and tick.solution is not None:
            dv = tick.solution.dv
        if dv is None or self.bridged > BRIDGED_MAX:
            return RobotState(now, q, np.zeros_like(v))
        step = elapsed * v + 0.5 * elapsed**2 * dv
        return RobotState(now, pin.integrate(self._robot.model, q, step), v + elapsed * dv)
