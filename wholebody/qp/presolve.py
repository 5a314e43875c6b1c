r"""What a general solver needs before and after it sees one of our programs.

A whole-body program has two traits that first-order and interior-point solvers stumble over: slack variables whose
penalty is 10^6 times that of anything else, and variables whose curvature spans nine orders of magnitude. Both are
taken away here, and nothing of the program is changed by it:

- The slacks stay at zero as long as the hard program has a solution (exact penalty). So they are fixed there first, and
  their multipliers follow from stationarity; only if that has no acceptable answer are they given to the solver.
- Each variable is measured in units of ``1 / sqrt(H_ii)``, so that all have curvature one.

After the solver, `polish` solves for the active set that it found: from a few digits to all of them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wholebody.qp.problem import QuadraticProgram

Candidate = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]
"""x (n,), multipliers y of the equalities, z of the inequalities and z_box of the bounds, as in `QPSolution`."""
NO_BOUND = 1e8
"""Bounds on variables beyond this are none [units of the variable]; chosen: a tenth of `UNBOUNDED`."""
POLISH_REGULARISATION = 1e-9
"""Keeps the polishing system regular where active rows depend on each other [no unit]; chosen: refinement takes its
effect out."""
POLISH_REFINEMENTS = 5
"""Steps of iterative refinement."""


@dataclass(frozen=True)
class Prepared:
    """A program in the solver's units.

    Attributes:
        program: What the solver gets, without ``n_slack`` if the slacks are fixed; open bounds are infinite.
        scale: Units of its variables: ``x = scale * x_solver``, shape (n_kept,).
        original: The program it was made of.
    """

    program: QuadraticProgram
    scale: np.ndarray
    original: QuadraticProgram

    def restore(self, candidate: Candidate) -> Candidate:
        """The solver's answer in the units of the original, fixed slacks and their multipliers included."""
        (x_kept, y, z, z_kept), n = candidate, len(self.original.g)
        kept = len(self.scale)
        x, z_box = np.zeros(n), np.zeros(n)
        x[:kept], z_box[:kept] = self.scale * x_kept, z_kept / self.scale
        # A slack at zero carries whatever is left of its penalty; below zero it would rather be used.
        multiplier = self.original.H @ x + self.original.g + self.original.A.T @ y + self.original.C.T @ z
        z_box[kept:] = -multiplier[kept:]
        return x, y, z, z_box


def prepare(qp: QuadraticProgram, *, slack: bool) -> Prepared:
    """Scale a program, and fix its slacks at zero unless they are wanted.

    Args:
        qp: The program; its diagonal is positive.
        slack: Whether the slacks stay variables.
    """
    kept = len(qp.g) if slack else len(qp.g) - qp.n_slack
    scale = 1.0 / np.sqrt(np.diag(qp.H)[:kept])
    x_min = np.where(qp.x_min[:kept] > -NO_BOUND, qp.x_min[:kept] / scale, -np.inf)
    x_max = np.where(qp.x_max[:kept] < NO_BOUND, qp.x_max[:kept] / scale, np.inf)
    H = scale[:, None] * qp.H[:kept, :kept] * scale
    A, C = qp.A[:, :kept] * scale, qp.C[:, :kept] * scale
    program = QuadraticProgram(
        H, scale * qp.g[:kept], A, qp.b, C, qp.lower, qp.upper, x_min, x_max, qp.labels, qp.n_slack if slack else 0
    )
    return Prepared(program, scale, qp)


def polish(qp: QuadraticProgram, candidate: Candidate) -> Candidate:
    """Solve for the active set of a candidate as if its rows were equalities.

    Args:
        qp: The program, in the solver's units.
        candidate: An approximate answer: an inequality counts as active where its multiplier is not zero.

    Returns:
        The better answer if the active set is right; otherwise anything. Judge both and keep the better.
    """
    x, y, z, z_box = candidate
    rows, box = np.flatnonzero(z), np.flatnonzero(z_box)
    E = np.vstack([qp.A, qp.C[rows], np.eye(len(x))[box]])
    sides = [np.where(z[rows] > 0.0, qp.upper[rows], qp.lower[rows])]
    sides.append(np.where(z_box[box] > 0.0, qp.x_max[box], qp.x_min[box]))
    right = np.concatenate([-qp.g, qp.b, *sides])
    if not np.isfinite(right).all():
        return candidate
    n, m = len(x), len(E)
    K = np.block([[qp.H, E.T], [E, np.zeros((m, m))]])
    regular = K - POLISH_REGULARISATION * np.diag(np.concatenate([-np.ones(n), np.ones(m)]))
    step = np.linalg.inv(regular)
    answer = step @ right
    for _ in range(POLISH_REFINEMENTS):
        answer += step @ (right - K @ answer)
    multipliers = answer[n:]
    polished_z, polished_box = np.zeros_like(z), np.zeros_like(z_box)
    n_eq = len(y)
    polished_z[rows] = multipliers[n_eq : n_eq + len(rows)]
    polished_box[box] = multipliers[n_eq + len(rows) :]
    return answer[:n], multipliers[:n_eq], polished_z, polished_box
