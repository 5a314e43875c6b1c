"""Compile the arithmetic of the tick, which lies in several files, with numba."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from hashlib import sha256
from importlib import import_module
from inspect import CO_NESTED
from pathlib import Path
from types import CellType, FunctionType, ModuleType

CORES = (
    "wholebody.gjk_core",
    "wholebody.qp.linear_core",
    "wholebody.qp.motion_core",
    "wholebody.qp.dynamics_core",
    "wholebody.qp.bounds_core",
    "wholebody.qp.cost_core",
    "wholebody.qp.rows_core",
    "wholebody.qp.active_core",
    "wholebody.qp.blocks_core",
    "wholebody.qp.assemble_core",
    "wholebody.qp.nearest_core",
    "wholebody.qp.solve_core",
    "wholebody.qp.judge_core",
    "wholebody.qp.command_core",
)
"""Modules whose functions compile as they stand."""


STAGES = (
    ("assemble_core", "move"),
    ("nearest_core", "nearest"),
    ("assemble_core", "assemble"),
    ("solve_core", "search"),
    ("judge_core", "conclude"),
    ("command_core", "command"),
)
"""What a tick calls one after the other. One function around them would be optimised once more as a whole: seconds of
compiling for a few microseconds of calling."""


@cache
def compiled_stages() -> tuple[Callable, ...]:
    """The stages of a tick, compiled, or loaded from numba's cache on disk; arguments are ``reals, ints``.

    They are called by their entry points: looking at the types of the arguments takes as long as a small stage. So the
    arguments have to be pairs of an array and its table, of floats and of integers.

    numba takes a second to import, so it is imported here. Its cache notices changes of the file of a function only;
    the digest of all files is therefore part of each stage, as a constant that it closes over. No fastmath: the result
    is that of the interpreted function up to rounding.
    """
    import numba
    from numba.extending import register_jitable

    modules = {name: import_module(name) for name in CORES}
    stages = [(modules[f"wholebody.qp.{name}"], function) for name, function in STAGES]
    _register_blocks()
    for module in modules.values():
        for function in _functions(module):
            if (module, function.__name__) not in stages:
                register_jitable(error_model="numpy")(function)
    digest = _digest(list(modules.values()))
    make = numba.njit(cache=True, error_model="numpy", nogil=True)
    return tuple(_entry(make(_closed(getattr(module, function), digest))) for module, function in stages)


def _entry(stage: Callable) -> Callable:
    """The native entry of a stage for the types of the two memories."""
    from numba import float64, int64, types

    reals, ints = (types.Tuple((kind[::1], int64[:, ::1])) for kind in (float64, int64))
    stage.compile((reals, ints))
    return stage.overloads[stage.signatures[0]].entry_point


def _closed(function: Callable, digest: int) -> Callable:
    """The same function, closing over the digest: numba's cache on disk looks at what a function closes over."""
    code = function.__code__.replace(co_freevars=("digest",), co_flags=function.__code__.co_flags | CO_NESTED)
    closed = FunctionType(code, function.__globals__, function.__name__, None, (CellType(digest),))
    closed.__module__, closed.__qualname__ = function.__module__, function.__qualname__
    return closed


def _digest(modules: list[ModuleType]) -> int:
    files = [Path(__file__), *(Path(module.__file__) for module in modules)]
    return int.from_bytes(sha256(b"".join(file.read_bytes() for file in files)).digest()[:7], "little")


def _functions(module: ModuleType) -> list[Callable]:
    found = [f for f in vars(module).values() if callable(f) and getattr(f, "__module__", None) == module.__name__]
    return [f for f in found if f.__name__ not in VIEWS]


VIEWS = ("matrix", "vector", "cube")
"""Functions of `blocks_core` that compiled code has by other means."""


def _register_blocks() -> None:
    """Blocks as bare pointers: numba's own slices count references, which takes longer than what is done with them."""
    from numba import carray, types
    from numba.extending import intrinsic, overload

    from wholebody.qp import blocks_core

    @intrinsic
    def entry(context, array, index):
        def codegen(context, builder, signature, arguments):
            data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
            return builder.gep(data, [arguments[1]])

        return types.CPointer(array.dtype)(array, types.intp), codegen

    @overload(blocks_core.matrix)
    def matrix(memory, k):
        return lambda memory, k: carray(entry(memory[0], memory[1][k, 0]), (memory[1][k, 1], memory[1][k, 2]))

    @overload(blocks_core.vector)
    def vector(memory, k):
        return lambda memory, k: carray(entry(memory[0], memory[1][k, 0]), (memory[1][k, 1] * memory[1][k, 2],))

    @overload(blocks_core.cube)
    def cube(memory, k):
        return lambda memory, k: carray(entry(memory[0], memory[1][k, 0]), (memory[1][k, 1], 3, 3))
