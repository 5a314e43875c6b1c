"""Strategy: a small chain of kernels in two modules of their own, compiled as the tick is, against the interpreted one:
in this process, from the cache in another one, and after a change of the module that only a callee lies in.
"""

import importlib
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from models.cache import CACHE_VARIABLE
from wholebody.jit.entry import Entry, kernels_of

SUMS = '''
def total(values):
    """Sum."""
    out = 0.0
    for i in range(values.shape[0]):
        out += values[i]
    return out
'''

CHAIN = '''
import wholebody_sums as sums
from wholebody_sums import total


def spread(values, out):
    """Distance of each value from the mean."""
    mean = total(values) / values.shape[0]
    for i in range(values.shape[0]):
        out[i] = abs(values[i] - mean)


def widest(values, scratch):
    """Largest of them."""
    spread(values, scratch)
    best = 0.0
    for i in range(scratch.shape[0]):
        best = max(best, scratch[i])
    return best + 0.0 * sums.total(values)
'''

AGAIN = """
import sys
import numpy as np
sys.path.insert(0, sys.argv[1])
from wholebody.jit import entry
entry.PACKAGES = ("wholebody_sums", "wholebody_chain")
import wholebody_chain as module
print(entry.Entry(module.widest)(np.array([1.0, 2.0, 6.0]), np.zeros(3)))
"""


@pytest.fixture
def chain(tmp_path, monkeypatch):
    """The chain, whose compiled form is kept beside it."""
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path))
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr("wholebody.jit.entry.PACKAGES", ("wholebody_sums", "wholebody_chain"))
    (tmp_path / "wholebody_sums.py").write_text(SUMS)
    (tmp_path / "wholebody_chain.py").write_text(CHAIN)
    yield importlib.import_module("wholebody_chain")
    for name in ("wholebody_chain", "wholebody_sums"):
        sys.modules.pop(name, None)


def compiled_in_another_process(folder):
    done = subprocess.run([sys.executable, "-c", AGAIN, str(folder)], capture_output=True, text=True, check=True)
    return float(done.stdout)


def test_the_kernels_below_a_function_are_found_in_its_code(chain):
    assert {kernel.__name__ for kernel in kernels_of(chain.widest)} == {"widest", "spread", "total"}


def test_a_compiled_chain_gives_what_the_interpreted_one_gives(chain):
    values = np.random.default_rng(0).normal(size=20)
    one, other = np.zeros(20), np.zeros(20)
    assert Entry(chain.widest)(values, one) == chain.widest(values, other)
    assert np.array_equal(one, other)


def test_another_process_loads_it_from_the_cache(chain, tmp_path):
    Entry(chain.widest)(np.zeros(3), np.zeros(3))
    made = sorted(tmp_path.rglob("*.o"))
    assert made
    assert compiled_in_another_process(tmp_path) == 3.0
    assert sorted(tmp_path.rglob("*.o")) == made


def test_damaged_machine_code_is_made_again_and_never_loaded(chain, tmp_path):
    Entry(chain.widest)(np.zeros(3), np.zeros(3))
    (made,) = tmp_path.rglob("*.o")
    good = made.read_bytes()
    made.write_bytes(good[:-9] + bytes(9))
    assert compiled_in_another_process(tmp_path) == 3.0
    assert made.read_bytes() == good


def test_a_change_of_a_callee_in_another_file_is_noticed(chain, tmp_path):
    Entry(chain.widest)(np.zeros(3), np.zeros(3))
    (tmp_path / "wholebody_sums.py").write_text(SUMS.replace("out = 0.0", "out = 2.0 * 3.0"))
    assert compiled_in_another_process(tmp_path) == 4.0


MOVED = """
import sys
sys.path.insert(0, sys.argv[1])
from wholebody.jit import entry
entry.PACKAGES = ("wholebody_pairs", "wholebody_other", "wholebody_chain")
import wholebody_chain as module
from {where} import Pair
print(entry.Entry(module.both)(Pair(1.0, 2.0)))
"""


def test_a_cache_from_before_the_class_of_an_argument_moved_is_not_read(chain, tmp_path):
    """A cache of pickles would be read before it is seen to be out of date; the class named there is gone."""
    source = "from typing import NamedTuple\n\n\nclass Pair(NamedTuple):\n    a: float\n    b: float\n"
    (tmp_path / "wholebody_chain.py").write_text("def both(pair):\n    return pair.a + pair.b\n")
    for name, other in (("wholebody_pairs", "wholebody_other"), ("wholebody_other", "wholebody_pairs")):
        (tmp_path / f"{name}.py").write_text(source)
        (tmp_path / f"{other}.py").write_text("")
        command = [sys.executable, "-c", MOVED.format(where=name), str(tmp_path)]
        assert float(subprocess.run(command, capture_output=True, text=True, check=True).stdout) == 3.0


def test_threads_that_meet_cold_compile_one_after_another_and_each_entry_once():
    """LLVM does one thing at a time: two threads that meet cold must not be in it at once."""
    guard, inside, made = threading.Lock(), [0], []

    class Slow(Entry):
        def compile(self, *arguments):
            with guard:
                inside[0] += 1
                made.append((self, inside[0]))
            threading.Event().wait(0.02)
            with guard:
                inside[0] -= 1
            return self.function

    entries, begin = [Slow(lambda: 1), Slow(lambda: 2)], threading.Barrier(8)

    def call(k):
        begin.wait()
        return entries[k % 2]()

    with ThreadPoolExecutor(8) as pool:
        assert list(pool.map(call, range(8))) == [1, 2] * 4
    assert sorted(entries.index(one) for one, _ in made) == [0, 1]
    assert all(together == 1 for _, together in made)


def test_an_entry_compiled_while_another_is_compiled_waits_for_nobody(chain):
    class Outer(Entry):
        def compile(self, *arguments):
            assert Entry(chain.total)(np.ones(3)) == 3.0
            return super().compile(*arguments)

    def call():
        return Outer(chain.widest)(np.array([1.0, 2.0, 6.0]), np.zeros(3))

    with ThreadPoolExecutor(1) as pool:
        assert pool.submit(call).result(timeout=300) == 3.0
