"""The state at a time to come, from a measured one and the accelerations that were commanded since."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin

from wholebody.robot.state import Robot
from wholebody.types import RobotState

TICKS = 512
"""Commands that are remembered: 1 s of them at 500 Hz, twice `CARRIED_MAX`; chosen."""
CARRIED_MAX = 0.5
"""Longest time that a state is carried on [s]; derived: an error grows 6 times meanwhile, at the 3.5/s of a pendulum of
0.8 m."""
ROUNDING = 1e-9
"""Rounding of times that are sums of control periods [s]; chosen: far below a period."""


class StatePredictor:
    """Carries a state on over the time that has passed since it was measured.

    A whole-body program's accelerations hold from its tick to the next. They are what the plan asks for, and what the
    motors were commanded to do.

    Args:
        robot: Its model.
    """

    def __init__(self, robot: Robot) -> None:
        self._model = robot.model
        self._times, self._dv = np.zeros(2 * TICKS), np.zeros((2 * TICKS, robot.nv))
        self._tau = np.zeros((2 * TICKS, robot.n_joints))
        self._n = 0

    def reset(self) -> None:
        """Nothing was commanded yet."""
        self._n = 0

    def commanded(self, time: float, dv: np.ndarray, tau: np.ndarray) -> None:
        """Accelerations (nv,) and torques (n_joints,) that were commanded at this time [s], until the next ones."""
        if self._n == len(self._times):
            for kept in (self._times, self._dv, self._tau):
                kept[:TICKS] = kept[TICKS:]
            self._n = TICKS
        self._times[self._n], self._dv[self._n], self._tau[self._n] = time, dv, tau
        self._n += 1

    def carried(self, state: RobotState, now: float) -> RobotState:
        """A state, carried on to the present time [s], by `CARRIED_MAX` at most; itself if that is its own.

        Its torques change by what those commanded have changed since: they belong to its accelerations.
        """
        label, now = now, min(now, state.time + CARRIED_MAX)
        seconds = state.age(now)
        if seconds <= ROUNDING:
            return state
        times = self._times[: self._n]
        first = max(int(np.searchsorted(times, state.time + ROUNDING, "right")) - 1, 0)
        begin = np.clip(times[first:], state.time, now)
        end = np.append(begin[1:], now)
        held, dv = end - begin, self._dv[first : self._n]
        # An acceleration moves the state for as long as it holds, and for the rest of the time by the speed it left.
        step = seconds * state.v + (held * (now - 0.5 * (begin + end))) @ dv
        q, v = pin.integrate(self._model, state.q, step), state.v + held @ dv
        tau = state.tau
        if tau is not None and self._n > 0:
            # Torques are those of the period that ended with the state.
            tau = tau + self._tau[self._n - 1] - self._tau[max(first - 1, 0)]
        return replace(state, time=label, q=q, v=v, tau=tau)
