"""Strategy: kernels that use every part of the language, compiled, against the same functions interpreted, on random
and on special numbers: results must be equal to the bit. What is outside the language, and arguments of other kinds
than were compiled for, are refused by name.
"""

import math
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from models.cache import CACHE_VARIABLE
from wholebody.jit import entry
from wholebody.jit.checked import BOUNDS
from wholebody.jit.compiler import machine
from wholebody.jit.compiler.kinds import KernelError
from wholebody.jit.entry import Entry
from wholebody.jit.record import record

ROOT = Path(__file__).parents[3]
TABLE = np.array([[3.0, 1.0], [4.0, 1.5]])
SPANS = ((0, 2, 1), (2, 5, 3))
SCALE, COUNT = 0.1, 3
LIMITS = record(("speed", 3), ("most",))


class Pair(NamedTuple):
    """Two arrays by name."""

    first: np.ndarray
    second: np.ndarray


@pytest.fixture(autouse=True)
def here(monkeypatch, tmp_path):
    monkeypatch.setattr(entry, "PACKAGES", ("wholebody", "tests"))
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path))


def integers(a, b, out):
    """Quotients and remainders have the sign that Python gives them."""
    out[0], out[1], out[2], out[3] = a // b, a % b, a // 4, a % -3
    out[4], out[5], out[6] = -a, abs(a), a**3
    out[7] = a * 1 + (a > b) + int(a < 0) + max(a, b, 2) - min(3, a)


def reals(x, y, out):
    """Operators and functions of reals."""
    out[0], out[1], out[2], out[3] = x / y, x**2, x**3, math.sqrt(abs(x))
    out[4], out[5], out[6], out[7] = math.atan2(x, y), math.hypot(x, y), math.copysign(x, y), math.log1p(abs(x))
    out[8], out[9], out[10], out[11] = max(x, y), min(x, y), abs(x), -x
    out[12], out[13] = round(x), int(x)
    out[14] = math.acos(min(abs(x), 1.0)) + math.exp(-abs(y)) + math.sin(x) * math.cos(y) + 3 * x + COUNT / 2
    out[15] = 1.0 if (math.isfinite(x) and not x > y) or x == 7 else -1.0
    out[16] = 2.0 if -1.0 < x <= 0.5 < y else SCALE
    out[17] = x**0.5 if x > 0.0 else math.pi


def widened(n):
    """Integers that become reals in a loop, and a name that is an integer and later a real."""
    total = 0
    a, b = SCALE * n, 2.0
    for a in range(n):
        total += a
    for k in range(n, -1, -2):
        total = total + 0.5 * k if k % 2 == 1 else total - b
        if total > 40:
            break
        if k == 3:
            continue
        total += 1
    while True:
        total *= 1.5
        if abs(total) > 10 or n < 0:
            return total, n
        total += 0.25


def leave(values, bound):
    """Returns from within loops, and a loop over an array."""
    for value in values:
        if value > bound:
            return value
    return 0


def views(a, b, out):
    """Views of views, of strided arrays too, set and copied."""
    row = a[1]
    part = row[1:3]
    part[0] += 10.0
    b[:] = 0.0
    b[0, :2] = part
    tail = a[0, 1:]
    out[0], out[1], out[2] = tail[-1], tail.shape[0], a.reshape(a.size)[5]
    out[3:5] = a[2][:2]
    block = a[1:, :2]
    out[5], out[6], out[7] = block[1, 1], block.shape[0], block.size
    out[8] = a[0, 7:].shape[0]
    x = y = out[9] = a.shape[1] + a.ndim
    out[10] = x + y


def records(hands, pair, k):
    """Fields of records, named tuples, tuples by an index that is not known, tables and tuples from outside."""
    hand = hands[k]
    hand.most += 1.5
    for i in range(hand.speed.shape[0]):
        hand.speed[i] = 2 * hand.speed[i] + pair.first[i] * TABLE[k, 1]
    rows = pair.first, pair.second
    total = rows[k][0]
    for begin, end, step in SPANS:
        for i in range(begin, end, step):
            total += pair.second[i % 3] * i
    for weight, row in ((1.0, pair.first), (2.0, pair.second)):
        total += weight * row[1]
    if k in (0, 2) and k not in (5,):
        total += len(pair.first)
    return total, k == 1, hand.most


