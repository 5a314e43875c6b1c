"""Loops that lose ticks, states that freeze or break: a `Supervisor` whose `step` is called as by a bad computer."""

from dataclasses import replace

import numpy as np
import pinocchio as pin

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
