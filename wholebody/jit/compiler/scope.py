"""Names of a kernel: its variables, what stands outside of it, and what it needs of the module that it is put into."""

from __future__ import annotations

import ast
import builtins
from types import FunctionType
from typing import Protocol

import numpy as np

from wholebody.jit.compiler.assembly import Assembly, Value, number, tuple_of
from wholebody.jit.compiler.kinds import Fixed, KernelError, Kind, wider


class Kernels(Protocol):
    """What a kernel needs of the module that it is put into."""

    def compiled(self, function: FunctionType, kinds: tuple[Kind, ...]) -> tuple[str, Kind]:
        """Name of a kernel for these kinds, and the kind of its answer."""

    def table(self, array: np.ndarray) -> Value:
        """Array from outside, as a constant."""


class Scope:
    """What the names of one kernel stand for.

    Args:
        function: The kernel.
        flags: What LLVM may do with arithmetic of reals.
        program: Has the kernels that are called.

    Attributes:
        out: What is written.
        kinds: Kind of each variable, as wide as it was found to be.
        slots: Where variables lie on the stack.
        fixed: Names that are values, since nothing sets them twice.
        widened: Whether a kind became wider than what was written for it.
    """

    def __init__(self, function: FunctionType, flags: str, program: Kernels) -> None:
        self.function, self.program = function, program
        self.out = Assembly(flags)
        self.kinds: dict[object, Kind] = {}
        self.slots: dict[object, list[str]] = {}
        self.fixed: dict[str, Value] = {}
        self.widened = False
        free = zip(function.__code__.co_freevars, function.__closure__ or (), strict=True)
        self._around = {name: cell.cell_contents for name, cell in free}

    def error(self, node: ast.AST, text: str) -> KernelError:
        """What is wrong, with the kernel and the line; as it is where that is said already."""
        if text.startswith("kernel "):
            return KernelError(text)
        line, name = getattr(node, "lineno", self.function.__code__.co_firstlineno), self.function.__qualname__
        return KernelError(f"kernel {self.function.__module__}.{name}, line {line}: {text}")

    def assign(self, name: object, value: Value) -> None:
        """Set a variable; its kind becomes wide enough."""
        kind = self.kinds.get(name)
        wide = value.kind if kind is None else wider(kind, value.kind)
        if wide != kind:
            self.widened |= kind is not None
            self.kinds[name] = wide
            self.slots.pop(name, None)
        if name not in self.slots:
            self.slots[name] = self.out.slot(wide)
        self.out.put(self.out.convert(value, wide), self.slots[name])

    def read(self, name: object) -> Value:
        """Value of a variable."""
        return self.out.get(self.kinds[name], self.slots[name])

    def named(self, name: str) -> Value:
        """What a name stands for.

        Raises:
            KernelError: If it is not known.
        """
        if name in self.fixed:
            return self.fixed[name]
        if name in self.slots:
            return self.read(name)
        for scope in (self._around, self.function.__globals__, vars(builtins)):
            if name in scope:
                thing = scope[name]
                return self.program.table(thing) if isinstance(thing, np.ndarray) else outside(thing)
        raise KernelError(f"'{name}' is not known here")


def outside(thing: object) -> Value:
    """What a name outside of kernels stands for, as a constant.

    Raises:
        KernelError: If kernels cannot read it.
    """
    if isinstance(thing, np.bool_ | np.integer | np.floating):
        thing = thing.item()
    if isinstance(thing, bool | int | float):
        return number(thing if isinstance(thing, bool | float) else int(thing))
    if isinstance(thing, tuple):
        return tuple_of((outside(one) for one in thing), getattr(thing, "_fields", ()))
    if isinstance(thing, np.ndarray | list | dict | set | str):
        raise KernelError(f"kernels read no {type(thing).__name__} from outside")
    return Value(Fixed(thing))
