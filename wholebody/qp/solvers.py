"""Solvers by name: daqp and proxqp by their own interfaces, every other one through qpsolvers.

The answer of any solver is judged by `kkt_residuals`; a solver's own success flag is never believed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from time import thread_time

import numpy as np

from wholebody.errors import InputError
from wholebody.qp.presolve import Candidate, polish, prepare
from wholebody.qp.problem import QPSolution, QuadraticProgram, Residuals
from wholebody.qp.residuals import kkt_residuals

ACCEPTED = {"daqp": 1e-5, "quadprog": 1e-5, "proxqp": 1e-4, "piqp": 1e-5, "osqp": 1e-3}
"""Largest accepted violation of a constraint, and scaled stationarity and complementarity residual, per solver [m/s^2,
rad/s^2, N, N m; scaled]; chosen: osqp is a low-accuracy method."""
EXACT = 1e-9
"""Residuals below which an answer is not polished [units of the rows]; chosen, no trial is on record."""
BOX_GAP = 1e-6
"""Least distance kept between a variable's bounds [units of the variable]; chosen: quadprog calls a pinched box
inconsistent."""
DAQP_ITERATION_LIMIT = 200
"""daqp can cycle; past this many iterations the next solver is asked."""
PROXQP_ITERATION_LIMIT = 1000
"""Most iterations of proxqp, which needs 4 to 40 on our programs."""
PROXQP_ACCURACY = 1e-7
"""Absolute accuracy asked of it [units of the rows]; chosen: polishing does the rest."""
PROXQP_INFEASIBILITY = 1e-30
"""Infeasibility tolerance of proxqp in its own terms [no unit]; by trial: its default 1e-4 takes one in fifteen of
our feasible programs for infeasible at the first iteration."""
_SETTINGS: dict[str, dict[str, float]] = {
    "quadprog": {},
    "piqp": {"eps_abs": 1e-8, "eps_rel": 1e-9},
    "osqp": {"eps_abs": 1e-5, "eps_rel": 0.0, "max_iter": 20000},
}
"""Settings of the solvers asked through qpsolvers. osqp without its own polishing, which prints to standard output;
ours follows. A relative accuracy would let its forces of 500 N be wrong where joints of 0.5 rad/s^2 should not be."""

_FROM_QPSOLVERS = frozenset(ACCEPTED)
"""Solvers that qpsolvers may have or lack; one that is added to `ACCEPTED` later is there."""


def available() -> tuple[str, ...]:
    """Names that `solve` takes on this machine: those installed, and any that were added."""
    import qpsolvers

    installed = {*qpsolvers.dense_solvers, *qpsolvers.sparse_solvers}
    return tuple(name for name in ACCEPTED if name in installed or name not in _FROM_QPSOLVERS)


def solve(qp: QuadraticProgram, solver: str = "daqp") -> QPSolution:
    """Solve a program with one named solver and judge the answer.

    Args:
        qp: The program; its data must be finite: a NaN row makes solvers report success with that limit gone.
        solver: One of `available()`.

    Returns:
        The candidate, whose ``ok`` is our own judgement. A solver that fails gives ``ok = False``, no exception.

    Raises:
        InputError: If the solver is unknown.
    """
    start = thread_time()
    if solver == "daqp":
        answer = _judge(qp, "daqp", _solve_daqp(qp))
    elif solver in available():
        answer = _solve_prepared(qp, solver, slack=False)
        # Only a robot that has been pushed over a safety bound needs slack.
        answer = answer if answer.ok else _solve_prepared(qp, solver, slack=True)
    else:
        raise InputError(
            f"unknown QP solver '{solver}'; available: {', '.join(available())}; the extra `solvers` brings all"
        )
    return replace(answer, seconds=thread_time() - start)


def _solve_prepared(qp: QuadraticProgram, solver: str, *, slack: bool) -> QPSolution:
    prepared = prepare(qp, slack=slack)
    candidate = _BACKENDS[solver](prepared.program)
    if candidate is None:
        return _judge(qp, solver, None)
    answer = _judge(qp, solver, prepared.restore(candidate))
    if _worst(answer) < EXACT:
        return answer
    polished = _judge(qp, solver, prepared.restore(polish(prepared.program, candidate)))
    return polished if _worst(polished) < _worst(answer) else answer


def _judge(qp: QuadraticProgram, solver: str, candidate: Candidate | None) -> QPSolution:
    if candidate is None:
        nothing = np.full(qp.g.shape, np.nan)
        empty = Residuals(np.inf, np.inf, np.inf)
        return QPSolution(nothing, np.zeros(len(qp.b)), np.zeros(len(qp.lower)), nothing, empty, False, solver)
    x, y, z, z_box = candidate
    residuals = kkt_residuals(qp, x, y, z, z_box)
    ok = residuals.within(ACCEPTED[solver], ACCEPTED[solver])
    return QPSolution(x, y, z, z_box, residuals, ok, solver)


def _worst(answer: QPSolution) -> float:
    r = answer.residuals
    return float(np.nan_to_num(max(r.primal, r.stationarity, r.complementarity), nan=np.inf))


def _solve_daqp(qp: QuadraticProgram) -> Candidate | None:
    import daqp

    n, m = len(qp.g), len(qp.lower)
    upper = np.concatenate([np.maximum(qp.x_max, qp.x_min + BOX_GAP), qp.upper, qp.b])
    lower = np.concatenate([qp.x_min, qp.lower, qp.b])
    sense = np.zeros(len(upper), dtype=np.int32)
    sense[n + m :] = 5
    x, _, flag, info = daqp.solve(
        qp.H, qp.g, np.vstack([qp.C, qp.A]), upper, lower, sense, iter_limit=DAQP_ITERATION_LIMIT
    )
    if flag <= 0:
        return None
    multipliers = np.asarray(info["lam"])
    return np.asarray(x), multipliers[n + m :], multipliers[n : n + m], multipliers[:n]


def _solve_proxqp(qp: QuadraticProgram) -> Candidate | None:
    from proxsuite import proxqp

    solver = proxqp.dense.QP(len(qp.g), len(qp.b), len(qp.lower), True)
    settings = solver.settings
    settings.eps_abs, settings.eps_rel, settings.max_iter = PROXQP_ACCURACY, 0.0, PROXQP_ITERATION_LIMIT
    settings.eps_primal_inf = settings.eps_dual_inf = PROXQP_INFEASIBILITY
    solver.init(qp.H, qp.g, qp.A, qp.b, qp.C, qp.lower, qp.upper, qp.x_min, qp.x_max)
    solver.solve()
    m, r = len(qp.lower), solver.results
    return r.x, r.y, r.z[:m], r.z[m:]


def _solve_qpsolvers(qp: QuadraticProgram, solver: str) -> Candidate | None:
    import qpsolvers

    has_upper, has_lower = np.isfinite(qp.upper), np.isfinite(qp.lower)
    G = np.vstack([qp.C[has_upper], -qp.C[has_lower]])
    h = np.concatenate([qp.upper[has_upper], -qp.lower[has_lower]])
    x_max = np.maximum(qp.x_max, qp.x_min + BOX_GAP)
    problem = qpsolvers.Problem(qp.H, qp.g, G, h, qp.A, qp.b, qp.x_min, x_max)
    if solver == "osqp":
        from scipy.sparse import csc_matrix

        problem.P, problem.G, problem.A = csc_matrix(qp.H), csc_matrix(G), csc_matrix(qp.A)
    solution = qpsolvers.solve_problem(problem, solver, **_SETTINGS[solver])
    if solution.x is None or solution.z is None:
        return None
    n_upper = int(has_upper.sum())
    z = np.zeros(len(qp.upper))
    z[has_upper] += solution.z[:n_upper]
    z[has_lower] -= solution.z[n_upper:]
    z_box = solution.z_box if solution.z_box is not None and solution.z_box.size else np.zeros(len(qp.g))
    return solution.x, solution.y, z, z_box


_BACKENDS: dict[str, Callable[[QuadraticProgram], Candidate | None]] = {
    "proxqp": _solve_proxqp,
    **{name: partial(_solve_qpsolvers, solver=name) for name in _SETTINGS},
}
