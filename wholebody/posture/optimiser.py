"""The search for the best motion: steps of the linearised program, damped as much as it takes."""

from __future__ import annotations

from wholebody.config import PosturePlanConfig
from wholebody.posture.program import Program

ROUNDS = ((30.0, 3), (5.0, 3), (1.0, 24))
"""Softness of the bounds, and most steps with it."""
ENOUGH = 2e-3
"""Share of the cost: a step that gains less is the last one of its round."""
STEP_MAX = 0.4
"""Largest step of a free direction that the linearisation is trusted for [m, rad]."""
DAMPING, DAMPING_MIN, DAMPING_MAX = 1e-4, 1e-7, 1e6


def optimise(program: Program, config: PosturePlanConfig) -> float:
    """Improve the present motion of the program, and answer what it costs with firm bounds."""
    damping = DAMPING
    program.linearise(program.now)
    for softness, rounds in ROUNDS:
        program.weigh(config, softness)
        cost = program.cost(program.now)
        program.assemble()
        for _ in range(rounds):
            promise, damping = _trusted_step(program, damping)
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


def _trusted_step(program: Program, damping: float) -> tuple[float, float]:
    while True:
        promise, size = program.step(damping)
        if size < STEP_MAX or damping > DAMPING_MAX:
            return promise, damping
        damping *= 4.0
