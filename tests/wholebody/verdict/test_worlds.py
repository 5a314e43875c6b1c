"""Strategy: intervals of shares against published ones, and verdicts of worlds made by hand put together."""

import numpy as np
import pytest

from wholebody.types import Reason
from wholebody.verdict.report import lines
from wholebody.verdict.verdict import Verdict
from wholebody.verdict.violations import Severity, Violation
from wholebody.verdict.worlds import binomial_interval, in_worlds

GOOD = Verdict(name="wave", verdict="feasible", fell=False)
FALL = Violation(code=Reason.FALL, severity=Severity.INFEASIBLE, subject="pelvis tilted", time=3.2)
FELL = Verdict(name="wave", verdict="infeasible", fell=True, violations=[FALL])


@pytest.mark.parametrize(
    ("held", "n", "low", "high"),
    [(0, 10, 0.0, 0.3085), (5, 10, 0.1871, 0.8129), (9, 10, 0.5550, 0.9975), (20, 20, 0.8316, 1.0)],
)
def test_intervals_are_those_of_clopper_and_pearson(held, n, low, high):
    assert binomial_interval(held, n) == pytest.approx((low, high), abs=1e-4)


def test_an_interval_holds_the_true_share_as_often_as_it_says():
    rng, true = np.random.default_rng(0), 0.9
    inside = [low <= true <= high for low, high in (binomial_interval(int(k), 40) for k in rng.binomial(40, true, 300))]
    assert np.mean(inside) >= 0.95


def test_a_fall_in_one_world_makes_it_infeasible_and_names_the_seed():
    together = in_worlds(GOOD, [3, 4, 5], [GOOD, FELL, GOOD])
    assert (together.verdict, together.fell) == ("infeasible", False)
    assert (together.worlds.held, together.worlds.fell) == (2, (4,))
    assert "1 of 3 realistic worlds, seeds 4" in together.violations[0].subject
    text = "\n".join(lines(together))
    assert text.startswith("INFEASIBLE")
    assert "2 of 3 realistic worlds held, seeds 3 to 5" in text
    assert "fell with seeds 4" in text


def test_worlds_without_a_fall_leave_the_verdict_as_it_was():
    together = in_worlds(GOOD, [0, 1], [GOOD, GOOD])
    assert together.verdict == "feasible"
    assert together.worlds.share == 1.0
    assert "none fell" in "\n".join(lines(together))
