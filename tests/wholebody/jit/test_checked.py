"""Strategy: arguments of one kind after those of another, on a function that is not compiled, and the switch itself."""

from typing import NamedTuple

import numpy as np
import pytest

from wholebody.jit.checked import CLOSELY, RARELY, SWITCH, checked
from wholebody.jit.entry import Entry
from wholebody.jit.packed import Packed


class Pair(NamedTuple):
    """Two vectors."""

    a: np.ndarray
    b: np.ndarray


def area(values, width):
    """Sum of the values times the width."""
    return values.sum() * width


ROWS = np.ones((3, 2))


@pytest.mark.parametrize(
    ("first", "later"),
    [
        (ROWS, ROWS.astype(int)),
        (ROWS, ROWS.astype(np.float32)),
        (ROWS, np.asfortranarray(ROWS)),
        (ROWS, np.ones((3, 4))[:, ::2]),
        (ROWS, ROWS[0]),
        (np.asfortranarray(ROWS), ROWS),
        (Pair(ROWS, ROWS), Pair(ROWS, ROWS.T)),
        (Packed({"a": (2,)}, {}), Packed({"b": (2,)}, {})),
        (1, 1.0),
        (ROWS, None),
    ],
)
def test_memory_that_a_kernel_was_not_compiled_for_is_refused_by_name(first, later):
    call = checked(area, lambda values, width: 1.0, (first, 1.0))
    assert call(first, 2.0) == 1.0
    with pytest.raises(TypeError, match=r"area was compiled for values = .*, not .*: convert it before the call"):
        call(later, 1.0)


def test_whole_numbers_stand_for_reals_and_any_order_for_rows():
    call = checked(area, area, (np.ones((3, 4))[:, ::2], 1.0))
    assert call(ROWS, 2) == 12.0


def test_a_missing_argument_is_refused():
    with pytest.raises(TypeError, match="takes 2 arguments, not 1"):
        checked(area, area, (ROWS, 1.0))(ROWS)


@pytest.mark.parametrize("asked", [True, False])
def test_entries_compare_where_the_environment_asks_for_it(monkeypatch, asked):
    monkeypatch.setenv(SWITCH, "1" if asked else "")
    entry = Entry(area)
    monkeypatch.setattr(entry, "compile", lambda *arguments: area)
    assert entry(ROWS, 1.0) == 6.0
    if asked:
        with pytest.raises(TypeError, match="compiled for"):
            entry(ROWS.astype(int), 1.0)
    else:
        assert entry(ROWS.astype(int), 1.0) == 6.0


def test_a_kernel_that_is_called_often_is_still_looked_at():
    call = checked(area, lambda values, width: 1.0, (ROWS, 1.0))
    for _ in range(CLOSELY):
        call(ROWS, 2.0)
    with pytest.raises(TypeError, match="compiled for"):
        [call(ROWS[0], 2.0) for _ in range(RARELY)]
