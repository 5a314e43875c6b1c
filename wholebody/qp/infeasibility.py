r"""Proof that a linear program has no solution: a Farkas vector, found by a linear program, cleaned, and checked here.

Of ``lower <= A x <= upper`` a vector ``y`` with ``A' y = 0`` and ``sum(max(y, 0) upper + min(y, 0) lower) < 0`` proves
that no ``x`` keeps all rows: weighed by ``y`` they would add up to ``0 <= (something negative)``.

Source:
    Farkas 1902; Gleeson and Ryan 1990, "Identifying Minimally Infeasible Subsystems of Inequalities", ORSA J. Comput.:
    the rows that a vertex of the cone of such vectors weighs are an infeasible set of which none can be left out.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

PROVEN = 1e-6
"""Largest entry of ``A' y`` where ``y`` is scaled to an excess of 1 [units of the rows]; definition."""
EXCESS_MIN = 1e-7
"""Smallest common excess, in terms of the rows' lengths, that counts as one [no unit]; derived: ten times what the
linear program is solved to."""
WEIGHED = 1e-9
"""Weight of a row, as a share of the largest, below which it is left out; chosen: rounding."""


@dataclass(frozen=True)
class LinearRows:
    """Rows ``lower <= A x <= upper``, by names.

    Attributes:
        A: Shape (m, n). lower, upper: Shape (m,), equal for equations, infinite where there is no side.
        labels: Of each row.
    """

    A: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    labels: tuple[str, ...]


@dataclass(frozen=True)
class FarkasCertificate:
    """Rows that no ``x`` keeps, and the weights that prove it.

    Attributes:
        rows: Those with a weight.
        y: Their weights, scaled to an excess of 1, shape (m,).
    """

    rows: LinearRows
    y: np.ndarray

    @property
    def residual(self) -> float:
        """Largest entry of ``A' y``."""
        return float(np.abs(self.rows.A.T @ self.y).max())

    @property
    def excess(self) -> float:
        """Amount by which the weighed bounds contradict themselves; a proof has more than 0."""
        return -_bound(self.rows, self.y)

    @property
    def proves(self) -> bool:
        """Whether it proves what it says, computed from rows and weights alone; NaN does not."""
        return self.residual <= PROVEN and self.excess > 0.5


def infeasibility(rows: LinearRows) -> FarkasCertificate | None:
    """A certificate that rows have no common solution; None if they have one, or none was found that proves it."""
    from scipy.optimize import linprog  # too slow to come with the package

    size = np.maximum(np.linalg.norm(rows.A, axis=1), 1e-12)
    A, lower, upper = rows.A / size[:, None], rows.lower / size, rows.upper / size
    above, below = np.isfinite(upper), np.isfinite(lower)
    # The smallest t by which all bounds have to give way; its multipliers are the weights.
    stacked = np.vstack([A[above], -A[below]])
    bounds = np.concatenate([upper[above], -lower[below]])
    cost = np.append(np.zeros(A.shape[1]), 1.0)
    found = linprog(
        cost,
        A_ub=np.hstack([stacked, -np.ones((len(stacked), 1))]),
        b_ub=bounds,
        bounds=[*[(None, None)] * A.shape[1], (0.0, None)],
        method="highs-ds",
    )
    if found.status != 0 or not found.x[-1] > EXCESS_MIN:
        return None
    weights, y = np.maximum(-found.ineqlin.marginals, 0.0), np.zeros(len(A))
    y[above] += weights[: above.sum()]
    y[below] -= weights[above.sum() :]
    certificate = _cleaned(rows, y / size)
    return certificate if certificate is not None and certificate.proves else None


def _cleaned(rows: LinearRows, y: np.ndarray) -> FarkasCertificate | None:
    """The rows with a weight, whose weights are solved for once more, exactly, and scaled to an excess of 1."""
    kept = np.abs(y) > WEIGHED * np.abs(y).max()
    few = LinearRows(rows.A[kept], rows.lower[kept], rows.upper[kept], tuple(np.array(rows.labels, dtype=object)[kept]))
    y = y[kept]
    side = np.where(y > 0.0, few.upper, few.lower)
    system, goal = np.vstack([few.A.T, side]), np.append(np.zeros(few.A.shape[1]), -1.0)
    y = y / -_bound(few, y)
    better = y + np.linalg.lstsq(system, goal - system @ y, rcond=None)[0]
    same = np.all((np.sign(better) == np.sign(y)) | (few.lower == few.upper))
    one = FarkasCertificate(few, better if same else y)
    return replace(one, y=one.y / one.excess) if one.excess > 0.0 else None


def _bound(rows: LinearRows, y: np.ndarray) -> float:
    """What the weighed bounds add up to."""
    side = np.where(y > 0.0, rows.upper, rows.lower)
    return float(np.sum(np.where(y == 0.0, 0.0, y * side)))
