"""Text of one function in LLVM's language: registers, blocks, and the values that they make up."""

from __future__ import annotations

import struct
from collections.abc import Iterable
from dataclasses import dataclass

from wholebody.jit.checked import BOUNDS, is_asked_for
from wholebody.jit.compiler.kinds import BOOL, INT, REAL, SINGLE, Array, Fixed, KernelError, Kind, Scalar, Tuple


@dataclass(frozen=True)
class Value:
    """A value of a kernel: its kind, and a register or a constant for each part of it."""

    kind: Kind
    parts: tuple[str, ...] = ()

    @property
    def text(self) -> str:
        """The one part of a number, or the first one: the address of an array."""
        return self.parts[0]

    @property
    def constant(self) -> int | float | None:
        """The number that it is, if that is known when it is compiled."""
        if not isinstance(self.kind, Scalar) or self.text.startswith("%"):
            return None
        if self.kind.is_real:
            return struct.unpack(">d", bytes.fromhex(self.text[2:]))[0]
        return int(self.text)

    @property
    def items(self) -> list[Value]:
        """Items of a tuple."""
        out, at = [], 0
        for kind in self.kind.items:
            count = len(kind.parts)
            out.append(Value(kind, self.parts[at : at + count]))
            at += count
        return out


def tuple_of(items: Iterable[Value], names: tuple[str, ...] = ()) -> Value:
    """Tuple of values."""
    items = list(items)
    return Value(Tuple(tuple(item.kind for item in items), names), tuple(p for item in items for p in item.parts))


def number(value: complex) -> Value:
    """Constant of Python as a value: bool, int or float."""
    if isinstance(value, bool):
        return Value(BOOL, (str(int(value)),))
    if isinstance(value, int):
        return Value(INT, (str(value),))
    return Value(REAL, (real(float(value)),))


def real(value: float) -> str:
    """Text of a number of floating point, to the last bit."""
    return "0x" + struct.pack(">d", value).hex().upper()


