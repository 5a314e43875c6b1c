"""From the source of a kernel to LLVM's language: expressions and calls."""

from __future__ import annotations

import ast
import builtins
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FunctionType

from wholebody.jit.compiler import memory
from wholebody.jit.compiler.arithmetic import FUNCTIONS, binary, compare, extreme, negative, truth
from wholebody.jit.compiler.assembly import Value, number, tuple_of
from wholebody.jit.compiler.kinds import BOOL, INT, Array, Fixed, KernelError, Scalar, Tuple, wider
from wholebody.jit.compiler.memory import Address, Span
from wholebody.jit.compiler.scope import Scope, outside


class Expressions(Scope):
    """Expressions of one kernel."""

    def _value_name(self, node: ast.Name) -> Value:
        return self.named(node.id)

    def value(self, node: ast.expr) -> Value:
        """Value of an expression.

        Raises:
            KernelError: If kernels have no such expression.
        """
        handler = getattr(self, f"_value_{type(node).__name__.lower()}", None)
        if handler is None:
            raise KernelError(f"kernels have no expression {type(node).__name__}")
        return handler(node)

    def _value_constant(self, node: ast.Constant) -> Value:
        return outside(node.value)

    def _value_tuple(self, node: ast.Tuple) -> Value:
        return tuple_of([self.value(one) for one in node.elts])

    def _value_binop(self, node: ast.BinOp) -> Value:
        return binary(self.out, type(node.op), self.value(node.left), self.value(node.right))

    def _value_unaryop(self, node: ast.UnaryOp) -> Value:
        value = self.value(node.operand)
        if isinstance(node.op, ast.USub):
            return negative(self.out, value)
        if isinstance(node.op, ast.Not):
            value = truth(self.out, value)
            if value.constant is not None:
                return number(not value.constant)
            return Value(BOOL, (self.out.op(f"xor i1 {value.text}, true"),))
        raise KernelError(f"kernels have no operator {type(node.op).__name__}")

    def _value_attribute(self, node: ast.Attribute) -> Value:
        return self.loaded(self.place(node))

    def _value_subscript(self, node: ast.Subscript) -> Value:
        return self.loaded(self.place(node))

    def loaded(self, place: Address | Value) -> Value:
        """What lies at a place; a view as it is."""
        return memory.load(self.out, place) if isinstance(place, Address) else place

    def place(self, node: ast.expr) -> Address | Value:
        """Where an attribute or an entry is, or what it is where it has no place.

        Raises:
            KernelError: If it is neither.
        """
        if isinstance(node, ast.Attribute):
            value = self.value(node.value)
            if isinstance(value.kind, Fixed):
                return outside(getattr(value.kind.value, node.attr))
            return memory.attribute(self.out, value, node.attr)
        if isinstance(node, ast.Subscript):
            value, index = self.value(node.value), self._index(node.slice)
            return self._item(value, index) if isinstance(value.kind, Tuple) else memory.item(self.out, value, index)
        raise KernelError(f"{type(node).__name__} is no place")

    def _index(self, node: ast.expr) -> list[Value | Span]:
        out: list[Value | Span] = []
        for one in node.elts if isinstance(node, ast.Tuple) else [node]:
            if isinstance(one, ast.Slice):
                if one.step is not None:
                    raise KernelError("slices have no steps")
                ends = [None if end is None else self.value(end) for end in (one.lower, one.upper)]
                out.append(Span(*ends))
            else:
                out.append(self.value(one))
        return out

    def _item(self, row: Value, index: list[Value | Span]) -> Value:
        """Item of a tuple; at an index that is not known, one of items of the same kind."""
        at, items = index[0], row.items
        if len(index) != 1 or isinstance(at, Span):
            raise KernelError("a tuple has one index")
        if at.constant is not None:
            return items[int(at.constant)]
        kind = items[0].kind
        for item in items[1:]:
            kind = wider(kind, item.kind)
        items, at = [self.out.convert(item, kind) for item in items], self.out.convert(at, INT)
        found = items[-1]
        for k, item in enumerate(items[:-1]):
            here = self.out.op(f"icmp eq i64 {at.text}, {k}")
            parts = zip(kind.parts, item.parts, found.parts, strict=True)
            found = Value(kind, tuple(self.out.op(f"select i1 {here}, {t} {a}, {t} {b}") for t, a, b in parts))
        return found

    # Conditions.

    def known(self, node: ast.expr) -> bool | None:
        """Whether a condition holds, if that is known when it is compiled."""
        leaves = (ast.Name, ast.Constant)
        operands = [node.left, *node.comparators] if isinstance(node, ast.Compare) else [node]
        if not all(isinstance(one, leaves) for one in operands):
            return None
        if any(isinstance(one, ast.Name) and one.id in self.slots for one in operands):
            return None
        values = [self.value(one) for one in operands]
        if any(value.constant is None for value in values):
            return None
        return bool(self.value(node).constant)

    def go(self, node: ast.expr, then: str, otherwise: str) -> None:
        """Go on in one of two blocks by a condition, of which no more is computed than it takes."""
        if isinstance(node, ast.BoolOp):
            for one in node.values[:-1]:
                following = self.out.name("more")
                ends = (following, otherwise) if isinstance(node.op, ast.And) else (then, following)
                self.go(one, *ends)
                self.out.begin(following)
            self.go(node.values[-1], then, otherwise)
        elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
            self.go(node.operand, otherwise, then)
        else:
            value = truth(self.out, self.value(node))
            if value.constant is None:
                self.out.branch(value.text, then, otherwise)
            else:
                self.out.jump(then if value.constant else otherwise)

    def _value_boolop(self, node: ast.BoolOp) -> Value:
        return self._while_so((lambda one=one: self.value(one) for one in node.values), isinstance(node.op, ast.And))

    def _while_so(self, parts: Iterator[Callable[[], Value]], so: bool) -> Value:
        """The first truth value that is not ``so``, or the last one."""
        key, end = object(), self.out.name("end")
        self.kinds[key], parts = BOOL, list(parts)
        for k, part in enumerate(parts):
            value = part()
            if value.kind != BOOL:
                raise KernelError("'and' and 'or' are of truth values; of numbers they would be one of the numbers")
            self.assign(key, value)
            if k + 1 < len(parts):
                following = self.out.name("more")
                self.out.branch(value.text, *((following, end) if so else (end, following)))
                self.out.begin(following)
        self.out.jump(end)
        self.out.begin(end)
        return self.read(key)

    def _value_compare(self, node: ast.Compare) -> Value:
        left = self.value(node.left)
        if len(node.ops) == 1:
            return self._compared(node.ops[0], left, self.value(node.comparators[0]))
        last = [left]

        def part(kind: ast.cmpop, right: ast.expr) -> Value:
            last.append(self.value(right))
            return self._compared(kind, last[-2], last[-1])

        pairs = zip(node.ops, node.comparators, strict=True)
        return self._while_so((lambda kind=kind, right=right: part(kind, right) for kind, right in pairs), True)

    def _compared(self, kind: ast.cmpop, left: Value, right: Value) -> Value:
        if not isinstance(kind, ast.In | ast.NotIn):
            return compare(self.out, type(kind), left, right)
        found = number(False)
        for item in right.items:
            same = compare(self.out, ast.Eq, left, item)
            found = same if found.constant is False or found.constant == 0 else self._either(found, same)
        if isinstance(kind, ast.In):
            return found
        return Value(BOOL, (self.out.op(f"xor i1 {found.text}, true"),))

    def _either(self, one: Value, other: Value) -> Value:
        return Value(BOOL, (self.out.op(f"or i1 {one.text}, {other.text}"),))

    def _value_ifexp(self, node: ast.IfExp) -> Value:
        condition = self.known(node.test)
        if condition is not None:
            return self.value(node.body if condition else node.orelse)
        then, otherwise, end = self.out.name("then"), self.out.name("else"), self.out.name("end")
        self.go(node.test, then, otherwise)
        for block, one in ((then, node.body), (otherwise, node.orelse)):
            self.out.begin(block)
            self.assign(node, self.value(one))
            self.out.jump(end)
        self.out.begin(end)
        return self.read(node)

    # Calls.

    def _value_call(self, node: ast.Call) -> Value:
        if node.keywords:
            raise KernelError("arguments are given by place")
        if isinstance(node.func, ast.Attribute) and node.func.attr == "reshape":
            shape = [self.value(one) for one in node.args]
            shape = shape[0].items if isinstance(shape[0].kind, Tuple) else shape
            return memory.reshaped(self.out, self.value(node.func.value), shape)
        function, values = self.value(node.func).kind, [self.value(one) for one in node.args]
        if not isinstance(function, Fixed):
            raise KernelError("only functions are called")
        return self._called(function.value, values)

    def _called(self, function: Callable, values: list[Value]) -> Value:
        if isinstance(function, FunctionType):
            return self._kernel(function, values)
        if function in (builtins.max, builtins.min) and len(values) > 1:
            return extreme(self.out, values, ast.Gt if function is builtins.max else ast.Lt)
        if function is builtins.len and isinstance(values[0].kind, Array):
            return Value(INT, (self.out.lengths(values[0])[0],))
        if function in FUNCTIONS and all(isinstance(value.kind, Scalar) for value in values):
            return FUNCTIONS[function](self.out, *values)
        if isinstance(function, type) and issubclass(function, tuple) and hasattr(function, "_fields"):
            return tuple_of(values, function._fields)
        raise KernelError(f"kernels do not call {getattr(function, '__name__', function)} with these")

    def _kernel(self, function: FunctionType, values: list[Value]) -> Value:
        missing = function.__code__.co_argcount - len(values)
        if missing > 0:
            values = values + [outside(one) for one in (function.__defaults__ or ())[-missing:]]
        name, answer = self.program.compiled(function, tuple(value.kind for value in values))
        given = ", ".join(
            f"{llvm} {part}" for v in values for llvm, part in zip(v.kind.parts, v.parts, strict=True)
        )  # fmt: skip
        row = answer.parts
        if len(row) < 2:
            text = f"call {row[0] if row else 'void'} @{name}({given})"
            return Value(answer, (self.out.op(text),)) if row else (self.out.do(text), Value(answer))[1]
        whole = self.out.op(f"call {{ {', '.join(row)} }} @{name}({given})")
        parts = (self.out.op(f"extractvalue {{ {', '.join(row)} }} {whole}, {i}") for i in range(len(row)))
        return Value(answer, tuple(parts))

    # Loops.

    @contextmanager
    def counting(
        self, first: Value, last: Value, step: Value, loops: list[tuple[str, str]] | None = None
    ) -> Iterator[Value]:
        """A loop around what is written meanwhile, and its counter; ``loops`` learns where to go on and to leave."""
        out = self.out
        start, stop, by = (out.convert(one, INT).text for one in (first, last, step))
        head, body, again, end = (out.name(stem) for stem in ("for", "body", "again", "end"))
        at, following, before = f"%{out.name('i')}", f"%{out.name('i')}", out.block
        out.jump(head)
        out.begin(head)
        out.do(f"{at} = phi i64 [ {start}, %{before} ], [ {following}, %{again} ]")
        out.branch(self._goes_on(at, stop, step), body, end)
        out.begin(body)
        if loops is not None:
            loops.append((again, end))
        yield Value(INT, (at,))
        if loops is not None:
            loops.pop()
        out.jump(again)
        out.begin(again)
        out.do(f"{following} = add nsw i64 {at}, {by}")
        out.jump(head)
        out.begin(end)

    def _goes_on(self, at: str, stop: str, step: Value) -> str:
        up, down = f"icmp slt i64 {at}, {stop}", f"icmp sgt i64 {at}, {stop}"
        if step.constant is not None:
            return self.out.op(up if step.constant > 0 else down)
        ahead = self.out.op(f"icmp sgt i64 {step.text}, 0")
        return self.out.op(f"select i1 {ahead}, i1 {self.out.op(up)}, i1 {self.out.op(down)}")
