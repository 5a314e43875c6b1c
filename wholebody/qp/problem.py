"""The quadratic program as data, apart from any solver.

minimise ``1/2 x' H x + g' x`` subject to ``A x = b``, ``lower <= C x <= upper`` and ``x_min <= x <= x_max``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wholebody.errors import InputError


@dataclass(frozen=True)
class QuadraticProgram:
    """One dense quadratic program with named rows.

    Attributes:
        H: Hessian, shape (n, n), symmetric positive definite.
        g: Gradient, shape (n,).
        A, b: Equalities, shapes (m_eq, n) and (m_eq,).
        C, lower, upper: Two-sided inequalities, shapes (m, n), (m,), (m,); infinite where one-sided.
        x_min, x_max: Bounds on the variables, shape (n,).
        labels: Name of each inequality row, length m: what to tell the user when it binds.
        n_slack: How many of the last variables are slacks: zero at best, and dear otherwise.
    """

    H: np.ndarray
    g: np.ndarray
    A: np.ndarray
    b: np.ndarray
    C: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    x_min: np.ndarray
    x_max: np.ndarray
    labels: tuple[str, ...] = ()
    n_slack: int = 0


def check_further(owner: str, *arrays: np.ndarray) -> None:
    """Refuse arrays of a further task or limit that are not finite: an `InputError` that names the owner."""
    if not all(np.isfinite(array).all() for array in arrays):
        raise InputError(f"a further {owner} asks for something that is not finite; its arrays must be, at every state")


@dataclass(frozen=True)
class Residuals:
    """Karush-Kuhn-Tucker residuals of a candidate solution, each a scaled maximum norm.

    Attributes:
        primal: Largest violation of any equality, inequality or bound.
        stationarity: Largest component of the Lagrangian's gradient, over ``1 + max|g|`` of all but slacks.
        complementarity: Largest |multiplier * distance to its bound|, over ``1 + |objective|``.
    """

    primal: float
    stationarity: float
    complementarity: float

    def within(self, primal: float, dual: float) -> bool:
        """Whether all residuals are inside their tolerances; NaN is not."""
        return bool(self.primal <= primal and self.stationarity <= dual and self.complementarity <= dual)


@dataclass(frozen=True)
class QPSolution:
    """A solver's answer with our own judgement of it.

    Attributes:
        x: Minimiser, shape (n,).
        y: Multipliers of the equalities, shape (m_eq,).
        z: Multipliers of the inequalities, shape (m,), positive at the upper side.
        z_box: Multipliers of the bounds, shape (n,), positive at the upper side.
        residuals: KKT residuals computed here, never taken from the solver.
        ok: Whether the residuals are inside the tolerances.
        solver: Name of the solver that answered.
        seconds: Thread CPU time that it and its judgement took [s].
    """

    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    z_box: np.ndarray
    residuals: Residuals
    ok: bool
    solver: str
    seconds: float = 0.0
