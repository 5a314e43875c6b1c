"""States that cannot be used, not finite, old, out of order, frozen or impossible: the robot is predicted meanwhile."""

from __future__ import annotations

from dataclasses import replace
from math import isfinite

import numpy as np

from wholebody.control.tick_report import TickReport
from wholebody.errors import InputError
from wholebody.estimation.plausibility import Plausibility
from wholebody.estimation.prediction import ROUNDING, StatePredictor
from wholebody.estimation.steady_clock import CONSISTENT, SteadyClock
from wholebody.robot.standing import has_lost_standing
from wholebody.robot.state import Robot
from wholebody.types import Reason, RobotState, Status, StatusReport, check_state

SILENCE_MAX = 0.01
"""Time without a new state that is bridged without a word [s]; chosen: five samples at 500 Hz."""
GO_ON = 0.1
"""Time without a usable state after which the plan is brought to a stop [s]; derived: an error grows 1.4 times
meanwhile, at the 3.5/s of a pendulum of 0.8 m."""
BRIDGED_MAX = 0.5
"""Time after which a robot for which no program has a solution is taken to be at rest where it was predicted last [s];
chosen: a plan is brought to a stop in 0.4 s."""
AT_REST_MAX = 0.02
"""Largest speed below which a state that repeats itself to the bit is that of a robot at rest [m/s, rad/s]; chosen, no
trial is on record."""
SELF_EXPLAINED = frozenset({Reason.STATE_INVALID, Reason.STATE_JUMPED, Reason.STATE_FROM_FUTURE, Reason.CLOCK_STEPPED})
"""What is said of a single state already."""


