"""Strategy: a small chain of functions in a module of its own, compiled as the tick is, against the interpreted one: in
this process, from the cache in another one, and called by a function that numba compiles in its usual way.
"""

import importlib.util
import subprocess
import sys

import numpy as np
import pytest

from wholebody.jit.former import digest, native, register

SOURCE = '''
def total(values):
    """Sum."""
    out = 0.0
    for i in range(values.shape[0]):
        out += values[i]
    return out


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
    return best
'''

AGAIN = """
import sys
import numpy as np
sys.path.insert(0, sys.argv[1])
import {name} as module
from wholebody.jit.former import digest, native, register
from numba import float64
register(module, _nrt=False, no_cfunc_wrapper=True)
entry = native(module.widest, (float64[::1], float64[::1]), digest([module]), _nrt=False, no_cfunc_wrapper=True)
print(entry(np.array([1.0, 2.0, 6.0]), np.zeros(3)))
"""

OPTIONS = {"_nrt": False, "no_cfunc_wrapper": True}


@pytest.fixture
def module(tmp_path, monkeypatch):
    """The chain, whose compiled form is kept beside it."""
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    path = tmp_path / "chain_of_functions.py"
    path.write_text(SOURCE)
    spec = importlib.util.spec_from_file_location(path.stem, path)
    loaded = sys.modules[path.stem] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(loaded)
    register(loaded, **OPTIONS)
    yield loaded
    del sys.modules[path.stem]


def compiled(module):
    from numba import float64

    return native(module.widest, (float64[::1], float64[::1]), digest([module]), **OPTIONS)


def test_a_compiled_chain_gives_what_the_interpreted_one_gives(module):
    values = np.random.default_rng(0).normal(size=20)
    one, other = np.zeros(20), np.zeros(20)
    assert compiled(module)(values, one) == module.widest(values, other)
    assert np.array_equal(one, other)


def test_another_process_loads_it_from_the_cache(module, tmp_path):
    compiled(module)
    made = sorted(tmp_path.rglob("*.nbc"))
    assert len(made) == 1
    code = AGAIN.format(name=module.__name__)
    answer = subprocess.run([sys.executable, "-c", code, str(tmp_path)], capture_output=True, text=True, check=True)
    assert float(answer.stdout) == 3.0
    assert sorted(tmp_path.rglob("*.nbc")) == made


def test_code_that_numba_compiles_in_its_usual_way_may_call_the_same_functions(module):
    import numba

    widest = module.widest

    @numba.njit
    def twice(values, scratch):
        return 2.0 * widest(values, scratch)

    assert twice(np.array([1.0, 2.0, 6.0]), np.zeros(3)) == 6.0


def test_what_is_kept_on_disk_is_machine_code_and_names_only(module, monkeypatch):
    """numba would keep LLVM's code as well, for functions that take this one in, and parse it at every start."""
    from llvmlite.binding import parse_bitcode
    from numba.core.codegen import JITCodeLibrary

    kept, load = [], JITCodeLibrary._unserialize.__func__
    compiled(module)

    def noticed(cls, codegen, state):
        kept.append(state)
        return load(cls, codegen, state)

    monkeypatch.setattr(JITCodeLibrary, "_unserialize", classmethod(noticed))
    assert compiled(module)(np.array([1.0, 2.0, 6.0]), np.zeros(3)) == 3.0
    ((_, kind, (_, bitcode)),) = kept
    assert kind == "object"
    defined = [one for one in parse_bitcode(bitcode).functions if not one.is_declaration]
    assert defined
    assert all(sum(len(list(block.instructions)) for block in one.blocks) == 1 for one in defined)
