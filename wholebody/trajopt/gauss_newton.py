"""The search for the best motion: penalty continuation outside, Levenberg-Marquardt around Gauss-Newton inside.

Bounds are penalised with the square of their excess. The search begins with penalties that are 400 times too low, so
that the way to the solution may lead through them, and raises them in rounds (`CONTINUATION`). In each round, damped
Gauss-Newton steps are taken until one gains too little; each minimises the linearised cost with its active bounds
(`wholebody.trajopt.kernels.newton`).

Where its budget ends, the search does, with the best motion so far. Bounds are firm in the second half of it at the
latest, so that this motion is one that keeps them.

The constants are no settings: they trade time for accuracy of the solution, and were found by trial on the scripts and
hostile chunks of `benchmarks/plan.py` (`docs/performance.md`).
"""

from __future__ import annotations

import numpy as np

from wholebody.config import TrajectoryConfig
from wholebody.trajopt.problem import TrajectoryProblem

CONTINUATION = ((20.0, 2), (3.0, 2), (1.0, 24))
"""Factor on the scales of the bounds in each round, and the most steps in it."""
FEASIBLE, CONTINUATION_FEASIBLE = 1.0, ((1.0, 1), (1.0, 3), (1.0, 24))
"""Violation of the first motion, in terms of tolerances, up to which penalties begin at full size; and the rounds then,
each of which updates the spline offset of the palms: one that is three steps old is wrong by millimetres."""
NEWTON_FEW, NEWTON_ALL = 4, 12
"""Most Newton steps on the active set within one Gauss-Newton step: few while the next linearisation gains more than
the exact minimum of this one, all once few no longer help."""
GAIN_MIN = 2e-3
"""Share of the cost: a step that gains less is the last one of its round."""
PROMISE_MIN = 1e-3
"""Share of the cost: a step that promises less, on the exact active set, is not taken."""
PROMISE_MIN_SOFT = 1e-2
"""Least share of the cost that a step must promise in rounds with soft bounds, which need not converge."""
KNOT_GAIN_MIN = 0.03
"""Cost per knot [no unit]: where the first motion was feasible, a step that gains less is the last one."""
STEP_MAX = 0.4
"""Largest entry of a step that the linearisation is trusted for [m, rad]."""
ABANDON = 2.0
"""Times `STEP_MAX`: where the first Newton step is as large, the damping is raised at once."""
DAMPING, DAMPING_FEASIBLE, DAMPING_MIN, DAMPING_MAX, DAMPING_FACTOR = 1e-2, 1e-4, 1e-7, 1e6, 4.0
"""Damping at first, and where the first motion was feasible, so near the solution that less is needed; its bounds, as a
share of the Hessian's diagonal; by how much it is raised."""


def optimise(problem: TrajectoryProblem, config: TrajectoryConfig) -> float:
    """Improve the present motion of the problem, and answer what it costs with firm bounds."""
    problem.linearise(problem.now)
    feasible = problem.violation().max() <= FEASIBLE
    damping = DAMPING_FEASIBLE if feasible else DAMPING
    for softness, rounds in CONTINUATION_FEASIBLE if feasible else CONTINUATION:
        if softness < CONTINUATION[0][0]:
            problem.update_offset()
        if softness == 1.0:
            problem.bound_between()
        newton_steps = NEWTON_FEW
        problem.set_weights(config, softness)
        cost = problem.cost(problem.now)
        problem.assemble()
        for _ in range(rounds):
            if softness > 1.0 and problem.budget.half_spent:
                break
            promise, damping, exact = _trusted_step(problem, damping, newton_steps)
            if promise < PROMISE_MIN_SOFT * cost and softness > 1.0:
                break
            if promise < PROMISE_MIN * cost and not exact and newton_steps < NEWTON_ALL:
                newton_steps = NEWTON_ALL
                promise, damping, exact = _trusted_step(problem, damping, newton_steps)
            if promise < PROMISE_MIN * cost:
                break
            problem.move()
            problem.linearise(problem.trial)
            cost_new = problem.cost(problem.trial)
            ratio = (cost - cost_new) / max(promise, 1e-12)
            if not cost_new < cost:
                damping, newton_steps = DAMPING_FACTOR * damping, NEWTON_ALL
                continue
            problem.accept()
            gain, cost = (cost - cost_new) / cost, cost_new
            if feasible and gain * cost < KNOT_GAIN_MIN * problem.K:
                break
            problem.assemble()
            # Nielsen, Damping parameter in Marquardt's method, IMM-REP-1999-05.
            damping = max(damping * max(1.0 / 3.0, 1.0 - (2.0 * min(ratio, 1.0) - 1.0) ** 3), DAMPING_MIN)
            if gain < GAIN_MIN:
                if newton_steps == NEWTON_ALL or softness > 1.0:
                    break
                newton_steps = NEWTON_ALL
    return cost


def _trusted_step(problem: TrajectoryProblem, damping: float, newton_steps: int) -> tuple[float, float, bool]:
    """A step that the linearisation is trusted for; it promises nothing if the budget does not have it."""
    while problem.budget.affords(2 * problem.K):
        last = damping > DAMPING_MAX
        promise, size, exact = problem.step(damping, newton_steps, np.inf if last else ABANDON * STEP_MAX)
        if size < STEP_MAX or last:
            return promise, damping, exact
        damping *= DAMPING_FACTOR
    return 0.0, damping, True
