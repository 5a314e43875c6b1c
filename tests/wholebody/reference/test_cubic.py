"""Strategy: scipy's B-splines judge ours on random control points."""

import subprocess
import sys

import numpy as np
import pytest
from scipy.interpolate import BSpline

from wholebody.reference.cubic import CubicBSpline


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


def test_loading_the_supervisor_does_without_scipy():
    code = "import sys, wholebody.execution.supervisor; print('scipy' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"