def narrow(x, flags, out):
    """Numbers of four bytes, whole numbers of four, truth values in memory."""
    for i in range(x.shape[0]):
        x[i] = min(max(x[i] * np.float32(1.0 / 6.0) + np.float32(0.5), np.float32(0.0)), np.float32(1.0))
        flags[i] = x[i] > 0.25 and not flags[i]
        out[i] = out[i] * 3 + flags[i]


def both(function, *arguments):
    """What a kernel answers compiled and interpreted, each with what it did to arrays."""

    def copied():
        return [Pair(*map(np.copy, one)) if isinstance(one, Pair) else np.copy(one) if isinstance(one, np.ndarray)
                else one for one in arguments]  # fmt: skip

    found = []
    for one in (Entry(function), function):
        given = copied()
        with np.errstate(all="ignore"):
            found.append((one(*given), given))
    return found


def assert_equal(function, *arguments):
    (one, given), (other, wanted) = both(function, *arguments)
    assert one == other
    assert type(one) is type(other) or isinstance(other, np.generic | int)
    for a, b in zip(given, wanted, strict=True):
        for x, y in zip(*[v if isinstance(v, tuple) else (v,) for v in (a, b)], strict=True):
            assert np.asarray(x).tobytes() == np.asarray(y).tobytes()


@pytest.mark.parametrize(("a", "b"), [(7, 3), (-7, 3), (7, -3), (-7, -3), (0, 5), (9, 3), (-9, 3)])
def test_integers_are_those_of_python(a, b):
    assert_equal(integers, a, b, np.zeros(8, np.int64))


def test_reals_are_those_of_python_to_the_bit():
    compiled = Entry(reals)
    generator = np.random.default_rng(0)
    for x, y in [*generator.normal(size=(50, 2)).tolist(), (-0.0, 0.5), (2.5, 1.0), (-0.5, 3.0), (1e-310, 7.0)]:
        one, other = np.zeros(18), np.zeros(18)
        compiled(x, y, one)
        reals(x, y, other)
        assert one[2] == pytest.approx(other[2], rel=3e-16)  # products, where Python asks C's library for the power
        one[2] = other[2]
        assert one.tobytes() == other.tobytes(), (x, y, one - other)


def test_division_by_zero_is_that_of_numpy():
    out = np.zeros(18)
    Entry(reals)(1.0, 0.0, out)
    assert out[0] == math.inf


@pytest.mark.parametrize("n", [0, 1, 4, 9, 30])
def test_names_become_as_wide_as_what_they_are_set_to(n):
    assert_equal(widened, n)


def test_loops_are_left_where_python_leaves_them():
    for bound in (0.5, 9.0):
        assert_equal(leave, np.array([0.1, 0.7, 0.9]), bound)


def test_views_are_those_of_numpy_in_any_order_of_memory():
    a, b = np.arange(12.0).reshape(3, 4), np.ones((2, 3))
    assert_equal(views, a, b, np.zeros(11))
    (_, given), (_, wanted) = both(views, a, b[:, ::-1], np.zeros(11))
    assert all(np.array_equal(x, y) for x, y in zip(given, wanted, strict=True))
    strided, whole = np.zeros(22)[::2], np.zeros(11)
    Entry(views)(a.copy(), b, strided)
    views(a.copy(), b, whole)
    assert np.array_equal(strided, whole)


@pytest.mark.parametrize("k", [0, 1])
def test_records_and_tuples_are_read_and_written(k):
    hands = np.zeros(2, LIMITS)
    hands["speed"], hands["most"] = np.arange(6.0).reshape(2, 3), [1.0, 2.0]
    compiled, interpreted = hands.copy(), hands.copy().view(np.recarray)
    pair = Pair(np.array([1.0, 2.0, 3.0]), np.array([0.5, 0.25, 8.0]))
    assert Entry(records)(compiled, pair, k) == records(interpreted, pair, k)
    assert compiled.tobytes() == interpreted.tobytes()


def test_numbers_in_memory_are_rounded_to_what_fits_there():
    x = np.random.default_rng(1).normal(size=9).astype(np.float32) * 4
    assert_equal(narrow, x, x > 0, np.arange(-4, 5, dtype=np.int32))


def unknown(a):
    """Uses what kernels have not."""
    return sorted(a)


