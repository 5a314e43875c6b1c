"""Statistics over all frames alike, their merging, and floors under ranges."""

import numpy as np
import pytest

from policy.action_spec.builtin import builtin
from policy.dataset.stats import QUANTILES, WIDTH_MIN, in_units, merged, narrow, plain, statistics, widened

RNG = np.random.default_rng(0)
LAYOUT = builtin("wbc32")


def test_quantiles_are_numpys_over_all_rows():
    values = RNG.normal(size=(500, 3)) * [1.0, 10.0, 0.1]
    found = statistics(values)
    for name, share in QUANTILES.items():
        assert np.allclose(found[name], np.quantile(values, share, axis=0), atol=1e-12)
    assert found["count"].tolist() == [500]
    assert np.allclose(found["std"], values.std(axis=0))


def test_a_column_of_scalars_has_statistics_of_length_one():
    assert statistics(np.arange(5))["mean"].tolist() == [2.0]


def test_single_precision_does_not_cost_the_mean_of_large_numbers():
    values = (1e6 + RNG.uniform(size=20000)).astype(np.float32)
    assert np.isclose(statistics(values)["mean"][0], values.astype(float).mean(), rtol=1e-12)


def test_merged_statistics_are_those_of_the_whole():
    parts = [RNG.normal(size=(n, 3)) + n for n in (5, 20, 9)]
    found = merged([{"camera": plain({"camera": statistics(part)})["camera"]} for part in parts])["camera"]
    whole = statistics(np.concatenate(parts))
    for name in ("min", "max", "mean", "std", "count"):
        assert np.allclose(found[name], whole[name])
    assert "q01" not in found


def test_merged_statistics_keep_the_shape_of_a_camera():
    part = {name: [[[0.1]], [[0.2]], [[0.3]]] for name in ("min", "max", "mean", "std")} | {"count": [4]}
    found = merged([{"camera": part}, {"camera": part}])["camera"]
    assert found["mean"] == part["mean"]
    assert found["count"] == [8]


def test_a_feature_that_one_part_lacks_is_not_merged():
    assert merged([{"a": {}}, {}]) == {}
    assert merged([]) == {}


def test_numbers_that_do_not_move_are_narrow():
    values = RNG.uniform(-0.5, 0.5, size=(100, 32))
    values[:, 7] = 0.3
    values[:, 20] = 0.2 + 1e-4 * RNG.uniform(size=100)
    assert narrow(statistics(values), LAYOUT).tolist() == [7, 20]


@pytest.mark.parametrize("least", [WIDTH_MIN, 0.05])
def test_a_floor_widens_narrow_ranges_around_their_centre_and_no_other(least):
    values = RNG.uniform(-0.5, 0.5, size=(100, 32))
    values[:, 7] = 0.3
    before = statistics(values)
    after = widened(before, in_units(LAYOUT, least))
    assert np.isclose(after["q01"][7], 0.3 - 0.5 * least)
    assert np.isclose(after["q99"][7], 0.3 + 0.5 * least)
    assert after["std"][7] > 0.0
    others = np.arange(32) != 7
    for name in ("min", "max", "q01", "q99", "std", "mean"):
        assert np.allclose(after[name][others], before[name][others], atol=1e-12)
    assert not len(narrow(after, LAYOUT, least * (1.0 - 1e-9)))
    assert widened(before, np.zeros(LAYOUT.dim))["q01"].tolist() == before["q01"].tolist()
