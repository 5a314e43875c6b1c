"""What the hands carry, observed from the torques of the arms."""

from __future__ import annotations

from math import exp, isfinite

import numpy as np

from models.pinocchio_model import payload
from models.spec import RobotSpec
from wholebody.estimation.kernels import load as kernel
from wholebody.jit.entry import Entry
from wholebody.jit.packed import Packed
from wholebody.robot.hand_loads import LOAD_MAX
from wholebody.robot.state import Robot
from wholebody.types import RobotState

TIME_CONSTANT = 0.08
"""Time constant of the filter of the torques [s]; chosen: 95 % of a load is seen after three of them, before an arm
that sinks under it is far."""
FORCE_TIME_CONSTANT = 0.008
"""Time constant of the filter of the torques from which the force on a palm is found [s]; chosen: a touch is to be
found within 30 ms, and the noise of encoder speeds is 1 N behind it."""
DELAYS_MIN = 4.0
"""Multiple of the delay of states and motors that this time constant is at least [no unit]; derived: at the frequency
at which a force that is counted on comes back reversed, a sixth of it is then left."""
TORQUE_ERROR = 0.5
"""Standard deviation of the torques of an arm together that no weight accounts for [N m]; chosen: dry friction of its
seven joints is 0.1 to 0.3 each in Unitree's models."""
ERROR_MAX, ERROR_SHARE = 0.2, 0.15
"""Standard deviation up to which a load counts as known [kg], or share of the load; definition: it is to be known
within 0.2 kg, and of a heavy one nearly all is better than nothing."""
BELIEVE_EVERY = 5
"""Ticks after which what is seen is believed or not; chosen: every 10 ms is soon enough, and a tick is dear."""
GAP_MAX = 0.02
"""Longest time between two states over which torques are looked at [s]; chosen: ten periods."""

_observe = Entry(kernel.observe)


class LoadObserver:
    """Masses in both hands, each from the torques of its arm; a mass acts along gravity, and nothing else is one.

    An arm that hangs, or presses against something, tells little: then the last mass that was known stays.

    Args:
        spec: The robot. robot: Its model.
        tick: Memory in which every control tick leaves its dynamics.

    Attributes:
        wrenches: Forces and moments on the palms besides the masses that the program counts on, world axes, shape
            (2, 6), [N, N m].
        loads: Masses in left and right hand that were known last, shape (2,), [kg].
        known: Whether there is one for each hand, shape (2,).
    """

    def __init__(self, spec: RobotSpec, robot: Robot, tick: Packed) -> None:
        model, arms, bodies, places = robot.model, [], [], []
        for tool in spec.tools:
            joint, inertia = payload(model, tool, 1.0)
            arm = [j for j in model.supports[joint] if f"{tool.side}_" in model.names[j]]
            bodies.append(joint - 1)
            places.append(inertia.lever)
            arms.append([model.idx_vs[j] for j in arm])
        self._tick, self._memory = tick, memory(robot.nv, len(arms[0]))
        self._memory.body[:], self._memory.place[:], self._memory.arm[:] = bodies, places, arms
        self.loads, self.known = np.zeros(2), np.zeros(2, dtype=bool)
        self._found = self._memory.span("mass", "error").reshape(2, 2)
        self.wrenches, self._size = self._memory.wrench, self._memory.size
        vector = np.zeros(robot.nv)
        self._observe = _observe.native(tick, self._memory, vector, vector, vector, 0.0, 0.0, 0.0, 0.0)
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self._memory.span("residual", "size")[:] = 0.0
        self.loads[:], self.known[:], self._before, self._count = 0.0, False, None, 0

    @property
    def sizes(self) -> list[float]:
        """How hard each palm is pushed, less what friction and a wrong model feign [N]."""
        return self._size.tolist()

    @property
    def errors(self) -> np.ndarray:
        """Standard deviation of what is seen now, shape (2,), [kg]."""
        return self._memory.error

    def look(self, state: RobotState, assumed: np.ndarray, age: float = 0.0) -> bool:
        """Take in a state before the tick that answers it; whether `loads` and `known` may be other ones now.

        Args:
            state: As measured; without torques nothing is learned.
            assumed: Masses that the tick before counted on, shape (2,), [kg].
            age: Time over which the state was carried on from when it was measured [s]: forces are filtered for
                `DELAYS_MIN` times as long, for what the program does about them comes back that much later.
        """
        before, tau = self._before, state.tau
        self._before = None if tau is None else state.time
        if before is None or tau is None or not 0.0 < (dt := state.time - before) <= GAP_MAX:
            return False
        # The compiled code takes what it is given as it lies in memory.
        tau, v = np.ascontiguousarray(tau, dtype=float), np.ascontiguousarray(state.v, dtype=float)
        if tau.shape != (len(v) - 6,) or not isfinite(tau.dot(tau)):
            self._before = None
            return False
        keep, keep_fast = exp(-dt / TIME_CONSTANT), exp(-dt / max(FORCE_TIME_CONSTANT, DELAYS_MIN * age))
        self._observe(self._tick, self._memory, v, tau, assumed, dt, keep, keep_fast, TORQUE_ERROR)
        self._count = (self._count + 1) % BELIEVE_EVERY
        if self._count:
            return False
        self._believe()
        return True

    def _believe(self) -> None:
        """Take over the masses that are seen well enough."""
        for hand, (seen, error) in enumerate(zip(*self._found.tolist(), strict=True)):
            mass = min(max(seen, 0.0), LOAD_MAX)
            if error <= max(ERROR_MAX, ERROR_SHARE * mass):
                self.loads[hand], self.known[hand] = mass, True


def memory(nv: int, joints: int) -> Packed:
    """What goes on from tick to tick, for a robot with so many velocities, and joints in each arm.

    ``residual`` are low-passed torques that the masses account for [N m], ``unit`` the same of 1 kg [N m/kg], ``mass``
    and its ``error`` [kg] what is found; ``body``, ``place`` [m] and ``arm`` are where loads are and what carries them.
    ``pushed`` are the torques of ``wrench`` on the palms [N, N m], ``moved`` those that accelerate the arms [N m],
    ``changes`` their rate [N m/s], ``level`` [N m] is the mean of those of its force of late, ``size`` what of it
    nothing feigns [N].
    """
    hands, arms = (2,), (2, joints)
    reals = {
        "place": (2, 3), "dv": (nv,), "six": (6,), "normal": (6, 7), "residual": arms, "unit": arms, "mass": hands,
        "error": hands, "pushed": arms, "moved": arms, "changes": arms, "wrench": (2, 6), "level": hands, "size": hands,
    }  # fmt: skip
    return Packed(reals, {"body": hands, "arm": arms})
