"""Everything that one entry needs, as one module of LLVM's language: the kernels below it, each once for its kinds."""

from __future__ import annotations

import ast
import sys
from functools import cache
from pathlib import Path
from types import FunctionType

import numpy as np

from wholebody.jit.compiler import arithmetic, border
from wholebody.jit.compiler.assembly import Value, real
from wholebody.jit.compiler.kinds import INT, REAL, Array, KernelError, Kind, Stored, entry_of
from wholebody.jit.compiler.translate import Translation

ATTRIBUTES = "attributes #0 = { nounwind }\nattributes #1 = { nounwind willreturn memory(none) }\n!0 = !{}"


class Program:
    """Kernels for the kinds of their arguments, as they are called for."""

    def __init__(self) -> None:
        self._made: dict[tuple, tuple[str, Kind] | None] = {}
        self._texts: list[str] = []

    def text(self, function: FunctionType, kinds: tuple[Kind, ...], symbol: str) -> str:
        """Module with a function ``symbol`` that Python calls.

        Raises:
            KernelError: If a kernel is outside the language.
        """
        kernel, answer = self.compiled(function, kinds)
        entry = border.Border(symbol, kernel, kinds, answer, function.__name__).text()
        return "\n\n".join([arithmetic.DECLARED, border.DECLARED, *self._texts, entry, ATTRIBUTES])

    def compiled(self, function: FunctionType, kinds: tuple[Kind, ...]) -> tuple[str, Kind]:
        """Name of a kernel for these kinds, and the kind of its answer."""
        key = (function, kinds)
        if key not in self._made:
            self._made[key] = None
            name = f"k{len(self._made)}.{function.__name__}"
            translation = Translation(function, definition(function), kinds, flags_of(function), self)
            text, answer = translation.run(name)
            self._texts.append(text)
            self._made[key] = name, answer
        found = self._made[key]
        if found is None:
            raise KernelError(f"{function.__name__} calls itself, which kernels cannot")
        return found

    def table(self, array: np.ndarray) -> Value:
        """Array from outside, as a constant.

        Raises:
            KernelError: If it holds anything but numbers.
        """
        kind, name = Array(entry_of(array.dtype), array.ndim), f"@table{len(self._texts)}"
        if not isinstance(kind.entry, Stored) or kind.entry.kind not in (INT, REAL):
            raise KernelError(f"kernels read no arrays of {array.dtype} from outside")
        llvm = kind.entry.llvm
        row = ", ".join(f"{llvm} {real(one) if kind.entry.kind == REAL else one}" for one in array.ravel().tolist())
        self._texts.append(f"{name} = private constant [{array.size} x {llvm}] [{row}], align 64")
        return Value(kind, (name, *map(str, array.shape)))


def flags_of(function: FunctionType) -> str:
    """What LLVM may do with arithmetic of reals in a kernel: what its module says in ``FASTMATH``."""
    return "".join(f"{flag} " for flag in sorted(getattr(sys.modules[function.__module__], "FASTMATH", ())))


def definition(function: FunctionType) -> ast.FunctionDef:
    """The source of a function, as a tree.

    Raises:
        KernelError: If there is none.
    """
    code = function.__code__
    found = _definitions(Path(code.co_filename)).get(code.co_firstlineno)
    if found is None:
        raise KernelError(f"there is no source of {function.__qualname__}")
    return found


@cache
def _definitions(file: Path) -> dict[int, ast.FunctionDef]:
    nodes = ast.walk(ast.parse(file.read_text(encoding="utf-8")))
    return {node.lineno: node for node in nodes if isinstance(node, ast.FunctionDef)}
