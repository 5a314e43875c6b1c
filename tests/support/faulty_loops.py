"""Loops that lose ticks, states that freeze or break: a `Supervisor` whose `step` is called as by a bad computer."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin

from wholebody.execution.supervisor import Supervisor
from wholebody.types import RobotState


class DroppedTicks(Supervisor):
    """Every so many ticks one is left out: the motors go on with the command before."""

    every = 10
    count = 0
    command = None

    def step(self, state, now=None):
        self.count += 1
        if self.command is None or self.count % self.every:
            self.command = super().step(state, now)
        return self.command


class FaultyStates(Supervisor):
    """States that are wrong for some time from each of some times on.

    Attributes:
        times: When [s].
        seconds: For how long [s].
        fault: Of state and the last good one, the state that the supervisor gets.
    """

    times = ()
    seconds = 0.05
    good = None

    @staticmethod
    def fault(state, good):
        return replace(state, q=good.q, v=good.v)

    def step(self, state, now=None):
        if any(time < state.time <= time + self.seconds + 1e-9 for time in self.times):
            return super().step(self.fault(state, self.good), state.time if now is None else now)
        self.good = state
        return super().step(state, now)


def frozen(state, good):
    """The content stays, time goes on."""
    return replace(state, q=good.q, v=good.v)


def stale(state, good):
    """The same message again."""
    return good


def zeros(state, good):
    """Every number is zero, but for a quaternion that is one."""
    return replace(state, q=np.r_[np.zeros(6), 1.0, np.zeros(len(state.q) - 7)], v=np.zeros_like(state.v))


def pitched(angle):
    """The fault of an IMU that says that the pelvis is pitched forward by so much more [rad]."""

    def fault(state, good):
        turned = pin.Quaternion(state.q[3:7]) * pin.Quaternion(pin.exp3(np.array([0.0, angle, 0.0])))
        return replace(state, q=np.r_[state.q[:3], turned.coeffs(), state.q[7:]])

    return fault


def bent(joint, angle):
    """The fault of an encoder that says that its joint is elsewhere by so much [rad]."""

    def fault(state, good):
        q = state.q.copy()
        q[7 + joint] += angle
        return replace(state, q=q)

    return fault


def not_a_number(state, good):
    """Every position is NaN."""
    return replace(state, q=np.full_like(state.q, np.nan))


@dataclass(frozen=True)
class ClockFault:
    """What is wrong with clock and stamps for some time.

    Attributes:
        stamp: Added to the times of states [s].
        now: Added to the present time [s].
        seconds: For how long [s].
        content: What becomes of a state, of it and the last good one.
        alone: Whether the loop has no clock but the stamps, from the beginning.
        hung: Whether the loop hangs meanwhile: the motors have the last command.
    """

    stamp: float = 0.0
    now: float = 0.0
    seconds: float = np.inf
    content: Callable[[RobotState, RobotState], RobotState] = lambda state, good: state
    alone: bool = False
    hung: bool = False


CLOCK_FAULTS = {
    "a state stamped 0.7 s ahead": ClockFault(stamp=0.7, seconds=0.002),
    "a state stamped 0.7 s back": ClockFault(stamp=-0.7, seconds=0.002),
    "stamps 1 s ahead": ClockFault(stamp=1.0),
    "stamps 60 ms ahead": ClockFault(stamp=0.06),
    "stamps 15 ms ahead": ClockFault(stamp=0.015),
    "stamps 1 s back": ClockFault(stamp=-1.0),
    "stamps 60 ms back": ClockFault(stamp=-0.06),
    "stamps 1 s ahead for 1 s": ClockFault(stamp=1.0, seconds=1.0),
    "stamps no number for 3 s": ClockFault(stamp=np.nan, seconds=3.0),
    "the clock 1 s ahead": ClockFault(now=1.0),
    "the clock 60 ms ahead": ClockFault(now=0.06),
    "the clock 40 ms ahead": ClockFault(now=0.04),
    "the clock 1 s back": ClockFault(now=-1.0),
    "the clock 60 ms back": ClockFault(now=-0.06),
    "the clock an hour ahead for 1 s": ClockFault(now=3600.0, seconds=1.0),
    "the clock no number": ClockFault(now=np.nan),
    "the clock infinite for 1 s": ClockFault(now=np.inf, seconds=1.0),
    "no clock, a state stamped 0.7 s ahead": ClockFault(stamp=0.7, seconds=0.002, alone=True),
    "no clock, stamps 1 s ahead": ClockFault(stamp=1.0, alone=True),
    "no clock, stamps 1 s back": ClockFault(stamp=-1.0, alone=True),
    "states frozen for 3 s": ClockFault(content=frozen, seconds=3.0),
    "no states for 3 s": ClockFault(content=stale, seconds=3.0),
    "states no numbers for 3 s": ClockFault(content=not_a_number, seconds=3.0),
    "the loop hangs for 0.2 s": ClockFault(seconds=0.2, hung=True),
}
"""Faults of clocks by name."""


class FaultyClocks(Supervisor):
    """A clock, or the stamps of states, that go wrong.

    Attributes:
        fault: How; not at all if None.
        since: When, or each time that it begins [s].
    """

    fault, since = None, np.inf
    good = command = None

    def reset(self, state, now=None):
        super().reset(state, now)
        trusted = type(self.monitor).trusted
        self.monitor.trusted = lambda state, now: trusted(self.monitor, self._stamped(state, now), self._given(now))

    def step(self, state, now=None):
        fault, now = self.fault, state.time if now is None else now
        wrong = fault is not None and self._wrong(now)
        if wrong and fault.hung:
            return self.command
        stamped = self._stamped(state, now)
        if not wrong:
            self.good = state
        state = stamped
        self.command = super().step(state, self._given(now))
        return self.command

    def accept(self, chunk, now=None):
        return super().accept(chunk, None if now is None else self._given(now))

    def _stamped(self, state, now):
        fault = self.fault
        if fault is None or not self._wrong(now):
            return state
        state = fault.content(state, self.good)
        return replace(state, time=state.time + fault.stamp)

    def _wrong(self, now):
        return any(since <= now < since + self.fault.seconds - 1e-9 for since in np.atleast_1d(self.since).tolist())

    def _given(self, now):
        if self.fault is None:
            return now
        return None if self.fault.alone else now + self.fault.now if self._wrong(now) else now
