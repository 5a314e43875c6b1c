"""How slow the motors are and how late commands reach them, from the torques that they tell."""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, isfinite, pi

import numpy as np

from wholebody.estimation.kernels import motor_response as kernel
from wholebody.jit.entry import Entry
from wholebody.jit.packed import Packed
from wholebody.robot.second_order import second_order_step
from wholebody.types import JointCommand, RobotState

LAGS, BANDWIDTHS = (0.003, 0.006, 0.01, 0.015), (60.0, 40.0, 30.0, 25.0, 20.0, 15.0)
"""Time constants of first order [s] and natural frequencies of second order [Hz] among which a motor is sought; chosen:
each is told from its neighbours within 0.1 s, with the noise of a realistic robot, too."""
DAMPING_RATIO = 0.5
"""Damping ratio of those of second order [no unit]; chosen: a motor that overshoots by a sixth."""
DELAYS, AGE_MAX = 20, 15
"""Delays of commands that are sought, and the largest age of a state [control periods]; chosen: 38 and 30 ms at 500
Hz."""
PERIOD_MAX = 0.004
"""Longest control period at which motors are watched [s]; chosen: their own loops are faster, and what they see in
between is not known."""
TIME_CONSTANT = 0.1
"""Time constant of the sums by which models are weighed [s]; chosen: a robot that shakes falls in half a second."""
BLANK = DELAYS + 5
"""Periods that are left out after gains have changed or a state was missed; derived: until no command from before is on
its way."""
PERIODS_MIN = 25
"""Periods that have to be weighed before a model is believed; chosen: half the time constant."""
CHOOSE_EVERY = 5
"""Periods from one choice to the next; chosen: every 10 ms is soon enough, and a tick is dear."""
BETTER_RATIO = exp(-2.0)
"""Ratio of what a model leaves unexplained to what the believed one does below which it is better [no unit]; chosen:
realistic robots differ by less by chance, motors that are slow by a factor of 1e3 within 0.1 s."""
SLOWER, FASTER = 2, 10
"""Choices in a row after which slower motors, or faster ones, are believed; chosen: with slower ones it shakes."""
UNEXPLAINED_MIN, ENERGY_MIN = 1e-4, 1e-10
"""Share below which torques are explained, and sum of squares below which there is nothing to explain [N^2 m^2];
chosen: above rounding."""
_sent, _told, _likeliest = Entry(kernel.sent), Entry(kernel.told), Entry(kernel.likeliest)


@dataclass(frozen=True)
class MotorResponse:
    """How motors answer.

    Attributes:
        bandwidth: Natural frequency of torques of second order [Hz]; 0 if they are not.
        lag: Time constant of torques of first order [s].
        delay: Of commands [s].
    """

    bandwidth: float = 0.0
    lag: float = 0.0
    delay: float = 0.0

    @property
    def torque_lag(self) -> float:
        """Time by which slowly changing torques are late [s]."""
        return self.lag + (DAMPING_RATIO / (pi * self.bandwidth) if self.bandwidth > 0.0 else 0.0)

    @property
    def total(self) -> float:
        """Time from a command to its torque [s]."""
        return self.delay + self.torque_lag