def arrays(a, b):
    """Arithmetic of whole arrays."""
    b[:] = a + a


def torn(a):
    """A name that is a number or an array."""
    b = a
    if a.shape[0] > 2:
        b = 1.0
    return b[0]


def again(n):
    """Calls itself."""
    return again(n - 1) if n > 0 else 0


def doubtful(a):
    """'or' of numbers."""
    return a[0] or 1.0


@pytest.mark.parametrize(
    ("kernel", "arguments", "message"),
    [
        (unknown, (np.zeros(3),), "unknown, line [0-9]+: kernels do not call sorted"),
        (arrays, (np.zeros(3), np.zeros(3)), "whole arrays need a loop"),
        (torn, (np.zeros(3),), "one name cannot stand for"),
        (again, (3,), "again calls itself"),
        (doubtful, (np.zeros(3),), "'and' and 'or' are of truth values"),
        (leave, ("abc", 1.0), "not str"),
        (leave, (np.zeros(3, complex), 1.0), "no arrays of complex128"),
    ],
)
def test_what_is_outside_the_language_is_refused_by_name(kernel, arguments, message):
    with pytest.raises(KernelError, match=message):
        Entry(kernel)(*arguments)


@pytest.mark.parametrize(
    "given",
    [np.zeros(3, np.float32), np.zeros(3, np.int64), np.zeros((3, 1)), np.zeros(6)[::2], [0.0, 1.0], None, 3.0,
     np.zeros(3, ">f8")],
)  # fmt: skip
def test_an_argument_of_another_kind_than_was_compiled_for_is_refused(given):
    compiled = Entry(leave).compile(np.array([1.0, 3.0]), 2.0)
    assert compiled(np.array([1.0, 3.0]), 2.0) == 3.0
    with pytest.raises(TypeError, match="leave: argument 1 is not an array of float64 of 1 dimensions in C order"):
        compiled(given, 2.0)
    with pytest.raises(TypeError):
        compiled(np.zeros(3), "2.0")
    with pytest.raises(TypeError, match="takes 2 arguments"):
        compiled(np.zeros(3))


def entry_at(a, i, out):
    """An entry, a row from there on, and what is left of it."""
    out[0] = a[i, 0] + a[i:].shape[0] + a.reshape((a.size,))[i]


OUTSIDE = """
import sys
import numpy as np
from tests.wholebody.jit.test_compiler import entry_at
from wholebody.jit.entry import Entry
out = np.zeros(1)
Entry(entry_at)(np.arange(6.0).reshape((3, 2))[: int(sys.argv[2])], int(sys.argv[1]), out)
print(out[0])
"""


@pytest.mark.parametrize(("index", "rows", "fine"), [(1, 3, True), (2, 2, False), (-1, 3, False)])
def test_an_index_outside_of_its_array_ends_the_process_where_that_is_asked_for(tmp_path, index, rows, fine):
    environment = os.environ | {BOUNDS: "1", CACHE_VARIABLE: str(tmp_path)}
    words = [sys.executable, "-c", OUTSIDE, str(index), str(rows)]
    done = subprocess.run(words, env=environment, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == (0 if fine else -signal.SIGABRT), done.stderr
    assert done.stdout == ("5.0\n" if fine else "")


def whole_numbers(x, out):
    """Whole numbers of a real one."""
    out[0], out[1] = int(x), round(x)


@pytest.mark.parametrize("x", [np.nan, np.inf, -np.inf, 1e300])
def test_what_is_too_large_or_no_number_is_a_whole_number_all_the_same(x):
    """On the processor it would be any: as an index, it would read memory anywhere."""
    out, most = np.zeros(2, dtype=np.int64), np.iinfo(np.int64)
    Entry(whole_numbers)(x, out)
    assert out.tolist() == [0 if np.isnan(x) else most.max if x > 0 else most.min] * 2


def test_a_python_that_keeps_arrays_in_another_way_is_refused(monkeypatch):
    monkeypatch.setattr(machine, "DATA", machine.DATA + 8)
    machine._require_layout.cache_clear()
    with pytest.raises(KernelError, match="use CPython"):
        Entry(whole_numbers)(1.5, np.zeros(2, dtype=np.int64))
    monkeypatch.undo()
    machine._require_layout()
