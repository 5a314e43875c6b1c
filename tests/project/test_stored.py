"""The store behind `make regression`: what is written is found again, what changed is reported with its versions."""

from pathlib import Path

import pytest

from tests.support.stored import BEGIN, DOCUMENT, END, StoredValues, current_versions, document

pytest_plugins = ["pytester"]


def store(tmp_path, value=1.5):
    values = StoredValues(tmp_path / "regression" / "test_x.json", "test_a", update=True)
    values.check("rms_mm", value, tolerance=0.1)
    values.save()
    return values.path


def checked(path, name, value, *, test="test_a", **bounds):
    values = StoredValues(path, test, update=False)
    values.check(name, value, **bounds)
    values.judge()


def test_a_stored_value_is_compared_within_its_tolerance(tmp_path):
    path = store(tmp_path)
    checked(path, "rms_mm", 1.6, tolerance=0.11)
    with pytest.raises(AssertionError, match=r"rms_mm = 1\.7, stored 1\.5.*mujoco.*regression-update"):
        checked(path, "rms_mm", 1.7, tolerance=0.11)


def test_a_value_that_was_never_stored_fails(tmp_path):
    path = store(tmp_path)
    with pytest.raises(AssertionError, match="no stored value"):
        checked(path, "max_mm", 1.0, tolerance=1.0)
    with pytest.raises(AssertionError, match="no stored value"):
        checked(path, "rms_mm", 1.5, test="test_b", tolerance=1.0)


def test_a_bar_once_met_stays_met_whatever_the_tolerance(tmp_path):
    path = store(tmp_path)
    checked(path, "rms_mm", 1.9, tolerance=1.0, at_most=2.0)
    with pytest.raises(AssertionError, match=r"rms_mm = 2\.1 \(stored 1\.5\), bar <= 2: MISSED: it was met before"):
        checked(path, "rms_mm", 2.1, tolerance=1.0, at_most=2.0)
    with pytest.raises(AssertionError, match=r"bar >= 1\.4: MISSED"):
        checked(path, "rms_mm", 1.3, tolerance=1.0, at_least=1.4)


def test_a_bar_that_was_never_met_is_reported_only(tmp_path):
    values = StoredValues(store(tmp_path), "test_a", update=False)
    values.check("rms_mm", 1.6, tolerance=0.2, at_most=1.0)
    values.judge()
    assert str(values.measured[-1]) == "rms_mm = 1.6 (stored 1.5), bar <= 1: MISSED"


def test_a_test_with_a_changed_value_fails_and_still_names_the_others(pytester, monkeypatch):
    """The fixture as the studies use it, in a session of its own."""
    here = Path(__file__).parents[1]
    monkeypatch.setenv("PYTHONPATH", str(here.parent))
    (pytester.path / "conftest.py").write_text((here / "conftest.py").read_text())
    pytester.makepyfile(
        test_y="""
        def test_z(stored):
            stored.check("rms_mm", 1.0, tolerance=0.1, at_most=2.0)
            stored.check("max_mm", 3.0, tolerance=0.1)
        """
    )
    result = pytester.runpytest_subprocess()
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["test_z: rms_mm = 1, bar <= 2: met; max_mm = 3"])
    pytester.runpytest_subprocess("--regression-update").assert_outcomes(passed=1)
    pytester.runpytest_subprocess().assert_outcomes(passed=1)


@pytest.mark.parametrize("update", [True, False])
def test_nan_is_never_stored_and_never_passes(tmp_path, update):
    path = store(tmp_path)
    with pytest.raises(AssertionError, match="nan"):
        StoredValues(path, "test_a", update=update).check("rms_mm", float("nan"), tolerance=1.0)


def test_storing_one_test_keeps_the_others_and_their_stamps(tmp_path):
    path = store(tmp_path)
    other = StoredValues(path, "test_b", update=True)
    other.check("falls", 0, tolerance=0.0)
    other.save()
    kept = StoredValues(path, "test_a", update=False)
    kept.check("rms_mm", 1.5, tolerance=0.0)
    kept.judge()
    assert kept.entry["versions"] == current_versions()
    assert kept.entry["versions"]["mujoco"] != "not installed"


def test_comparing_writes_nothing(tmp_path):
    path = store(tmp_path)
    before = path.read_text()
    values = StoredValues(path, "test_a", update=False)
    values.check("rms_mm", 1.55, tolerance=0.1)
    values.save()
    assert path.read_text() == before


def test_the_document_shows_the_stored_values_and_marks_missed_bars(tmp_path):
    values = StoredValues(tmp_path / "test_main_job.json", "test_reach[low]", update=True)
    values.check("end_mm", 2.5, tolerance=0.1, at_most=2.0)
    values.check("distance_mm", 12.0, tolerance=0.1, at_least=10.0)
    values.check("rms_mm", 1.25, tolerance=0.1)
    values.save()
    text = document(f"before\n{BEGIN}\nold\n{END}\nafter\n", tmp_path)
    assert text.startswith("before\n")
    assert text.endswith(f"{END}\nafter\n")
    assert "old" not in text
    assert "| `test_reach and low` | distance_mm 12 (≥ 10), **end_mm 2.5** (≤ 2), rms_mm 1.25 |" in text


def test_the_documentation_shows_what_is_stored():
    text = DOCUMENT.read_text()
    assert text == document(text), "python tests/support/stored.py writes it anew"
