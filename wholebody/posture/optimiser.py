"""The search for the best motion: steps of the linearised program, damped as much as it takes."""

from __future__ import annotations

import numpy as np

from wholebody.config import PosturePlanConfig
from wholebody.posture.program import Program

ROUNDS = ((30.0, 3, 2), (5.0, 3, 3), (1.0, 24, 5))
"""Softness of the bounds, most steps with it, and how often a step guesses anew which bounds are exceeded.

A step that is not quite the linear program's own costs less than it gains: the next linearisation is soon there.
"""
ENOUGH = 2e-3
"""Share of the cost: a step that gains less is the last one of its round."""
STEP_MAX = 0.4
"""Largest step of a free direction that the linearisation is trusted for [m, rad]."""
HOPELESS = 2.0
"""Times that: a step that is as large after its first guess is damped more at once."""
DAMPING, DAMPING_MIN, DAMPING_MAX = 1e-4, 1e-7, 1e6


def optimise(program: Program, config: PosturePlanConfig) -> float:
    """Improve the present motion of the program, and answer what it costs with firm bounds."""
    damping = DAMPING
    program.linearise(program.now)
    for softness, rounds, guesses in ROUNDS:
        program.weigh(config, softness)
        cost = program.cost(program.now)
        program.assemble()
        for _ in range(rounds):
            promise, damping = _trusted_step(program, damping, guesses)
            program.move()
            program.linearise(program.trial)
            cost_new = program.cost(program.trial)
            ratio = (cost - cost_new) / max(promise, 1e-12)
            if not cost_new < cost:
                damping *= 4.0
                continue
            program.accept()
            gain, cost = (cost - cost_new) / cost, cost_new
            program.assemble()
            # Nielsen, Damping parameter in Marquardt's method, IMM-REP-1999-05.
            damping = max(damping * max(1.0 / 3.0, 1.0 - (2.0 * min(ratio, 1.0) - 1.0) ** 3), DAMPING_MIN)
            if gain < ENOUGH:
                break
    return cost


def _trusted_step(program: Program, damping: float, guesses: int) -> tuple[float, float]:
    while True:
        last = damping > DAMPING_MAX
        promise, size = program.step(damping, guesses, np.inf if last else HOPELESS * STEP_MAX)
        if size < STEP_MAX or last:
            return promise, damping
        damping *= 4.0
