"""Numbers: operators, comparisons and functions, with the results that Python and numpy give.

Division by zero gives infinities and not-a-number as in numpy. Arithmetic of integers is that of 64 bits.
"""

from __future__ import annotations

import ast
import builtins
import math
import operator
from collections.abc import Callable

import numpy as np

from wholebody.jit.compiler.assembly import Assembly, Value, number, real
from wholebody.jit.compiler.kinds import BOOL, INT, REAL, SINGLE, KernelError, Scalar, wider

REALS = {ast.Add: "fadd", ast.Sub: "fsub", ast.Mult: "fmul", ast.Div: "fdiv"}
INTEGERS = {ast.Add: "add nsw", ast.Sub: "sub nsw", ast.Mult: "mul nsw"}
FOLDED = {ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.FloorDiv: operator.floordiv}
COMPARED = {
    ast.Eq: ("oeq", "eq"), ast.NotEq: ("une", "ne"), ast.Lt: ("olt", "slt"), ast.LtE: ("ole", "sle"),
    ast.Gt: ("ogt", "sgt"), ast.GtE: ("oge", "sge"),
}  # fmt: skip
"""Comparisons of reals and of integers."""
LARGEST_POWER = 16
"""Exponents up to this are products."""


def binary(out: Assembly, kind: type[ast.operator], one: Value, other: Value) -> Value:
    """Result of an operator between two numbers.

    Raises:
        KernelError: If kernels have no such operator.
    """
    if not (isinstance(one.kind, Scalar) and isinstance(other.kind, Scalar)):
        raise KernelError("arithmetic is of numbers: whole arrays need a loop")
    if kind is ast.Pow:
        return power(out, one, other)
    both = wider(wider(one.kind, other.kind), REAL if kind is ast.Div and not one.kind.is_real else INT)
    both = wider(one.kind, other.kind) if one.kind.is_real and other.kind.is_real else both
    if both == INT and kind in FOLDED and one.constant is not None and other.constant is not None:
        return number(FOLDED[kind](int(one.constant), int(other.constant)))
    a, b = out.convert(one, both).text, out.convert(other, both).text
    if both.is_real and kind in REALS:
        return Value(both, (out.op(f"{REALS[kind]} {out.flags}{both.llvm} {a}, {b}"),))
    if both == INT and kind in INTEGERS:
        return Value(INT, (out.op(f"{INTEGERS[kind]} i64 {a}, {b}"),))
    if both == INT and kind in (ast.FloorDiv, ast.Mod):
        return Value(INT, (_floored(out, kind, a, b),))
    raise KernelError(f"kernels have no {kind.__name__} of {both.llvm}")


def _floored(out: Assembly, kind: type[ast.operator], a: str, b: str) -> str:
    """Quotient rounded down, or its rest, which has the sign of the divisor."""
    rest = out.op(f"srem i64 {a}, {b}")
    sign = out.op(f"xor i64 {rest}, {b}")
    below = out.op(f"and i1 {out.op(f'icmp ne i64 {rest}, 0')}, {out.op(f'icmp slt i64 {sign}, 0')}")
    if kind is ast.Mod:
        return out.op(f"select i1 {below}, i64 {out.op(f'add i64 {rest}, {b}')}, i64 {rest}")
    return out.op(f"sub i64 {out.op(f'sdiv i64 {a}, {b}')}, {out.op(f'zext i1 {below} to i64')}")


def power(out: Assembly, one: Value, other: Value) -> Value:
    """``one ** other``: products for whole exponents that are written down."""
    exponent = other.constant
    if other.kind == INT and exponent is not None and 0 <= exponent <= LARGEST_POWER:
        result, square = None, one
        while exponent:
            if exponent & 1:
                result = square if result is None else binary(out, ast.Mult, result, square)
            exponent >>= 1
            square = binary(out, ast.Mult, square, square) if exponent else square
        return result or out.convert(number(1), one.kind)
    a, b = out.convert(one, REAL).text, out.convert(other, REAL).text
    return Value(REAL, (out.op(f"call double @llvm.pow.f64(double {a}, double {b})"),))


def negative(out: Assembly, value: Value) -> Value:
    """``-value``."""
    if value.constant is not None:
        return number(-value.constant) if value.kind != SINGLE else Value(SINGLE, (real(-value.constant),))
    if value.kind.is_real:
        return Value(value.kind, (out.op(f"fneg {out.flags}{value.kind.llvm} {value.text}"),))
    return Value(INT, (out.op(f"sub nsw i64 0, {out.convert(value, INT).text}"),))


def compare(out: Assembly, kind: type[ast.cmpop], one: Value, other: Value) -> Value:
    """Result of a comparison of two numbers.

    Raises:
        KernelError: If kernels have no such comparison.
    """
    if kind not in COMPARED or not (isinstance(one.kind, Scalar) and isinstance(other.kind, Scalar)):
        raise KernelError(f"kernels have no comparison {kind.__name__} of these")
    both = wider(wider(one.kind, other.kind), INT) if not one.kind == other.kind == SINGLE else SINGLE
    if one.constant is not None and other.constant is not None:
        return number(bool(_python(kind)(one.constant, other.constant)))
    a, b = out.convert(one, both).text, out.convert(other, both).text
    reals, integers = COMPARED[kind]
    text = f"fcmp {reals}" if both.is_real else f"icmp {integers}"
    return Value(BOOL, (out.op(f"{text} {both.llvm} {a}, {b}"),))


