"""Loops that lose ticks, states that freeze or break: a `Supervisor` whose `step` is called as by a bad computer."""

from dataclasses import replace

import numpy as np

from wholebody.execution.supervisor import Supervisor


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


def not_a_number(state, good):
    """Every position is NaN."""
    return replace(state, q=np.full_like(state.q, np.nan))
