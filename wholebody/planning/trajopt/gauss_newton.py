"""The search for the best motion: steps of the linearised program, damped as much as it takes."""

from __future__ import annotations

import numpy as np

from wholebody.config import TrajectoryConfig
from wholebody.planning.trajopt.problem import TrajectoryProblem

ROUNDS = ((30.0, 3), (5.0, 3), (1.0, 24))
"""Softness of the bounds, and most steps with it."""
NEAR, FIRM = 1.0, ((1.0, 1), (1.0, 24))
"""Excess of the first motion, in terms of the room behind a bound, up to which bounds are firm at once; and the rounds
then."""
FEW, ALL = 4, 12
"""How often a step guesses anew which bounds are exceeded: few times while the next linearisation gains more than the
exact step of this one; where few no longer help, as often as it takes."""
ENOUGH = 2e-3
"""Share of the cost: a step that gains less is the last one of its round."""
NOTHING = 1e-3
"""The same of what a step promises: one that promises less, with the exact set of exceeded bounds, is not taken."""
SOON = 1e-2
"""The same where bounds are soft, which only leads the way."""
LITTLE = 0.03
"""Cost per knot: where bounds are firm at once, a step that gains less is the last one."""
STEP_MAX = 0.4
"""Largest step of a free direction that the linearisation is trusted for [m, rad]."""
HOPELESS = 2.0
"""Times that: a step that is as large after its first guess is damped more at once."""
DAMPING, DAMPING_MIN, DAMPING_MAX = 1e-4, 1e-7, 1e6


def optimise(program: TrajectoryProblem, config: TrajectoryConfig) -> float:
    """Improve the present motion of the program, and answer what it costs with firm bounds."""
    damping = DAMPING
    program.linearise(program.now)
    near = program.excess().max() <= NEAR
    for softness, rounds in FIRM if near else ROUNDS:
        if softness < ROUNDS[0][0]:
            program.bend()
        guesses = FEW
        program.weigh(config, softness)
        cost = program.cost(program.now)
        program.assemble()
        for _ in range(rounds):
            promise, damping, exact = _trusted_step(program, damping, guesses)
            if promise < SOON * cost and softness > 1.0:
                break
            if promise < NOTHING * cost and not exact and guesses < ALL:
                guesses = ALL
                promise, damping, exact = _trusted_step(program, damping, guesses)
            if promise < NOTHING * cost:
                break
            program.move()
            program.linearise(program.trial)
            cost_new = program.cost(program.trial)
            ratio = (cost - cost_new) / max(promise, 1e-12)
            if not cost_new < cost:
                damping, guesses = 4.0 * damping, ALL
                continue
            program.accept()
            gain, cost = (cost - cost_new) / cost, cost_new
            if near and gain * cost < LITTLE * program.K:
                break
            program.assemble()
            # Nielsen, Damping parameter in Marquardt's method, IMM-REP-1999-05.
            damping = max(damping * max(1.0 / 3.0, 1.0 - (2.0 * min(ratio, 1.0) - 1.0) ** 3), DAMPING_MIN)
            if gain < ENOUGH:
                if guesses == ALL or softness > 1.0:
                    break
                guesses = ALL
    return cost


def _trusted_step(program: TrajectoryProblem, damping: float, guesses: int) -> tuple[float, float, bool]:
    while True:
        last = damping > DAMPING_MAX
        promise, size, exact = program.step(damping, guesses, np.inf if last else HOPELESS * STEP_MAX)
        if size < STEP_MAX or last:
            return promise, damping, exact
        damping *= 4.0
