"""Compile arithmetic that lies in several files with numba, to functions that are called by their native entry."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable
from hashlib import sha256
from inspect import CO_NESTED
from pathlib import Path
from types import CellType, FunctionType, ModuleType

_registered: set[Callable] = set()


def register(module: ModuleType, exclude: Collection[str] = (), **options: bool) -> None:
    """Let compiled code call the plain functions of a module.

    Args:
        module: Module whose functions compile as they stand.
        exclude: Names of functions that compiled code has by other means, or nobody calls.
        options: Of numba's.
    """
    from numba.extending import register_jitable

    from wholebody.jit.compiler import InnerCompiler

    for name, member in vars(module).items():
        own = isinstance(member, FunctionType) and member.__module__ == module.__name__
        if own and name not in exclude and member not in _registered:
            _registered.add(member)
            register_jitable(error_model="numpy", pipeline_class=InnerCompiler, **options)(member)


def digest(modules: Iterable[ModuleType]) -> int:
    """A number that changes with the source of any of the modules, and with how they are compiled."""
    files = [Path(__file__), Path(__file__).with_name("compiler.py"), *(Path(module.__file__) for module in modules)]
    return int.from_bytes(sha256(b"".join(file.read_bytes() for file in files)).digest()[:7], "little")


def native(function: Callable, arguments: tuple, version: int, **options: bool) -> Callable:
    """The native entry of a function for one kind of arguments, compiled or loaded from numba's cache on disk.

    Calling the entry leaves out numba's look at the types of the arguments, which takes as long as a small function.
    So nobody checks them: arrays of another type or layout are read as if they were right.

    numba's cache notices changes of the file of a function only; the number of all files is therefore part of it, as a
    constant that it closes over. No fastmath: the result is that of the interpreted function up to rounding.

    Args:
        function: What to compile.
        arguments: numba types.
        version: Of all files that it is made of, by `digest`.
        options: Of numba's.
    """
    import numba

    from wholebody.jit.compiler import EntryCompiler

    compiler = numba.njit(cache=True, error_model="numpy", nogil=True, pipeline_class=EntryCompiler, **options)
    stage = compiler(_closed(function, version))
    stage.compile(arguments)
    return stage.overloads[stage.signatures[0]].entry_point


def _closed(function: Callable, version: int) -> Callable:
    """The same function, closing over a number: numba's cache on disk looks at what a function closes over."""
    code = function.__code__.replace(co_freevars=("version",), co_flags=function.__code__.co_flags | CO_NESTED)
    closed = FunctionType(code, function.__globals__, function.__name__, None, (CellType(version),))
    closed.__module__, closed.__qualname__ = function.__module__, function.__qualname__
    return closed