class StateMonitor:
    """Says which state the controller gets: the measured one, carried on over its age.

    Where there is no usable one, the last one is carried on for longer, with the accelerations that the whole-body
    program has commanded since.

    Args:
        robot: Its model.
        period: Control period [s].

    Attributes:
        clock: The steady scale of time, on which all of its states are.
        bridged: Time since the last usable state came [s]; 0 if the present one is.
    """

    def __init__(self, robot: Robot, period: float = 0.002) -> None:
        self._robot, self.clock, fingers = robot, SteadyClock(period), robot.spec.is_finger[robot.motor_to_pin]
        self._predictor, self._plausibility = StatePredictor(robot), Plausibility(fingers)
        self.bridged, self._now = 0.0, 0.0
        self._measured: RobotState | None = None
        self._present: RobotState | None = None

    def reset(self, state: RobotState, now: float | None = None) -> None:
        """Begin with a valid state at a present time [s], that of the state if not given."""
        self.clock.reset(state.time, state.time if now is None else now)
        state = self.clock.placed(state)
        self._measured = self._present = self._newest = state
        self._now = self.clock.now
        self.bridged, self._agreeing, self._lost = 0.0, 0, 0
        self._predictor.reset()
        self._tau = np.zeros(self._robot.n_joints)
        self._plausibility.follows(state, state, 0.0)  # loaded now, not in a tick

    @property
    def age(self) -> float:
        """Time over which the present state is carried on from the last that was measured [s]."""
        return self._present.time - self._measured.time

    @property
    def fresh(self) -> RobotState | None:
        """The state that came last, as measured; None if it cannot be used."""
        return self._measured if self.bridged == 0.0 else None

    @property
    def standing_lost(self) -> bool:
        """Whether the robot stands no more: in several states in a row, none of them a fault."""
        return self._lost >= CONSISTENT

    def trusted(self, state: RobotState, now: float | None = None) -> RobotState:
        """A measured state carried on to the present time [s], or the last usable one: what `usable` would go on with.

        Nothing is remembered of it; before the first `reset` it is the measured state.

        Args:
            state: As measured.
            now: Present time on the clock that `seen` is given [s]; that of the state if not given.
        """
        if self._measured is None:
            return state
        clock, placed = self.clock, self.clock.placed(state)
        steady = placed.time if now is None else clock.steady(now)
        agreeing, newest = self._agreeing, self._newest
        fault = clock.fault(placed.time, steady) or self._fault(placed, max(steady - self._now, 0.0))
        self._agreeing, self._newest = agreeing, newest
        if fault is not None:
            placed, steady = self._present, steady if isfinite(steady) else self._now
        carried = self._predictor.carried(placed, steady)
        return replace(carried, time=carried.time + clock.shift) if clock.shift else carried

    def seen(
        self, state: RobotState, now: float | None, tick: TickReport | None, ahead: float = 0.0
    ) -> tuple[RobotState, float, StatusReport | None]:
        """The state to go on with on the steady scale of time, time since the last call [s], and what is wrong.

        Args:
            state: As measured.
            now: Present time [s]; that of the state if there is none.
            tick: What the last tick did, or None before the first.
            ahead: How far past the present the state is wanted [s].
        """
        _, stepped = self.clock.advance(state.time, now)
        state, fault = self.clock.place(state)
        wanted = self.clock.now + ahead
        elapsed = max(wanted - self._now, 0.0)
        used, report = self.usable(state, wanted, elapsed, tick, fault)
        if report is None and stepped is not None:
            report = StatusReport(Status.HOLD, *stepped)
        return used, elapsed, report

    def usable(
        self,
        state: RobotState,
        now: float,
        elapsed: float,
        tick: TickReport | None,
        fault: tuple[Reason, str] | None = None,
    ) -> tuple[RobotState, StatusReport | None]:
        """The state to go on with, and the fault of the measured one.

        Args:
            state: As measured; older than the present time by what is to be predicted.
            now: Present time [s].
            elapsed: Time since the last call [s].
            tick: What the last tick did, or None before the first.
            fault: What is known to be wrong with the state's time.
        """
        self._now = now
        if tick is not None and elapsed > 0.0:
            found, still = tick.solution, np.zeros(self._robot.nv)
            dv, self._tau = (still, self._tau) if found is None else (found.dv, found.tau)
            self._predictor.commanded(now - elapsed, dv, self._tau)
        fault, report = fault or self._fault(state, elapsed), None
        if fault is None:
            self._measured, self.bridged = state, 0.0
        else:
            self.bridged += elapsed
            reason, detail = fault
            reported = reason in SELF_EXPLAINED or self.bridged > SILENCE_MAX
            report = StatusReport(Status.HOLD, reason, detail) if reported else None
        if fault is None:
            self._present = self._predictor.carried(state, now)
        elif self.bridged > BRIDGED_MAX and (tick is None or tick.solution is None):
            self._present = RobotState(now, self._present.q, np.zeros(self._robot.nv))
        else:
            self._present = replace(self._predictor.carried(self._present, now), tau=None)
        if fault is None:  # a prediction says nothing of falls
            self._lost = self._lost + 1 if has_lost_standing(self._present) else 0
        return self._present, report

    def _fault(self, state: RobotState, elapsed: float) -> tuple[Reason, str] | None:
        try:
            check_state(state, self._robot.n_joints)
        except InputError as error:
            self._agreeing = 0
            return Reason.STATE_INVALID, str(error)
        last = self._measured
        if state.time < last.time - ROUNDING:
            text = f"the state of {state.time:.4f} s came after that of {last.time:.4f} s"
            return Reason.STATE_OUT_OF_ORDER, text
        if elapsed <= ROUNDING:
            return None
        if state.time <= last.time + ROUNDING:
            return Reason.STATE_STALE, f"no new state for {self.bridged + elapsed:.3f} s"
        # The joints alone: an estimator goes on with the base. Most states differ in the first number already.
        q, v = state.q[7:], state.v[6:]
        same = q[0] == last.q[7] and np.array_equal(q, last.q[7:]) and np.array_equal(v, last.v[6:])
        if same and np.abs(state.v).max() > AT_REST_MAX:
            return Reason.STATE_FROZEN, f"the state moves, and repeats itself to the bit for {self.bridged:.3f} s"
        jumped = Reason.STATE_JUMPED, "the state is not what can have become of the one before"
        return jumped if self._is_jump(state) else None

    def _is_jump(self, state: RobotState) -> bool:
        """Whether a state cannot follow from the ones before: it is bridged until several in a row agree."""
        follows, newest, self._newest = self._plausibility.follows, self._newest, state
        last = self._measured if self.bridged == 0.0 else self._predictor.carried(self._measured, state.time)
        period = state.time - newest.time
        if follows(last, state, period if self.bridged > 0.0 else state.time - last.time):
            self._agreeing = 0
            return False
        self._agreeing = self._agreeing + 1 if period > 0.0 and follows(newest, state, period) else 0
        return self._agreeing < CONSISTENT or not follows(last, state, state.time - self._measured.time)
