"""Compile plain functions for the processor at hand, on first use: one way for every kernel of the project.

A kernel is a plain function of numbers, arrays, tuples of them and packed memory (`wholebody.jit.packed`). It calls
other kernels as Python does, so editors and tests follow the calls, and it runs interpreted as it stands. What Python
calls is an `Entry` of it::

    _cost = Entry(cost)          # nothing is compiled, LLVM is not imported
    total = _cost(motion, scales)  # compiled for these kinds of arguments, or loaded from the cache on disk

The language of kernels is what `wholebody.jit.compiler` knows of Python: assignments, ``if``, ``while``, ``for`` over
ranges, tuples and arrays, arithmetic and comparisons of numbers, views of arrays, the functions of
`wholebody.jit.compiler.arithmetic.FUNCTIONS`, and calls of other kernels. Kernels allocate nothing: whole arrays are
only set, other arithmetic of arrays is written as loops. What is outside of the language is refused with its line. An
index that is written as negative counts from the end; no index is looked at otherwise, unless the environment variable
``WHOLEBODY_CHECK_BOUNDS`` is set: then one outside of its array aborts the process.

No fastmath but what a module asks for by ``FASTMATH`` (flags of LLVM), and that is no more than other roundings: the
result is that of the interpreted function up to rounding.
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

from wholebody.jit import objects
from wholebody.jit.checked import BOUNDS, checked, is_asked_for

PACKAGES = ("wholebody",)
"""Packages that kernels may be in."""

_IMPORT = re.compile(r"^(?:from|import) ([\w.]+)", re.MULTILINE)
_COMPILING = RLock()
"""Held while anything is compiled or loaded: LLVM does one thing at a time."""


class Entry:
    """A function that Python calls in its compiled form.

    It is compiled for the kinds of arguments of the first call. A later call with arrays of another type, another
    number of dimensions or another order in memory is refused (`wholebody.jit.compiler.border`); all else is compared
    where the environment asks for it (`wholebody.jit.checked`).

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
        """The native entry for arguments of these kinds, which are looked at only: their values do not matter.

        Raises:
            KernelError: If a kernel or an argument is outside the language of kernels.
        """
        from wholebody.jit.compiler import machine
        from wholebody.jit.compiler.kinds import kind_of
        from wholebody.jit.compiler.program import Program

        kinds = tuple(map(kind_of, arguments))
        name = f"{self.function.__module__}.{self.function.__name__}"
        made_by = f"{name} {kinds} {machine.host()} {sys.version} {is_asked_for(BOUNDS)}"
        key = sha256(made_by.encode() + _sources(self.function)).hexdigest()
        symbol = f"entry_{key[:32]}"
        code = objects.find(name, key)
        if code is None:
            code = machine.object_of(Program().text(self.function, kinds, symbol))
            objects.keep(name, key, code)
        return machine.function_of(code, symbol, self.function.__name__)


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


def _sources(function: Callable) -> bytes:
    """What changes with the source of any kernel below a function, of what its module imports, and of this package."""
    sources = dict(_own_sources())
    waiting = [kernel.__module__ for kernel in kernels_of(function)]
    while waiting:
        name = waiting.pop()
        file = getattr(sys.modules.get(name), "__file__", None)
        if name not in sources and file is not None:
            sources[name], imported = _source(Path(file))
            waiting += imported
    return sha256(b"".join(name.encode() + sources[name] for name in sorted(sources))).digest()


@cache
def _own_sources() -> dict[str, bytes]:
    """What is in the files of this package, by where they are in it; read once."""
    here = Path(__file__).parent
    return {str(path.relative_to(here)): _source(path)[0] for path in here.rglob("*.py")}


@cache
def _source(file: Path) -> tuple[bytes, tuple[str, ...]]:
    """What is in a file, and the modules of this package that it imports; read once."""
    text = file.read_bytes()
    return text, tuple(filter(_is_ours, _IMPORT.findall(text.decode())))
