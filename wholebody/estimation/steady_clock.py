"""Time that only goes on, from a clock and stamps of states either of which may step, stand still or be no number."""

from __future__ import annotations

from dataclasses import replace
from math import isfinite

from policy.chunk import ActionChunk
from wholebody.errors import InputError
from wholebody.estimation.prediction import ROUNDING
from wholebody.types import Reason, RobotState

CLOCK_STEP = 0.02
"""Difference from one call to the next between what the clock and what the stamps say has passed, from which one of
them stepped, at 2.5 control periods at least [s]; measured: a realistic robot whose clock steps by 40 ms, unnoticed,
is 120 mm off in the wave."""
FUTURE = 0.02
"""How far ahead of the present a state may be stamped [s]; chosen: two computers whose clocks are synchronised are
nearer, and a robot that is led by states 20 ms old stands."""
AGE_MAX = 0.1
"""Age from which a state says nothing of the present [s]; derived: an error grows 1.4 times meanwhile, at the 3.5/s of
a pendulum of 0.8 m."""
CONSISTENT = 5
"""States in a row: so many that follow from each other are believed although they do not follow from what is known;
chosen: 10 ms at 500 Hz, in which nothing can be done about a fall."""

Fault = tuple[Reason, str]


class SteadyClock:
    """Present time and times of states on one scale that never steps.

    A clock that steps is told from a loop that hung by the stamps of the states: they step with it if time has passed.
    Stamps that step are told from a single wrong one by the states after it: `CONSISTENT` of them that go on as time
    does are believed, and are taken to be as old as states were at the reset.

    Args:
        period: Control period, what is taken to have passed where nothing says so [s].

    Attributes:
        now: Present time on the steady scale [s]; at the reset that of the clock.
        shift: By how much the clock is ahead of it [s].
    """

    def __init__(self, period: float) -> None:
        self._period, self._step = period, max(CLOCK_STEP, 2.5 * period)
        self.reset(0.0, 0.0)

    def reset(self, stamp: float, now: float) -> None:
        """Begin with a state and the present time [s]; one that cannot be so old has a clock of its own.

        Raises:
            InputError: If the present time is no finite number.
        """
        if not isfinite(now):
            raise InputError(f"the present time is {now}; a finite time on the clock of the states [s] is expected")
        self.now, self.shift, self._stamp = now, 0.0, stamp
        usual = -FUTURE <= now - stamp <= AGE_MAX
        self._offset, self._age = (0.0, max(now - stamp, 0.0)) if usual else (stamp - now, 0.0)
        self._newest = stamp - self._offset
        self._run, self._run_stamp, self._run_now = 0, stamp, now

    def steady(self, now: float) -> float:
        """A time of the clock [s] on the steady scale."""
        return now - self.shift

    def chunk(self, chunk: ActionChunk) -> ActionChunk:
        """A chunk with its time on the steady scale; itself if that is its own."""
        return replace(chunk, t_obs=self.steady(chunk.t_obs)) if self.shift else chunk

    def advance(self, stamp: float, now: float | None) -> tuple[float, Fault | None]:
        """Time that has passed since the last call [s], and the fault of the clock.

        Args:
            stamp: Of the newest state [s]; may be any number.
            now: Present time [s]; None where there is no clock but the stamps.
        """
        stamped = isfinite(stamp)
        stamped_step, self._stamp = (stamp - self._stamp, stamp) if stamped else (0.0, self._stamp)
        likely = stamped_step if 0.0 < stamped_step <= self._step else self._period
        alone, before, fault = now is None, self.now, None
        if alone:
            now = stamp if stamped else before + self.shift + self._period
        if not isfinite(now):
            self.now += likely
            return self.now - before, (Reason.CLOCK_INVALID, f"the present time is {now}: that of the states goes on")
        passed = now - self.shift - before
        if passed < -self._step or (passed > self._step and (alone or not abs(stamped_step - passed) <= self._step)):
            likely = self._period if alone else likely
            stepped = passed - likely
            self.shift += stepped
            self._offset += stepped * alone
            fault = Reason.CLOCK_STEPPED, f"the present time stepped by {stepped:+.3f} s: time goes on as before"
        self.now = max(now - self.shift, before)
        return self.now - before, fault

    def placed(self, state: RobotState) -> RobotState:
        """A state with its time on the steady scale; itself if that is its own."""
        return replace(state, time=state.time - self._offset) if self._offset else state

    def place(self, state: RobotState) -> tuple[RobotState, Fault | None]:
        """A state with its time on the steady scale, and the fault of that time.

        A stamp that is no number is left to who looks at the rest of the state.
        """
        stamp = state.time
        if not isfinite(stamp):
            return state, None
        placed = self.placed(state)
        fault = self.fault(placed.time, self.now)
        if fault is None:
            self._newest, self._run = placed.time, 0
            return placed, None
        went, passed = stamp - self._run_stamp, self.now - self._run_now
        if went == 0.0 and self._run:
            return placed, fault
        self._run = self._run + 1 if went > 0.0 and abs(went - passed) <= FUTURE else 1
        self._run_stamp, self._run_now = stamp, self.now
        if self._run < CONSISTENT:
            return placed, fault
        offset = stamp - (self.now - self._age)
        text = f"the stamps of the states stepped by {offset - self._offset:+.3f} s: {CONSISTENT} in a row agree"
        self._offset, self._run = offset, 0
        placed = self.placed(state)
        self._newest = placed.time
        return placed, (Reason.CLOCK_STEPPED, text)

    def fault(self, time: float, now: float) -> Fault | None:
        """Fault of a state's time at a present time, both on the steady scale [s]."""
        age = now - time
        if age < -FUTURE:
            return Reason.STATE_FROM_FUTURE, f"a state is stamped {-age:.3f} s ahead of the present; {FUTURE} s may be"
        if time < self._newest - ROUNDING:
            return Reason.STATE_OUT_OF_ORDER, f"the state of {time:.4f} s came after that of {self._newest:.4f} s"
        if age > AGE_MAX and time > self._newest + ROUNDING:
            return Reason.STATE_STALE, f"the newest state is {age:.3f} s old; up to {AGE_MAX} s is used"
        return None
