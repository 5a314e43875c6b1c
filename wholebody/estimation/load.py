"""What the hands carry, observed from the torques of the arms."""

from __future__ import annotations

from math import exp

import numpy as np

from models.pinocchio_model import payload
from models.spec import RobotSpec
from wholebody.estimation.kernels import load as kernel
from wholebody.estimation.kernels.load import Dynamics
from wholebody.jit.entry import Entry
from wholebody.robot.hand_loads import LOAD_MAX
from wholebody.robot.state import Robot
from wholebody.types import RobotState

TIME_CONSTANT = 0.08
"""Of the filter of the torques [s]; chosen: 95 % of a load is seen after three of them, before an arm that sinks
under it is far."""
TORQUE_ERROR = 0.5
"""Standard deviation of the torques of an arm together that no weight accounts for [N m]; chosen: dry friction of its
seven joints is 0.1 to 0.3 each in Unitree's models."""
ERROR_MAX, ERROR_SHARE = 0.2, 0.15
"""Standard deviation up to which a load counts as known [kg], or share of the load; definition: it is to be known
within 0.2 kg, and of a heavy one nearly all is better than nothing."""
GAP_MAX = 0.02
"""Longest time between two states over which torques are looked at [s]; chosen: ten periods."""

_observe = Entry(kernel.observe)


class LoadObserver:
    """Masses in both hands, each from the torques of its arm; a mass acts along gravity, and nothing else is one.

    An arm that hangs, or presses against something, tells little: then the last mass that was known stays.

    Args:
        spec: The robot. robot: Its model.
        dynamics: Arrays that every control tick fills anew.

    Attributes:
        loads: Masses in left and right hand that were known last, shape (2,), [kg].
        known: Whether there is one for each hand, shape (2,).
    """

    def __init__(self, spec: RobotSpec, robot: Robot, dynamics: Dynamics) -> None:
        model, arms, bodies, places = robot.model, [], [], []
        for tool in spec.tools:
            joint, inertia = payload(model, tool, 1.0)
            arm = [j for j in model.supports[joint] if f"{tool.side}_" in model.names[j]]
            bodies.append(joint - 1)
            places.append(inertia.lever)
            arms.append([model.idx_vs[j] for j in arm])
        self._dynamics, self._hands = dynamics, kernel.Hands(np.array(bodies), np.array(places), np.array(arms))
        k, n = self._hands.arm.shape[1], robot.nv
        pairs = [np.zeros((2, k)) for _ in range(2)], [np.zeros(2) for _ in range(2)]
        self._memory = kernel.Memory(*pairs[0], *pairs[1], np.zeros(n), np.zeros(6))
        self.loads, self.known, self._before = np.zeros(2), np.zeros(2, dtype=bool), None
        self._arguments = self._dynamics, self._hands, self._memory

    def reset(self) -> None:
        """Forget everything."""
        for part in self._memory:
            part[:] = 0.0
        self.loads[:], self.known[:], self._before = 0.0, False, None

    @property
    def errors(self) -> np.ndarray:
        """Standard deviation of what is seen now, shape (2,), [kg]."""
        return self._memory.error

    def look(self, state: RobotState, assumed: np.ndarray) -> None:
        """Take in a state before the tick that answers it.

        Args:
            state: As measured; without torques nothing is learned.
            assumed: Masses that the tick before counted on, shape (2,), [kg].
        """
        before, tau = self._before, state.tau
        self._before = None if tau is None else state.time
        if before is None or tau is None or not 0.0 < (dt := state.time - before) <= GAP_MAX:
            return
        if tau.shape != (len(state.v) - 6,) or not np.isfinite(tau.dot(tau)):
            self._before = None
            return
        _observe(*self._arguments, state.v, tau, assumed, dt, exp(-dt / TIME_CONSTANT), TORQUE_ERROR)
        for hand in range(2):
            mass = min(max(self._memory.mass[hand], 0.0), LOAD_MAX)
            if self._memory.error[hand] <= max(ERROR_MAX, ERROR_SHARE * mass):
                self.loads[hand], self.known[hand] = mass, True
