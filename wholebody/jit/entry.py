"""Compile plain functions with numba, on first use: one way for every kernel of the project.

A kernel is a plain function of scalars, arrays, named tuples of arrays and packed memory (`wholebody.jit.packed`). It
calls other kernels as Python does, so editors and tests follow the calls, and it runs interpreted as it stands. What
Python calls is an `Entry` of it::

    _cost = Entry(cost)          # nothing is compiled, numba is not imported
    total = _cost(motion, scales)  # compiled for these kinds of arguments, or loaded from numba's cache on disk

No fastmath but what a module asks for by ``FASTMATH``, and that is no more than other roundings: the result is that of
the interpreted function up to rounding.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterator
from functools import cache
from hashlib import sha256
from pathlib import Path
from threading import RLock
from types import FunctionType, ModuleType
from typing import Any

from wholebody.jit.checked import checked, is_asked_for

OPTIONS = {"error_model": "numpy", "_nrt": False, "no_cfunc_wrapper": True, "forceinline": True}
"""Kernels allocate nothing, so nothing has to be reference counted. A module that calls BLAS says ``ALLOCATES = True``:
numba counts what it hands over. Called kernels are put into their callers: an array that is passed on is six numbers or
more on the stack, which cost a small kernel more than its arithmetic."""

PACKAGES = ("wholebody",)
"""Where kernels may lie."""

_IMPORT = re.compile(r"^(?:from|import) ([\w.]+)", re.MULTILINE)
_registered: set[Callable] = set()
_COMPILING = RLock()
"""Held while anything is compiled: kernels are registered for all entries alike."""


class Entry:
    """A function that Python calls in its compiled form.

    It is compiled for the kinds of arguments of the first call and called by its native entry afterwards, which leaves
    out numba's look at the types: that would take as long as a small kernel. So every later call must have arguments of
    the same types and memory layouts; `wholebody.jit.checked` compares them where the environment asks for it.

    Args:
        function: A kernel; the kernels that it calls are found in its code.
    """

    def __init__(self, function: Callable) -> None:
        self.function = function
        self._native: Callable | None = None

    def __call__(self, *arguments: object) -> object:
        """Call the compiled function."""
        return self.native(*arguments)(*arguments)

    def native(self, *arguments: object) -> Callable:
        """The native entry, made for arguments of these kinds on first use: for who calls it too often for a detour."""
        if self._native is None:
            with _COMPILING:
                if self._native is None:
                    native = self.compile(*arguments)
                    self._native = checked(self.function, native, arguments) if is_asked_for() else native
        return self._native

    @property
    def is_compiled(self) -> bool:
        """Whether there is a native entry already."""
        return self._native is not None

    def compile(self, *arguments: object) -> Callable:
        """The native entry for arguments of these kinds, which are looked at only: their values do not matter."""
        import numba

        from wholebody.jit.packed_type import typeof

        types = tuple(typeof(argument) for argument in arguments)
        modules = _register(self.function)
        modules |= {
            sys.modules[type(argument).__module__] for argument in arguments if _is_ours(type(argument).__module__)
        }
        compiler = numba.njit(cache=True, nogil=True, **_options(sys.modules[self.function.__module__]))
        dispatcher = compiler(_named(self.function, _digest(modules)))
        dispatcher.compile(types)
        return dispatcher.overloads[dispatcher.signatures[0]].entry_point


def kernels_of(function: Callable) -> Iterator[Callable]:
    """The function and all plain functions of this package that it calls, directly or not, each once."""
    found, waiting = {function: None}, [function]
    while waiting:
        one = waiting.pop()
        yield one
        for callee in _called(one):
            if callee not in found:
                found[callee] = None
                waiting.append(callee)


def _called(function: Callable) -> Iterator[Callable]:
    names, scope = function.__code__.co_names, function.__globals__
    values = [scope[name] for name in names if name in scope]
    for module in [value for value in values if isinstance(value, ModuleType)]:
        values += [vars(module)[name] for name in names if name in vars(module)]
    for value in values:
        if isinstance(value, FunctionType) and _is_ours(value.__module__):
            yield value


def _is_ours(module: str) -> bool:
    return module.split(".", maxsplit=1)[0] in PACKAGES


def _register(function: Callable) -> set[ModuleType]:
    """Let compiled code call the kernels below a function; the modules in which all of them lie."""
    from numba.extending import register_jitable

    modules = set()
    for kernel in kernels_of(function):
        module = sys.modules[kernel.__module__]
        modules.add(module)
        if kernel is not function and kernel not in _registered:
            _registered.add(kernel)
            register_jitable(**_options(module))(kernel)
    return modules


def _options(module: ModuleType) -> dict[str, Any]:
    return {
        **OPTIONS,
        "_nrt": getattr(module, "ALLOCATES", False),
        "fastmath": getattr(module, "FASTMATH", False),
    }


def _digest(modules: set[ModuleType]) -> int:
    """A number that changes with the source of any of the modules, of what they import, and of this one.

    numba's cache notices changes of the file of a function only.
    """
    here = Path(__file__)
    sources = {name: _source(here.with_name(f"{name}.py"))[0] for name in ("entry", "packed", "packed_type")}
    waiting = [module.__name__ for module in modules]
    while waiting:
        name = waiting.pop()
        file = getattr(sys.modules.get(name), "__file__", None)
        if name not in sources and file is not None:
            sources[name], imported = _source(Path(file))
            waiting += imported
    return int.from_bytes(
        sha256(b"".join(name.encode() + sources[name] for name in sorted(sources))).digest()[:7], "little"
    )


@cache
def _source(file: Path) -> tuple[bytes, tuple[str, ...]]:
    """What is in a file, and the modules of this package that it imports; read once."""
    text = file.read_bytes()
    return text, tuple(filter(_is_ours, _IMPORT.findall(text.decode())))


def _named(function: Callable, version: int) -> Callable:
    """Function under a name with a number, for which numba's cache on disk has files of its own.

    It would read the files of another version before it sees that they are out of date, and fails where the class of an
    argument has moved since.
    """
    named = FunctionType(function.__code__, function.__globals__, function.__name__)
    named.__module__, named.__qualname__ = function.__module__, f"{function.__qualname__}_{version:x}"
    return named
