"""Kinds of the values of a kernel: what they are made of in LLVM's language, and which kind an argument has.

A value is a row of registers, its *parts*: a number is one, an array of C order its address and its lengths, a tuple
the parts of its items. Nothing that has a kind is ever in memory as a whole, so nothing is built up or taken apart at
run time.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import FunctionType

import numpy as np

from wholebody.jit.packed import Packed


class KernelError(TypeError):
    """A kernel, or an argument of one, that is outside the language of `wholebody.jit`."""


@dataclass(frozen=True)
class Kind:
    """Base of all kinds."""

    @property
    def parts(self) -> tuple[str, ...]:
        """LLVM's types of the registers that a value of this kind is."""
        return self._parts()

    def _parts(self) -> tuple[str, ...]:
        return ()


@dataclass(frozen=True)
class Scalar(Kind):
    """A number or truth value: ``i1``, ``i64``, ``float`` or ``double``, in order of what can hold what."""

    llvm: str

    def _parts(self) -> tuple[str, ...]:
        return (self.llvm,)

    @property
    def is_real(self) -> bool:
        """Whether it is a number of floating point."""
        return self.llvm in ("float", "double")


BOOL, INT, SINGLE, REAL = Scalar("i1"), Scalar("i64"), Scalar("float"), Scalar("double")
WIDER = (BOOL, INT, SINGLE, REAL)


@dataclass(frozen=True)
class Stored:
    """A number as it lies in memory.

    Attributes:
        llvm: Its type there.
        size: Bytes.
        kind: What it is once it is loaded.
        signed: Whether an integer has a sign.
    """

    llvm: str
    size: int
    kind: Scalar
    signed: bool = True


STORED = {
    "f8": Stored("double", 8, REAL),
    "f4": Stored("float", 4, SINGLE),
    "b1": Stored("i8", 1, BOOL, signed=False),
    **{f"i{n}": Stored(f"i{8 * n}", n, INT) for n in (1, 2, 4, 8)},
    **{f"u{n}": Stored(f"i{8 * n}", n, INT, signed=False) for n in (1, 2, 4)},
}
"""Numbers in memory by numpy's letter and size."""


@dataclass(frozen=True)
class Element(Kind):
    """An entry of an array of records, by its address.

    Attributes:
        size: Bytes from one record to the next.
        fields: Name, byte at which it begins, what it is made of, and its shape, of each field.
    """

    size: int
    fields: tuple[tuple[str, int, Stored, tuple[int, ...]], ...]

    def _parts(self) -> tuple[str, ...]:
        return ("ptr",)

    @property
    def kind(self) -> Element:
        """Kind of an entry that is loaded: its own."""
        return self


@dataclass(frozen=True)
class Array(Kind):
    """An array: its address, its lengths, and where it is not in C order the bytes between entries.

    Attributes:
        entry: What it holds.
        ndim: Number of dimensions.
        ordered: Whether entries follow each other in C order.
    """

    entry: Stored | Element
    ndim: int
    ordered: bool = True

    def _parts(self) -> tuple[str, ...]:
        return ("ptr", *["i64"] * (self.ndim if self.ordered else 2 * self.ndim))


@dataclass(frozen=True)
class Tuple(Kind):
    """A tuple.

    Attributes:
        items: Kinds of its items.
        names: Their names, where it is a named tuple.
    """

    items: tuple[Kind, ...]
    names: tuple[str, ...] = ()

    def _parts(self) -> tuple[str, ...]:
        return tuple(part for item in self.items for part in item.parts)


@dataclass(frozen=True)
class Memory(Kind):
    """A `Packed`: the address of its memory.

    Attributes:
        fields: Name, kind of number (``f`` or ``i``) and number of dimensions of each field.
    """

    fields: tuple[tuple[str, str, int], ...]

    def _parts(self) -> tuple[str, ...]:
        return ("ptr",)


@dataclass(frozen=True)
class Fixed(Kind):
    """A value known when a kernel is compiled that is not a number: a function, a module, None."""

    value: object


NONE = Fixed(None)


def kind_of(argument: object) -> Kind:
    """Kind of an argument that Python passes.

    Raises:
        KernelError: If kernels take no such argument.
    """
    for types, kind in ((bool | np.bool_, BOOL), (int | np.integer, INT), (float | np.floating, REAL)):
        if isinstance(argument, types):
            return kind
    if isinstance(argument, np.ndarray):
        return Array(entry_of(argument.dtype), argument.ndim, argument.flags.c_contiguous)
    if isinstance(argument, tuple):
        return Tuple(tuple(map(kind_of, argument)), getattr(argument, "_fields", ()))
    if isinstance(argument, Packed):
        return Memory(argument.fields)
    if isinstance(argument, FunctionType):
        return Fixed(argument)
    raise KernelError(f"kernels take numbers, arrays, tuples of them and packed memory, not {type(argument).__name__}")


def entry_of(dtype: np.dtype) -> Stored | Element:
    """Kind of the entries of an array of this dtype.

    Raises:
        KernelError: If kernels read no such entries.
    """
    if dtype.names is not None:
        fields = ((name, *dtype.fields[name][::-1]) for name in dtype.names)
        return Element(dtype.itemsize, tuple((name, at, entry_of(of.base), of.shape) for name, at, of in fields))
    entry = STORED.get(f"{dtype.kind}{dtype.itemsize}") if dtype.isnative else None
    if entry is None:
        raise KernelError(f"kernels read no arrays of {dtype}")
    return entry


def wider(one: Kind, other: Kind) -> Kind:
    """The kind that holds values of both.

    Raises:
        KernelError: If there is none.
    """
    if one == other:
        return one
    if isinstance(one, Scalar) and isinstance(other, Scalar):
        return REAL if {one, other} == {INT, SINGLE} else max(one, other, key=WIDER.index)
    if isinstance(one, Array) and isinstance(other, Array) and (one.entry, one.ndim) == (other.entry, other.ndim):
        return Array(one.entry, one.ndim, ordered=False)
    if isinstance(one, Tuple) and isinstance(other, Tuple) and len(one.items) == len(other.items):
        return Tuple(tuple(map(wider, one.items, other.items)), one.names if one.names == other.names else ())
    raise KernelError(f"one name cannot stand for {one} and for {other}")
