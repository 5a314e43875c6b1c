"""Compile the arithmetic of the tick, which lies in several files, with numba."""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import cache
from importlib import import_module
from types import ModuleType

from wholebody.native import digest, native, register

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

    They are called by their entry points (see `wholebody.native`), so the arguments have to be pairs of an array and
    its table, of floats and of integers. numba takes a second to import, so it is imported here.
    """
    register_cores()
    stages = [getattr(import_module(f"wholebody.qp.{module}"), function) for module, function in STAGES]
    version = digest([sys.modules[__name__], *(import_module(name) for name in CORES)])
    return tuple(native(stage, memories(), version) for stage in stages)


def register_cores(*others: ModuleType) -> None:
    """Let compiled code call the functions of `CORES`, and of other modules."""
    _register_blocks()
    for module in (*(import_module(name) for name in CORES), *others):
        register(module, VIEWS)


def memories() -> tuple:
    """Types of the two memories: pairs of an array and its table, of floats and of integers."""
    from numba import float64, int64, types

    return tuple(types.Tuple((kind[::1], int64[:, ::1])) for kind in (float64, int64))


VIEWS = ("matrix", "vector", "cube")
"""Functions of `blocks_core` that compiled code has by other means."""


@cache
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
