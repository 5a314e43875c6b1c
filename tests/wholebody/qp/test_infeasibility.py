"""Strategy: rows whose answer is known by construction, seeded random ones held against their construction."""

from dataclasses import replace

import numpy as np
import pytest

from wholebody.qp.infeasibility import LinearRows, infeasibility

TRIANGLE = LinearRows(
    np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, -1.0]]),
    np.array([-np.inf, -np.inf, 3.0, -5.0]),
    np.array([1.0, 1.0, np.inf, 5.0]),
    ("x at most 1", "y at most 1", "sum at least 3", "loose"),
)


def test_only_the_rows_that_forbid_are_in_the_proof():
    found = infeasibility(TRIANGLE)
    assert found.rows.labels == ("x at most 1", "y at most 1", "sum at least 3")
    np.testing.assert_allclose(found.y, [1.0, 1.0, -1.0], atol=1e-9)
    assert found.proves


def test_what_has_a_solution_has_no_proof():
    assert infeasibility(replace(TRIANGLE, lower=np.array([-np.inf, -np.inf, 2.0, -5.0]))) is None


def test_weights_that_prove_nothing_are_told_from_a_proof():
    found = infeasibility(TRIANGLE)
    assert not replace(found, y=found.y * [1.0, 1.0 + 1e-5, 1.0]).proves
    assert not replace(found, y=-found.y).proves
    assert not replace(found, y=found.y * np.nan).proves


@pytest.mark.parametrize("seed", range(20))
def test_rows_that_contradict_each_other_by_construction_are_proven_and_others_are_not(seed):
    rng = np.random.default_rng(seed)
    A, x = rng.normal(size=(40, 12)) * 10.0 ** rng.uniform(-2, 2, (40, 1)), rng.normal(size=12)
    lower, upper = A @ x - rng.uniform(0.0, 1.0, 40), A @ x + rng.uniform(0.0, 1.0, 40)
    equal = rng.random(40) < 0.2
    lower[equal] = upper[equal] = (A @ x)[equal]
    names = tuple(map(str, range(40)))
    assert infeasibility(LinearRows(A, lower, upper, names)) is None
    weights = rng.uniform(0.1, 1.0, 5)
    more, bound = weights @ A[:5], weights @ upper[:5] + 0.01
    found = infeasibility(
        LinearRows(np.vstack([A, more]), np.append(lower, bound), np.append(upper, np.inf), (*names, "more"))
    )
    assert found.proves
    assert "more" in found.rows.labels
