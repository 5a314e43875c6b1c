"""Levenberg-Marquardt on the plan's program, the bounds first soft, then firm."""

from __future__ import annotations

import numpy as np

from wholebody.config import PosturePlanConfig
from wholebody.posture.program import Program

ROUNDS = ((30.0, 3), (5.0, 3), (1.0, 24))
"""Softness of the bounds, and most steps with it."""
ENOUGH = 2e-3
"""Share of the cost: a step that gains less is the last one of its round."""
STEP_MAX = 0.4
"""Largest step of a free direction that the linearisation is trusted for [m, rad]."""
DAMPING, DAMPING_MIN, DAMPING_MAX = 1e-4, 1e-7, 1e6


def optimise(program: Program, q: np.ndarray, config: PosturePlanConfig) -> tuple[np.ndarray, Program]:
    """The best motion found from q (K, 36) on, and its program, weighed with firm bounds."""
    damping = DAMPING
    program.linearise(q)
    for softness, rounds in ROUNDS:
        cost = program.weigh(config, softness)
        program.prepare()
        for _ in range(rounds):
            z, promise, damping = _trusted_step(program, damping)
            candidate, q_new = program.fresh(), program.moved(q, z)
            candidate.linearise(q_new)
            cost_new = candidate.weigh(config, softness)
            ratio = (cost - cost_new) / max(promise, 1e-12)
            if not cost_new < cost:
                damping *= 4.0
                continue
            gain, q, program, cost = (cost - cost_new) / cost, q_new, candidate, cost_new
            program.prepare()
            # Nielsen, Damping parameter in Marquardt's method, IMM-REP-1999-05.
            damping = max(damping * max(1.0 / 3.0, 1.0 - (2.0 * min(ratio, 1.0) - 1.0) ** 3), DAMPING_MIN)
            if gain < ENOUGH:
                break
    return q, program


def _trusted_step(program: Program, damping: float) -> tuple[np.ndarray, float, float]:
    while True:
        z, promise = program.step(damping)
        if np.abs(z).max() < STEP_MAX or damping > DAMPING_MAX:
            return z, promise, damping
        damping *= 4.0
