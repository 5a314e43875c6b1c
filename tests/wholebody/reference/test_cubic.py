"""Strategy: scipy's B-splines judge ours on random control points."""

import subprocess
import sys

import numpy as np
import pytest
from scipy.interpolate import BSpline

from wholebody.reference.cubic import CubicBSpline
from wholebody.reference.spline import DENSE, _solve_tridiagonal


@pytest.mark.parametrize("n", [4, 5, 30])
def test_the_curve_and_its_derivatives_are_scipys(n):
    rng, start, step = np.random.default_rng(n), 0.3, 0.067
    points = rng.normal(size=(n, 7))
    judge = BSpline(start + step * np.arange(-3.0, n + 1.0), points, 3)
    x = np.linspace(start, start + (n - 3) * step, 101)
    for order, got in enumerate(CubicBSpline(start, step, points)(x)):
        expected = judge(x, order)
        assert np.allclose(got[:-1], expected[:-1], rtol=1e-9, atol=1e-9 * np.abs(expected).max())


def test_at_a_knot_the_second_derivative_is_the_second_difference():
    points, step = np.random.default_rng(1).normal(size=(6, 2)), 0.1
    _, _, bend = CubicBSpline(0.0, step, points)(step * np.arange(3.0))
    assert np.allclose(bend, np.diff(points, 2, axis=0)[:3] / step**2)


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
    code = "import sys, wholebody.execution.supervisor; print('scipy' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"