def _python(kind: type[ast.cmpop]) -> Callable:
    return getattr(operator, {"NotEq": "ne", "LtE": "le", "GtE": "ge"}.get(kind.__name__, kind.__name__.lower()))


def truth(out: Assembly, value: Value) -> Value:
    """Whether a number is not zero."""
    if not isinstance(value.kind, Scalar):
        raise KernelError("only numbers are true or false")
    return number(bool(value.constant)) if value.constant is not None else out.convert(value, BOOL)


def extreme(out: Assembly, values: list[Value], kind: type[ast.cmpop]) -> Value:
    """Largest or smallest of numbers: the first of those that are equal, as Python has it."""
    best = values[0]
    for value in values[1:]:
        both = wider(best.kind, value.kind)
        first, second = out.convert(best, both), out.convert(value, both)
        if both == INT and first.constant is not None and second.constant is not None:
            best = number((max if kind is ast.Gt else min)(first.constant, second.constant))
            continue
        beyond = compare(out, kind, second, first).text
        best = Value(both, (out.op(f"select i1 {beyond}, {both.llvm} {second.text}, {both.llvm} {first.text}"),))
    return best


def magnitude(out: Assembly, value: Value) -> Value:
    """``abs(value)``."""
    if value.kind.is_real:
        width = "f64" if value.kind == REAL else "f32"
        return Value(
            value.kind, (out.op(f"call {value.kind.llvm} @llvm.fabs.{width}({value.kind.llvm} {value.text})"),)
        )
    return Value(INT, (out.op(f"call i64 @llvm.abs.i64(i64 {out.convert(value, INT).text}, i1 false)"),))


def whole(out: Assembly, value: Value) -> Value:
    """``int(value)``: towards zero; of what is too large the largest, of what is no number 0."""
    if value.kind.is_real:
        width = "f64" if value.kind == REAL else "f32"
        text = f"call i64 @llvm.fptosi.sat.i64.{width}({value.kind.llvm} {value.text})"
        return Value(INT, (out.op(text),))
    return out.convert(value, INT)


def rounded(out: Assembly, value: Value) -> Value:
    """``round(value)``: to the nearest integer, halves to the even one."""
    if not value.kind.is_real:
        return out.convert(value, INT)
    even = out.op(f"call double @llvm.rint.f64(double {out.convert(value, REAL).text})")
    return whole(out, Value(REAL, (even,)))


def finite(out: Assembly, value: Value) -> Value:
    """``math.isfinite(value)``."""
    size = magnitude(out, out.convert(value, REAL)).text
    return Value(BOOL, (out.op(f"fcmp olt double {size}, {real(math.inf)}"),))


def single(out: Assembly, value: Value) -> Value:
    """``np.float32(value)``."""
    return out.convert(out.convert(value, REAL) if value.kind != SINGLE else value, SINGLE)


def double(out: Assembly, value: Value) -> Value:
    """``float(value)``."""
    return out.convert(value, REAL)


def _of_library(name: str) -> Callable[..., Value]:
    def call(out: Assembly, *values: Value) -> Value:
        given = ", ".join(f"double {out.convert(value, REAL).text}" for value in values)
        return Value(REAL, (out.op(f"call double @{name}({given})"),))

    return call


INTRINSICS = {math.sqrt: 1, math.sin: 1, math.cos: 1, math.exp: 1, math.log: 1, math.copysign: 2, math.floor: 1}
"""Functions that LLVM knows, with their numbers of arguments."""
LIBRARY = {
    math.acos: 1, math.asin: 1, math.atan: 1, math.tan: 1, math.log1p: 1, math.tanh: 1, math.atan2: 2, math.hypot: 2
}  # fmt: skip
"""Functions of C's library."""
FUNCTIONS: dict[object, Callable[..., Value]] = {
    builtins.abs: magnitude, builtins.int: whole, builtins.round: rounded, builtins.float: double,
    builtins.bool: truth, np.float32: single, math.isfinite: finite,
    **{one: _of_library(f"llvm.{one.__name__}.f64") for one in INTRINSICS if one is not math.floor},
    **{one: _of_library(one.__name__) for one in LIBRARY},
}  # fmt: skip
"""Functions of one or two numbers that kernels call."""

DECLARED = "\n".join(
    [f"declare double @llvm.{one.__name__}.f64({', '.join(['double'] * n)})" for one, n in INTRINSICS.items()]
    + [f"declare double @{one.__name__}({', '.join(['double'] * n)}) #1" for one, n in LIBRARY.items()]
    + ["declare double @llvm.pow.f64(double, double)", "declare double @llvm.rint.f64(double)"]
    + ["declare double @llvm.fabs.f64(double)", "declare float @llvm.fabs.f32(float)"]
    + ["declare i64 @llvm.abs.i64(i64, i1)", "declare i64 @llvm.smin.i64(i64, i64)"]
    + ["declare i64 @llvm.smax.i64(i64, i64)", "declare void @abort()"]
    + ["declare i64 @llvm.fptosi.sat.i64.f64(double)", "declare i64 @llvm.fptosi.sat.i64.f32(float)"]
)
"""What `FUNCTIONS` call, as LLVM wants it declared."""