class MotorObserver:
    """Finds the `MotorResponse` that explains the torques of the motors best; what share of them is told is no matter.

    Args:
        limbs: Of each joint, Pinocchio order; torques of a limb are weighed together.
        motors: Place of each motor's joint in that order, shape (n_joints,).
        dt: Control period [s].

    Attributes:
        response: What is believed.
    """

    def __init__(self, limbs: list[str], motors: np.ndarray, dt: float) -> None:
        steps = [(np.zeros((2, 2)), np.array([1.0, 0.0]))]
        for lag in LAGS:
            share = 1.0 - exp(-dt / lag)
            steps.append((np.diag([1.0 - share, 0.0]), np.array([share, 0.0])))
        steps += [second_order_step(2.0 * pi * hz, DAMPING_RATIO, dt) for hz in BANDWIDTHS]
        self._models = [(0.0, 0.0), *((0.0, lag) for lag in LAGS), *((hz, 0.0) for hz in BANDWIDTHS)]
        self._dt, self._keep, n, models = dt, exp(-dt / TIME_CONSTANT), len(limbs), len(steps)
        names = list(dict.fromkeys(limbs))
        memory = self._memory = _memory(n, models, len(names))
        memory.step[:], memory.given[:] = zip(*steps, strict=True)
        # Joints of a limb may do the opposite of each other: with different weights they leave something to weigh.
        weights = np.random.default_rng(0).uniform(0.5, 1.0, n) * np.where(np.arange(n) % 2, 1.0, -1.0)
        for g, name in enumerate(names):
            memory.of_joint[g] = weights * [limb == name for limb in limbs]
        memory.of_motor[:] = memory.of_joint[:, motors]
        self._motors, self._gains = motors, None
        row = np.zeros(n)
        self._sent = _sent.native(memory, row, row, row, row, row)
        self._told = _told.native(memory, row, np.zeros(7 + n), np.zeros(6 + n), 0, True, 0.0)
        self._likeliest = _likeliest.native(memory, 0.0, 0.0)
        self.reset()

    def reset(self, response: MotorResponse | None = None) -> None:
        """Forget everything, and believe a response; motors that answer at once if not given."""
        self.response = response or MotorResponse()
        models = [abs(hz - self.response.bandwidth) + 1e4 * abs(lag - self.response.lag) for hz, lag in self._models]
        self._memory.believed[:] = int(np.argmin(models)), min(round(self.response.delay / self._dt), DELAYS - 1)
        self._time, self._agreed = 0.0, 0
        self.forget()

    def forget(self) -> None:
        """Weigh models anew from now on: gains have changed, and commands with the ones before are on their way."""
        self._memory.span("commanded", "yy")[:] = 0.0
        self._blank, self._weighed, self._since = BLANK, 0, 0

    def sent(self, command: JointCommand) -> None:
        """Take in the command of the last tick, before the state that answers it; other gains are other arrays."""
        memory, c = self._memory, command
        self._sent(memory, c.tau, c.q, c.dq, c.kp, c.kd)
        if c.kp is not self._gains:
            memory.kp[self._motors], memory.kd[self._motors], self._gains = c.kp, c.kd, c.kp
            self.forget()

    def look(self, state: RobotState, now: float) -> bool:
        """Take in a state; whether `response` is another one now.

        Args:
            state: As measured; without torques, or the same again, it says nothing.
            now: Present time [s].
        """
        age, period, self._time = round((now - state.time) / self._dt), state.time - self._time, state.time
        tau = None if state.tau is None else np.ascontiguousarray(state.tau, dtype=float)
        if tau is None or tau.shape != self._motors.shape or not isfinite(tau.dot(tau)) or not 0 <= age <= AGE_MAX:
            self._blank = BLANK
            return False
        if not 0.5 * self._dt < period < 1.5 * self._dt:
            self._blank = max(self._blank, BLANK)
        weigh = self._blank == 0
        # The compiled code takes what it is given as it lies in memory.
        q, v = np.ascontiguousarray(state.q, dtype=float), np.ascontiguousarray(state.v, dtype=float)
        self._told(self._memory, tau, q, v, age, weigh, self._keep)
        self._blank = max(self._blank - 1, 0)
        self._weighed += weigh
        self._since = (self._since + 1) % CHOOSE_EVERY
        return bool(weigh and self._since == 0 and self._weighed >= PERIODS_MIN and self._believe())

    def _believe(self) -> bool:
        """Believe the likeliest model if it has been much better for long enough; whether it is another one."""
        memory = self._memory
        self._likeliest(memory, UNEXPLAINED_MIN, ENERGY_MIN)
        best = memory.best.tolist()
        if best == memory.believed.tolist() or not memory.score[0] < BETTER_RATIO * memory.score[1]:
            self._agreed = 0
            return False
        hz, lag = self._models[best[0]]
        found = MotorResponse(hz, lag, best[1] * self._dt)
        slower = found.total > self.response.total or 0.0 < hz < self.response.bandwidth
        self._agreed += 1
        if self._agreed < (SLOWER if slower else FASTER):
            return False
        memory.believed[:], self.response, self._agreed = best, found, 0
        return True


def _memory(n: int, models: int, groups: int) -> Packed:
    """Memory for ``n`` joints, a number of models and groups of joints.

    ``step`` and ``given`` are the filters, ``of_joint`` and ``of_motor`` the weights of a group's joints in Pinocchio's
    and in motor order, ``kp`` and ``kd`` gains, Pinocchio order. ``commanded`` and ``own`` are states of filters,
    ``late`` filtered changes of what was commanded, the newest at ``at`` and the others behind it, twice; ``before``
    are what was commanded, the own part of two states, and the torque; ``xx``, ``xy`` and ``yy`` sums of products.
    """
    rows, length = groups * models, DELAYS + AGE_MAX
    constant = {"step": (models, 2, 2), "given": (models, 2), "of_joint": (groups, n), "of_motor": (groups, n)}
    kept = {"kp": (n,), "kd": (n,), "before": (4, groups), "commanded": (rows, 2), "own": (rows, 2)}
    sums = {"late": (rows, 2 * length), "xx": (rows, DELAYS), "xy": (rows, DELAYS), "yy": (groups,)}
    return Packed(constant | kept | sums | {"score": (2,)}, {"at": (), "best": (2,), "believed": (2,)})