class Assembly:
    """Lines of one function as they are made.

    Attributes:
        lines: What was written.
        slots: Memory on the stack that variables have, written before all lines.
        targets: Blocks that are gone to.
        block: The block that is being written.
        dead: Whether nothing reaches what would be written now.
        flags: What LLVM may do with arithmetic of reals, as in `wholebody.jit.entry`.
        guarded: Whether indices are compared with the lengths of their arrays (`wholebody.jit.checked.BOUNDS`).
    """

    def __init__(self, flags: str = "") -> None:
        self.lines: list[str] = []
        self.slots: list[str] = []
        self.targets: set[str] = set()
        self.block, self.dead, self.flags, self._count = "begin", False, flags, 0
        self.guarded = is_asked_for(BOUNDS)

    def name(self, stem: str = "v") -> str:
        """Name that no other register or block has."""
        self._count += 1
        return f"{stem}{self._count}"

    def op(self, text: str) -> str:
        """Write an instruction; the register with its result."""
        self._count += 1
        register = f"%v{self._count}"
        self.lines.append(f"  {register} = {text}")
        return register

    def do(self, text: str) -> None:
        """Write an instruction without a result."""
        self.lines.append(f"  {text}")

    def end(self, text: str) -> None:
        """Write the last instruction of a block."""
        if not self.dead:
            self.do(text)
        self.dead = True

    def jump(self, block: str) -> None:
        """Go on in another block."""
        if not self.dead:
            self.targets.add(block)
        self.end(f"br label %{block}")

    def branch(self, condition: str, then: str, otherwise: str) -> None:
        """Go on in one of two blocks."""
        self.targets |= {then, otherwise}
        self.end(f"br i1 {condition}, label %{then}, label %{otherwise}")

    def require(self, condition: str) -> None:
        """Abort the process unless a condition holds."""
        good, bad = self.name("good"), self.name("bad")
        self.branch(condition, good, bad)
        self.begin(bad)
        self.do("call void @abort()")
        self.end("unreachable")
        self.begin(good)

    def begin(self, block: str) -> None:
        """Begin a block."""
        self.lines.append(f"{block}:")
        self.block, self.dead = block, False

    def slot(self, kind: Kind) -> list[str]:
        """Memory on the stack for the parts of a value, as addresses."""
        addresses = [f"%{self.name('s')}" for _ in kind.parts]
        self.slots += [f"  {at} = alloca {part}" for at, part in zip(addresses, kind.parts, strict=True)]
        return addresses

    def put(self, value: Value, slot: list[str]) -> None:
        """Store the parts of a value."""
        for at, part, llvm in zip(slot, value.parts, value.kind.parts, strict=True):
            self.do(f"store {llvm} {part}, ptr {at}")

    def get(self, kind: Kind, slot: list[str]) -> Value:
        """Value whose parts were stored."""
        return Value(kind, tuple(self.op(f"load {p}, ptr {at}") for at, p in zip(slot, kind.parts, strict=True)))

    def convert(self, value: Value, kind: Kind) -> Value:
        """The value in a wider kind, or rounded to a narrower one of reals.

        Raises:
            KernelError: If that is no such kind.
        """
        if value.kind == kind:
            return value
        if isinstance(kind, Scalar) and isinstance(value.kind, Scalar):
            return self._number(value, kind)
        if isinstance(kind, Array) and isinstance(value.kind, Array) and not kind.ordered:
            return Value(kind, (value.text, *self.lengths(value), *self.strides(value)))
        if isinstance(kind, Tuple) and isinstance(value.kind, Tuple):
            return tuple_of(map(self.convert, value.items, kind.items), kind.names)
        raise KernelError(f"{_shown(value.kind)} is no {_shown(kind)}")

    def _number(self, value: Value, kind: Scalar) -> Value:
        one, text, constant = value.kind, value.text, value.constant
        if kind == BOOL:
            zero = "une double" if one == REAL else "une float" if one == SINGLE else "ne i64"
            compare = "fcmp" if one.is_real else "icmp"
            return Value(BOOL, (self.op(f"{compare} {zero} {text}, {real(0.0) if one.is_real else 0}"),))
        if kind == INT and one == BOOL:
            return Value(INT, (text if constant is not None else self.op(f"zext i1 {text} to i64"),))
        if kind.is_real and not one.is_real:
            if constant is not None:
                return Value(kind, (real(float(constant)),))
            return Value(kind, (self.op(f"{'uitofp' if one == BOOL else 'sitofp'} {one.llvm} {text} to {kind.llvm}"),))
        if (one, kind) in ((SINGLE, REAL), (REAL, SINGLE)):
            if constant is not None:
                return Value(kind, (real(_single(constant) if kind == SINGLE else constant),))
            return Value(kind, (self.op(f"{'fpext' if kind == REAL else 'fptrunc'} {one.llvm} {text} to {kind.llvm}"),))
        raise KernelError(f"{_shown(one)} is no {_shown(kind)}: say int(...)")

    def lengths(self, array: Value) -> tuple[str, ...]:
        """Shape of an array."""
        return array.parts[1 : 1 + array.kind.ndim]

    def strides(self, array: Value) -> tuple[str, ...]:
        """Bytes from one entry to the next in each dimension."""
        kind = array.kind
        if not kind.ordered:
            return array.parts[1 + kind.ndim :]
        out = [str(kind.entry.size)]
        for length in reversed(self.lengths(array)[1:]):
            out.insert(0, self.times(out[0], length))
        return tuple(out[: kind.ndim])

    def times(self, one: str, other: str) -> str:
        """Product of two indices."""
        if one == "1" or other == "1":
            return other if one == "1" else one
        if one[0] != "%" and other[0] != "%":
            return str(int(one) * int(other))
        return self.op(f"mul nsw i64 {one}, {other}")

    def plus(self, one: str, other: str) -> str:
        """Sum of two indices."""
        if one == "0" or other == "0":
            return other if one == "0" else one
        if one[0] != "%" and other[0] != "%":
            return str(int(one) + int(other))
        return self.op(f"add nsw i64 {one}, {other}")


def _single(value: float) -> float:
    return struct.unpack("f", struct.pack("f", value))[0]


def _shown(kind: Kind) -> str:
    names = {BOOL: "a truth value", INT: "an integer", REAL: "a real number", SINGLE: "a real number of 4 bytes"}
    return names.get(kind) or (repr(kind.value) if isinstance(kind, Fixed) else f"{kind}")
