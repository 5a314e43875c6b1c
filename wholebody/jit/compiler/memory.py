"""Arrays, records and packed memory: places of entries, views, what is loaded and stored."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from wholebody.jit.compiler.assembly import Assembly, Value, number, tuple_of
from wholebody.jit.compiler.kinds import BOOL, INT, STORED, Array, Element, KernelError, Kind, Memory, Scalar, Stored
from wholebody.jit.packed import TABLE_ROW

PACKED = {"f": STORED["f8"], "i": STORED["i8"]}
WORD = 8
"""Bytes of a number in packed memory."""


@dataclass(frozen=True)
class Address:
    """Where a number lies in memory."""

    entry: Stored
    address: str


@dataclass(frozen=True)
class Span:
    """A slice ``first:last`` in an index, ends that are not written None."""

    first: Value | None
    last: Value | None


Index = Sequence[Value | Span]


def load(out: Assembly, place: Address) -> Value:
    """The number at a place."""
    entry = place.entry
    text = out.op(f"load {entry.llvm}, ptr {place.address}, align {entry.size}")
    if entry.kind == BOOL:
        return Value(BOOL, (out.op(f"icmp ne i8 {text}, 0"),))
    if entry.kind == INT and entry.size < WORD:
        text = out.op(f"{'sext' if entry.signed else 'zext'} {entry.llvm} {text} to i64")
    return Value(entry.kind, (text,))


def store(out: Assembly, value: Value, place: Address) -> None:
    """Put a number at a place, rounded to what fits there.

    Raises:
        KernelError: If it is no number.
    """
    entry = place.entry
    text = out.convert(value, entry.kind).text
    if entry.kind == BOOL:
        text = out.op(f"zext i1 {text} to i8")
    elif entry.kind == INT and entry.size < WORD:
        text = out.op(f"trunc i64 {text} to {entry.llvm}")
    out.do(f"store {entry.llvm} {text}, ptr {place.address}, align {entry.size}")


def item(out: Assembly, array: Value, index: Index) -> Address | Value:
    """Place of the entry at an index; a view, where that leaves dimensions, or a record.

    Raises:
        KernelError: If the index is none of this array.
    """
    if not isinstance(array.kind, Array) or len(index) > array.kind.ndim:
        raise KernelError(f"{array.kind} has no {len(index)} indices")
    lengths, kind = out.lengths(array), array.kind
    at = [_inside(out, one, lengths[d]) for d, one in enumerate(index) if not isinstance(one, Span)]
    if len(at) == kind.ndim:
        address = _entry(out, array, at)
        return Address(kind.entry, address) if isinstance(kind.entry, Stored) else Value(kind.entry, (address,))
    return _view(out, array, index)


def _inside(out: Assembly, index: Value, length: str, *, cut: bool = False) -> str:
    """Text of an index, or of an end of a slice (``cut``); one that is written as negative counts from the end."""
    if not isinstance(index.kind, Scalar) or index.kind.is_real:
        raise KernelError(f"{index.kind} is no index: say int(...)")
    negative = index.constant is not None and index.constant < 0
    text = out.plus(length, index.text) if negative else out.convert(index, INT).text
    if out.guarded:
        out.require(out.op(f"icmp sge i64 {text}, 0" if cut else f"icmp ult i64 {text}, {length}"))
    return text


def _entry(out: Assembly, array: Value, at: Sequence[str]) -> str:
    """Address of an entry."""
    kind = array.kind
    if not kind.ordered:
        total = "0"
        for one, stride in zip(at, out.strides(array), strict=True):
            total = out.plus(total, out.times(one, stride))
        return moved(out, array.text, total, "i8")
    total = "0"
    for one, length in zip(at, ["1", *out.lengths(array)[1:]], strict=True):
        total = out.plus(out.times(total, length) if total != "0" else "0", one)
    if isinstance(kind.entry, Stored):
        return moved(out, array.text, total, kind.entry.llvm)
    return moved(out, array.text, out.times(total, str(kind.entry.size)), "i8")


def moved(out: Assembly, address: str, count: str, llvm: str) -> str:
    """Address ``count`` entries of a type further."""
    return address if count == "0" else out.op(f"getelementptr inbounds {llvm}, ptr {address}, i64 {count}")


def _view(out: Assembly, array: Value, index: Index) -> Value:
    """Array of what an index leaves, on the same memory."""
    kind, lengths, strides = array.kind, out.lengths(array), out.strides(array)
    index = [*index, *[Span(None, None)] * (kind.ndim - len(index))]
    offset, shape, steps, ordered = "0", [], [], kind.ordered
    for d, one in enumerate(index):
        first, length = ("0", "1")
        if isinstance(one, Span):
            first, length = _clipped(out, one, lengths[d])
            # What is before the first dimension that is kept may be cut; after it, only whole ones stay in order.
            ordered = ordered and (not shape or (one.first is None and one.last is None))
            shape.append(length)
            steps.append(strides[d])
        else:
            first, ordered = _inside(out, one, lengths[d]), ordered and not shape
        offset = out.plus(offset, out.times(first, strides[d]))
    address = moved(out, array.text, offset, "i8")
    return Value(Array(kind.entry, len(shape), ordered), (address, *shape, *([] if ordered else steps)))


def _clipped(out: Assembly, span: Span, length: str) -> tuple[str, str]:
    """First entry of a slice, and its length, as numpy cuts it."""
    if span.first is None and span.last is None:
        return "0", length
    first = "0" if span.first is None else least(out, _inside(out, span.first, length, cut=True), length)
    last = length if span.last is None else least(out, _inside(out, span.last, length, cut=True), length)
    if first == "0":
        return first, last
    return first, largest(out, out.op(f"sub nsw i64 {last}, {first}"), "0")


def least(out: Assembly, one: str, other: str) -> str:
    """Smaller one of two lengths."""
    if one[0] != "%" and other[0] != "%":
        return str(min(int(one), int(other)))
    return out.op(f"call i64 @llvm.smin.i64(i64 {one}, i64 {other})")


def largest(out: Assembly, one: str, other: str) -> str:
    """Larger one of two lengths."""
    return out.op(f"call i64 @llvm.smax.i64(i64 {one}, i64 {other})")


def size(out: Assembly, array: Value) -> Value:
    """Number of entries of an array."""
    total = "1"
    for length in out.lengths(array):
        total = out.times(total, length)
    return Value(INT, (total,))


def attribute(out: Assembly, value: Value, name: str) -> Address | Value:
    """``value.name``: shape or size of an array, a field of a record or of packed memory, an item of a named tuple.

    Raises:
        KernelError: If it has none of that name.
    """
    kind = value.kind
    if isinstance(kind, Array) and name == "shape":
        return tuple_of(Value(INT, (length,)) for length in out.lengths(value))
    if isinstance(kind, Array) and name == "size":
        return size(out, value)
    if isinstance(kind, Array) and name == "ndim":
        return number(kind.ndim)
    if isinstance(kind, Element):
        return _record_field(out, value, name)
    if isinstance(kind, Memory):
        return _packed_field(out, value, name)
    if name in getattr(kind, "names", ()):
        return value.items[kind.names.index(name)]
    raise KernelError(f"{kind} has no '{name}'")


def _record_field(out: Assembly, record: Value, name: str) -> Address | Value:
    found = [field for field in record.kind.fields if field[0] == name]
    if not found:
        raise KernelError(f"the record has no '{name}', only {', '.join(field[0] for field in record.kind.fields)}")
    _, at, entry, shape = found[0]
    address = moved(out, record.text, str(at), "i8")
    return Value(Array(entry, len(shape)), (address, *map(str, shape))) if shape else Address(entry, address)


def _packed_field(out: Assembly, memory: Value, name: str) -> Address | Value:
    names = [field[0] for field in memory.kind.fields]
    if name not in names:
        raise KernelError(f"the packed memory has no '{name}'")
    at, (_, letter, ndim) = names.index(name), memory.kind.fields[names.index(name)]
    start, *lengths = (_table(out, memory, TABLE_ROW * at + i) for i in range(1 + ndim))
    address = moved(out, memory.text, start, PACKED[letter].llvm)
    return Value(Array(PACKED[letter], ndim), (address, *lengths)) if ndim else Address(PACKED[letter], address)


def _table(out: Assembly, memory: Value, at: int) -> str:
    """Entry of the table of the fields; it stays as it is while kernels run."""
    return out.op(f"load i64, ptr {moved(out, memory.text, str(at), 'i64')}, align 8, !invariant.load !0")


def reshaped(out: Assembly, array: Value, shape: Sequence[Value]) -> Value:
    """``array.reshape(shape)``, on the same memory.

    Raises:
        KernelError: If its entries are not in C order.
    """
    if not isinstance(array.kind, Array) or not array.kind.ordered:
        raise KernelError("only an array of C order has other shapes")
    lengths = [out.convert(length, INT).text for length in shape]
    other = Value(Array(array.kind.entry, len(lengths)), (array.text, *lengths))
    if out.guarded:
        out.require(out.op(f"icmp eq i64 {size(out, other).text}, {size(out, array).text}"))
    return other


def common(one: Kind, other: Kind) -> bool:
    """Whether two arrays have as many dimensions."""
    return isinstance(one, Array) and isinstance(other, Array) and one.ndim == other.ndim
