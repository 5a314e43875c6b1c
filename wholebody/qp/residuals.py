"""KKT residuals: our own judgement of a QP solution, independent of any solver's flag."""

from __future__ import annotations

import numpy as np

from wholebody.qp.problem import QuadraticProgram, Residuals


def kkt_residuals(qp: QuadraticProgram, x: np.ndarray, y: np.ndarray, z: np.ndarray, z_box: np.ndarray) -> Residuals:
    """Residuals of the Karush-Kuhn-Tucker conditions.

    Args:
        qp: The program.
        x: Candidate minimiser, shape (n,).
        y: Multipliers of the equalities.
        z: Multipliers of the inequalities, positive at the upper side.
        z_box: Multipliers of the bounds, positive at the upper side.

    Returns:
        Residuals; NaN anywhere in the candidate makes them NaN, which no tolerance accepts.
    """
    rows = qp.C @ x
    primal = max(
        _largest(qp.A @ x - qp.b, absolute=True),
        _largest(rows - qp.upper),
        _largest(qp.lower - rows),
        _largest(x - qp.x_max),
        _largest(qp.x_min - x),
        0.0 if np.isfinite(x).all() else np.nan,
        key=lambda value: np.inf if np.isnan(value) else value,
    )
    gradient = qp.H @ x + qp.g + qp.A.T @ y + qp.C.T @ z + z_box
    # The penalty of the slacks is no measure of what the tasks want: with it, anything would look small.
    wanted = qp.g[: len(qp.g) - qp.n_slack]
    stationarity = _largest(gradient, absolute=True) / (1.0 + _largest(wanted, absolute=True))
    slack = np.concatenate([_gap(rows, qp.lower, qp.upper, z), _gap(x, qp.x_min, qp.x_max, z_box)])
    objective = abs(0.5 * x @ qp.H @ x + qp.g @ x)
    complementarity = _largest(slack, absolute=True) / (1.0 + objective)
    return Residuals(float(primal), float(stationarity), float(complementarity))


def _largest(values: np.ndarray, *, absolute: bool = False) -> float:
    if values.size == 0:
        return 0.0
    return float(np.max(np.abs(values)) if absolute else max(np.max(values), 0.0))


def _gap(value: np.ndarray, lower: np.ndarray, upper: np.ndarray, multiplier: np.ndarray) -> np.ndarray:
    """Multiplier times distance to the side it pushes on; zero where the multiplier is zero.

    A side that does not exist cannot push: there the multiplier itself is the error.
    """
    distance = np.where(multiplier > 0, value - upper, value - lower)
    return np.where(multiplier == 0, 0.0, multiplier * np.where(np.isinf(distance), 1.0, distance))
