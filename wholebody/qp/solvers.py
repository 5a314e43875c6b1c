"""Solvers by name: a native path to daqp, every other one through qpsolvers.

The answer of any solver is judged by `kkt_residuals`; a solver's own success flag is never believed.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from wholebody.errors import InputError
from wholebody.qp.problem import QPSolution, QuadraticProgram, Residuals
from wholebody.qp.residuals import kkt_residuals

PRIMAL_TOLERANCE = {"daqp": 1e-5, "quadprog": 1e-5, "proxqp": 1e-4, "piqp": 1e-4, "osqp": 1e-2}
"""Largest accepted constraint violation per solver [m/s^2, rad/s^2, N, N m]; osqp is a low-accuracy method."""
DUAL_TOLERANCE = {"daqp": 1e-5, "quadprog": 1e-5, "proxqp": 1e-4, "piqp": 1e-4, "osqp": 1e-1}
"""Largest accepted scaled stationarity and complementarity residual per solver."""
BOX_GAP = 1e-6
"""Least distance kept between a variable's bounds: quadprog calls a pinched box inconsistent."""
DAQP_ITERATION_LIMIT = 200
"""daqp can cycle; past this many iterations the next solver is asked."""

_SETTINGS: dict[str, dict] = {
    "osqp": {"eps_abs": 1e-5, "eps_rel": 1e-5, "max_iter": 4000, "polishing": True},
    "proxqp": {"eps_abs": 1e-7, "eps_rel": 0.0, "max_iter": 1000},
    "piqp": {"eps_abs": 1e-8, "eps_rel": 1e-9},
}


def available() -> tuple[str, ...]:
    """Names that `solve` takes on this machine."""
    import qpsolvers

    return (
        "daqp",
        *(
            name
            for name in ("quadprog", "proxqp", "piqp", "osqp")
            if name in qpsolvers.dense_solvers or name in qpsolvers.sparse_solvers
        ),
    )


def solve(qp: QuadraticProgram, solver: str = "daqp", warm_start: np.ndarray | None = None) -> QPSolution:
    """Solve a program with one named solver and judge the answer.

    Args:
        qp: The program; its data must be finite (see `QuadraticProgram.check_finite`).
        solver: One of `available()`.
        warm_start: Guess of x for the solvers that use one, shape (n,).

    Returns:
        The candidate, whose ``ok`` is our own judgement. A solver that fails gives ``ok = False``, no exception.

    Raises:
        InputError: If the solver is unknown.
    """
    if solver == "daqp":
        return _judge(qp, "daqp", _solve_daqp(qp))
    if solver not in PRIMAL_TOLERANCE:
        raise InputError(f"unknown QP solver '{solver}'; available: {', '.join(available())}")
    return _judge(qp, solver, _solve_qpsolvers(qp, solver, warm_start))


Candidate = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray] | None
Backend = Callable[[QuadraticProgram], Candidate]


def _judge(qp: QuadraticProgram, solver: str, candidate: Candidate) -> QPSolution:
    if candidate is None:
        nothing = np.full(qp.g.shape, np.nan)
        empty = Residuals(np.inf, np.inf, np.inf)
        return QPSolution(nothing, np.zeros(len(qp.b)), np.zeros(len(qp.lower)), nothing, empty, False, solver)
    x, y, z, z_box = candidate
    residuals = kkt_residuals(qp, x, y, z, z_box)
    ok = residuals.within(PRIMAL_TOLERANCE[solver], DUAL_TOLERANCE[solver])
    return QPSolution(x, y, z, z_box, residuals, ok, solver)


def _solve_daqp(qp: QuadraticProgram) -> Candidate:
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


def _solve_qpsolvers(qp: QuadraticProgram, solver: str, warm_start: np.ndarray | None) -> Candidate:
    import qpsolvers

    has_upper, has_lower = np.isfinite(qp.upper), np.isfinite(qp.lower)
    G = np.vstack([qp.C[has_upper], -qp.C[has_lower]])
    h = np.concatenate([qp.upper[has_upper], -qp.lower[has_lower]])
    x_max = np.maximum(qp.x_max, qp.x_min + BOX_GAP)
    problem = qpsolvers.Problem(qp.H, qp.g, G, h, qp.A, qp.b, qp.x_min, x_max)
    if solver == "osqp":
        from scipy.sparse import csc_matrix

        problem.P, problem.G, problem.A = csc_matrix(qp.H), csc_matrix(G), csc_matrix(qp.A)
    solution = qpsolvers.solve_problem(problem, solver, initvals=warm_start, **_SETTINGS.get(solver, {}))
    if solution.x is None or solution.z is None:
        return None
    n_upper = int(has_upper.sum())
    z = np.zeros(len(qp.upper))
    z[has_upper] += solution.z[:n_upper]
    z[has_lower] -= solution.z[n_upper:]
    z_box = solution.z_box if solution.z_box is not None and solution.z_box.size else np.zeros(len(qp.g))
    return solution.x, solution.y, z, z_box
