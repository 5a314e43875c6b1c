"""Compile the arithmetic of the tick, which lies in several files, with numba."""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import cache
from importlib import import_module
from types import ModuleType

from wholebody.jit.former import digest, native, register

CORES = (
    "wholebody.collision.gjk",
    "wholebody.qp.kernels.linear_algebra",
    "wholebody.robot.kernels.rotation",
    "wholebody.robot.kernels.spatial",
    "wholebody.robot.kernels.bodies",
    "wholebody.robot.kernels.pendulum",
    "wholebody.robot.kernels.frames",
    "wholebody.robot.kernels.rigid_body",
    "wholebody.qp.kernels.limits",
    "wholebody.qp.kernels.floor",
    "wholebody.qp.kernels.cost",
    "wholebody.qp.kernels.constraints",
    "wholebody.qp.kernels.active_set",
    "wholebody.qp.kernels.blocks",
    "wholebody.qp.kernels.assemble",
    "wholebody.qp.kernels.proximity",
    "wholebody.qp.kernels.solve",
    "wholebody.qp.kernels.residuals",
    "wholebody.qp.kernels.command",
    "wholebody.qp.kernels.entry_points",
)
"""Modules whose functions compile as they stand."""


STAGES = ("move", "nearest", "assemble", "search", "conclude", "command")
"""What a tick calls one after the other, of `entry_points`. One function around them would be optimised once more as a
whole: seconds of compiling for a few microseconds of calling."""

OPTIONS = {"_nrt": False, "no_cfunc_wrapper": True}
"""Nothing is allocated, so nobody has to count references."""


@cache
def compiled_stages() -> tuple[Callable, ...]:
    """The stages of a tick, compiled, or loaded from numba's cache on disk; arguments are ``reals, ints``.

    They are called by their entry points (see `wholebody.jit.entry`), so the arguments have to be pairs of an array and
    its table, of floats and of integers. numba takes a second to import, so it is imported here.
    """
    register_cores()
    stages = [getattr(import_module("wholebody.qp.kernels.entry_points"), name) for name in STAGES]
    version = digest([sys.modules[__name__], *(import_module(name) for name in CORES)])
    return tuple(native(stage, memories(), version, **OPTIONS) for stage in stages)


def register_cores(*others: ModuleType) -> None:
    """Let compiled code call the functions of `CORES`, and of other modules."""
    _register_blocks()
    for module in (*(import_module(name) for name in CORES), *others):
        register(module, VIEWS, **OPTIONS)


def memories() -> tuple:
    """Types of the two memories: pairs of an array and its table, of floats and of integers."""
    from numba import float64, int64, types

    return tuple(types.Tuple((kind[::1], int64[:, ::1])) for kind in (float64, int64))


VIEWS = ("matrix", "vector", "cube")
"""Functions of `blocks` that compiled code has by other means."""


@cache
def _register_blocks() -> None:
    """Blocks as views without an owner, made on the spot: there is nothing whose references could be counted."""
    from numba import types
    from numba.core import cgutils
    from numba.extending import lower_builtin, type_callable
    from numba.np.arrayobj import populate_array

    from wholebody.qp.kernels import blocks

    def shape_of(builder, kind, rows, columns):
        three = rows.type(3)
        return {1: (builder.mul(rows, columns),), 2: (rows, columns), 3: (rows, three, three)}[kind.ndim]

    def lower(context, builder, signature, arguments):
        memory, k = signature.args
        (values, table), index = cgutils.unpack_tuple(builder, arguments[0]), arguments[1]
        index = context.cast(builder, index, k, types.intp)
        parts = [
            context.make_array(kind)(context, builder, part) for kind, part in zip(memory, (values, table), strict=True)
        ]
        at = builder.mul(index, index.type(3))
        start, rows, columns = (
            builder.load(builder.gep(parts[1].data, [builder.add(at, at.type(i))])) for i in range(3)
        )
        kind, size = signature.return_type, context.get_abi_sizeof(context.get_data_type(memory[0].dtype))
        shape = shape_of(builder, kind, rows, columns)
        strides, stride = [], rows.type(size)
        for length in reversed(shape):
            strides.insert(0, stride)
            stride = builder.mul(stride, length)
        block = context.make_array(kind)(context, builder)
        populate_array(
            block,
            data=builder.gep(parts[0].data, [start]),
            shape=shape,
            strides=strides,
            itemsize=rows.type(size),
            meminfo=None,
        )
        return block._getvalue()

    for function, ndim in ((blocks.vector, 1), (blocks.matrix, 2), (blocks.cube, 3)):
        type_callable(function)(_view(ndim))
        lower_builtin(function, types.BaseTuple, types.Integer)(lower)


def _view(ndim: int) -> Callable:
    """How numba finds out what a view is."""
    from numba import types

    def typing(context):
        def typer(memory, k):
            return types.Array(memory[0].dtype, ndim, "C")

        return typer

    return typing
