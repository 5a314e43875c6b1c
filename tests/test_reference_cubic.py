"""Strategy: scipy's spline with the same slopes at the ends."""

import subprocess
import sys

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from wholebody.reference.cubic import ClampedCubic
from wholebody.reference.spline import DENSE, _solve_tridiagonal


@pytest.mark.parametrize("knots", [2, 3, 40])
def test_value_and_derivatives_are_those_of_scipy(knots):
    rng = np.random.default_rng(knots)
    x, y, slopes = np.cumsum(rng.uniform(0.02, 0.1, knots)), rng.normal(size=(knots, 7)), rng.normal(size=(2, 7))
    reference = CubicSpline(x, y, bc_type=((1, slopes[0]), (1, slopes[1])))
    s = np.concatenate([x, rng.uniform(x[0], x[-1], 200)])
    for order, got in enumerate(ClampedCubic(x, y, *slopes)(s)):
        wanted = reference(s, order)
        assert np.abs(got - wanted).max() < 1e-9 * max(1.0, np.abs(wanted).max())


def test_a_short_tridiagonal_system_has_the_solution_of_a_long_one():
    rng = np.random.default_rng(2)
    n = DENSE + 20
    lower, upper, diagonal = rng.normal(size=n), rng.normal(size=n), 4.0 + rng.uniform(size=n)
    right = rng.normal(size=(n, 3))
    lower[DENSE:] = upper[DENSE - 1 :] = 0.0
    whole = _solve_tridiagonal(lower, diagonal, upper, right)
    part = _solve_tridiagonal(*(values[:DENSE] for values in (lower, diagonal, upper, right)))
    assert np.abs(whole[:DENSE] - part).max() < 1e-13


def test_loading_the_supervisor_does_without_scipy():
    code = "import sys, wholebody.supervisor; print('scipy' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"
