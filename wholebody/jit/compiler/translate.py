"""From the source of a kernel to LLVM's language: statements.

A kernel is translated for the kinds of its arguments. What its variables are follows from what they are set to: a name
that is an integer here and a real number there is a real number, and the kernel is translated again until no name
becomes wider.
"""

from __future__ import annotations

import ast
from types import FunctionType

from wholebody.jit.compiler import memory
from wholebody.jit.compiler.arithmetic import binary
from wholebody.jit.compiler.assembly import Assembly, Value
from wholebody.jit.compiler.expressions import Expressions
from wholebody.jit.compiler.kinds import INT, NONE, Array, KernelError, Kind, Scalar, Tuple, wider
from wholebody.jit.compiler.memory import Address
from wholebody.jit.compiler.names import is_read, sets, times_set
from wholebody.jit.compiler.scope import Kernels


class Translation(Expressions):
    """One kernel for one row of kinds.

    Args:
        function: The kernel.
        node: Its definition.
        kinds: Kinds of its arguments.
        flags: What LLVM may do with arithmetic of reals.
        program: Has the kernels that it calls.
    """

    def __init__(
        self,
        function: FunctionType,
        node: ast.FunctionDef,
        kinds: tuple[Kind, ...],
        flags: str,
        program: Kernels,
    ) -> None:
        super().__init__(function, flags, program)
        self.node, self.arguments = node, kinds
        self.answer: Kind | None = None
        self._set = times_set(node)
        self._loops: list[tuple[str, str]] = []
        self._following: list[list[ast.stmt]] = []

    def run(self, name: str) -> tuple[str, Kind]:
        """Text of the kernel as a function of LLVM under a name, and the kind of its answer.

        Raises:
            KernelError: If it is outside the language of kernels, with the line.
        """
        while True:
            self.widened, self.fixed, self.slots, self._following = False, {}, {}, []
            self.out = Assembly(self.out.flags)
            parameters = self._parameters()
            self._block(self.node.body)
            if not self.out.dead:
                self._return(Value(NONE)) if self.answer in (None, NONE) else self.out.end("unreachable")
            if not self.widened:
                return self._text(name, parameters), self.answer

    def _text(self, name: str, parameters: list[str]) -> str:
        head = f"define internal {returned(self.answer)} @{name}({', '.join(parameters)}) #0 {{"
        return "\n".join([head, "begin:", *self.out.slots, *self.out.lines, "}"])

    def _parameters(self) -> list[str]:
        """Bind the arguments to registers; those that are set anew later to variables."""
        texts, names = [], [argument.arg for argument in self.node.args.args]
        if len(names) != len(self.arguments):
            raise KernelError(f"{self.function.__name__} takes {len(names)} arguments, not {len(self.arguments)}")
        for k, (name, kind) in enumerate(zip(names, self.arguments, strict=True)):
            parts = tuple(f"%a{k}.{i}" for i in range(len(kind.parts)))
            texts += [f"{llvm} {part}" for llvm, part in zip(kind.parts, parts, strict=True)]
            if name in self._set:
                self.assign(name, Value(kind, parts))
            else:
                self.fixed[name] = Value(kind, parts)
        return texts

    # Statements.

    def _block(self, statements: list[ast.stmt]) -> None:
        for k, statement in enumerate(statements):
            if self.out.dead:
                return
            self._following.append(statements[k + 1 :])
            handler = getattr(self, f"_do_{type(statement).__name__.lower()}", None)
            if handler is None:
                raise self.error(statement, f"kernels have no statement {type(statement).__name__}")
            try:
                handler(statement)
            except KernelError as error:
                raise self.error(statement, str(error)) from None
            self._following.pop()

    def _do_pass(self, node: ast.Pass) -> None:
        pass

    def _do_expr(self, node: ast.Expr) -> None:
        if not isinstance(node.value, ast.Constant):
            self.value(node.value)

    def _do_return(self, node: ast.Return) -> None:
        self._return(Value(NONE) if node.value is None else self.value(node.value))

    def _return(self, value: Value) -> None:
        kind = value.kind if self.answer is None else wider(self.answer, value.kind)
        self.widened |= self.answer is not None and kind != self.answer
        self.answer, value = kind, self.out.convert(value, kind)
        if len(value.parts) < 2:
            self.out.end(f"ret {kind.parts[0]} {value.text}" if value.parts else "ret void")
            return
        whole, row = "poison", returned(kind)
        for i, (llvm, part) in enumerate(zip(kind.parts, value.parts, strict=True)):
            whole = self.out.op(f"insertvalue {row} {whole}, {llvm} {part}, {i}")
        self.out.end(f"ret {row} {whole}")

    def _do_assign(self, node: ast.Assign) -> None:
        value = self.value(node.value)
        for target in node.targets:
            self._to(target, value)

    def _to(self, target: ast.expr, value: Value) -> None:
        if isinstance(target, ast.Name):
            self._to_name(target.id, value)
        elif isinstance(target, ast.Tuple):
            if not isinstance(value.kind, Tuple) or len(value.items) != len(target.elts):
                raise KernelError(f"{len(target.elts)} names take a tuple of as many")
            for one, part in zip(target.elts, value.items, strict=True):
                self._to(one, part)
        else:
            self._to_place(self.place(target), value)

    def _to_name(self, name: str, value: Value) -> None:
        """A name that is set once, before all loops and branches, is the value itself."""
        if self._set.get(name) == 1:
            self.fixed[name] = value
        else:
            self.assign(name, value)

    def _to_place(self, place: Address | Value, value: Value) -> None:
        if isinstance(place, Address):
            memory.store(self.out, value, place)
        elif isinstance(place.kind, Array):
            self._fill(place, value)
        else:
            raise KernelError("this cannot be set")

    def _fill(self, array: Value, value: Value) -> None:
        """Set all entries of a view: to a number, or to those of another array of its shape."""
        if not (isinstance(value.kind, Scalar) or memory.common(array.kind, value.kind)):
            raise KernelError("an array is set to a number, or to an array of as many dimensions")
        flat = [one for one in (array, value) if isinstance(one.kind, Array)]
        if all(one.kind.ordered for one in flat):
            count = memory.size(self.out, array)
            flat = [memory.reshaped(self.out, one, [count]) for one in flat]
        self._each(flat[0], flat[1] if len(flat) > 1 else None, value, [])

    def _each(self, array: Value, source: Value | None, value: Value, index: list[Value]) -> None:
        if len(index) == array.kind.ndim:
            given = value if source is None else memory.load(self.out, memory.item(self.out, source, index))
            memory.store(self.out, given, memory.item(self.out, array, index))
            return
        end = Value(INT, (self.out.lengths(array)[len(index)],))
        with self.counting(Value(INT, ("0",)), end, Value(INT, ("1",))) as at:
            self._each(array, source, value, [*index, at])

    def _do_augassign(self, node: ast.AugAssign) -> None:
        if isinstance(node.target, ast.Name):
            old = self.value(ast.Name(node.target.id, ast.Load()))
            self._to(node.target, binary(self.out, type(node.op), old, self.value(node.value)))
            return
        place = self.place(node.target)
        if not isinstance(place, Address):
            raise KernelError("arithmetic of whole arrays needs a loop")
        old = memory.load(self.out, place)
        memory.store(self.out, binary(self.out, type(node.op), old, self.value(node.value)), place)

    # Control.

    def _do_if(self, node: ast.If) -> None:
        condition = self.known(node.test)
        if condition is not None:
            self._block(node.body if condition else node.orelse)
            return
        then, end = self.out.name("then"), self.out.name("end")
        otherwise = self.out.name("else") if node.orelse else end
        self.go(node.test, then, otherwise)
        self.out.begin(then)
        self._block(node.body)
        self.out.jump(end)
        if node.orelse:
            self.out.begin(otherwise)
            self._block(node.orelse)
            self.out.jump(end)
        self._join(end)

    def _join(self, block: str) -> None:
        """Begin a block, if anything reaches it: else what follows is not translated."""
        if block in self.out.targets:
            self.out.begin(block)

    def _do_while(self, node: ast.While) -> None:
        test, body, end = self.out.name("while"), self.out.name("body"), self.out.name("end")
        self.out.jump(test)
        self.out.begin(test)
        if self.known(node.test):
            self.out.jump(body)
        else:
            self.go(node.test, body, end)
        self.out.begin(body)
        self._inside(node.body, test, end)
        self.out.jump(test)
        self._join(end)

    def _inside(self, body: list[ast.stmt], again: str, end: str) -> None:
        self._loops.append((again, end))
        self._body(body)
        self._loops.pop()

    def _body(self, body: list[ast.stmt]) -> None:
        """Statements of a loop, which may follow themselves."""
        self._following.append(body)
        self._block(body)
        self._following.pop()

    def _do_break(self, node: ast.Break) -> None:
        self.out.jump(self._loops[-1][1])

    def _do_continue(self, node: ast.Continue) -> None:
        self.out.jump(self._loops[-1][0])

    def _do_for(self, node: ast.For) -> None:
        call = node.iter
        if isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id == "range":
            first, last, step = self._range([self.value(one) for one in call.args])
            with self.counting(first, last, step, loops=self._loops) as at:
                self._turn(node, at)
            return
        values = self.value(call)
        if isinstance(values.kind, Tuple):
            self._unrolled(node, values.items)
            return
        end = Value(INT, (self.out.lengths(values)[0],))
        with self.counting(Value(INT, ("0",)), end, Value(INT, ("1",)), loops=self._loops) as at:
            self._turn(node, self.loaded(memory.item(self.out, values, [at])))

    def _turn(self, node: ast.For, value: Value) -> None:
        """The body of a loop for one value, which is no variable where nothing else sets or needs its name."""
        name = node.target.id if isinstance(node.target, ast.Name) else None
        if name is None or sets(node.body, name) or is_read(self._following[::-1], name):
            self._to(node.target, value)
            self._body(node.body)
            return
        before = self.fixed.get(name)
        self.fixed[name] = value
        self._body(node.body)
        if before is None:
            del self.fixed[name]
        else:
            self.fixed[name] = before

    @staticmethod
    def _range(given: list[Value]) -> tuple[Value, Value, Value]:
        zero, one = Value(INT, ("0",)), Value(INT, ("1",))
        if any(not isinstance(value.kind, Scalar) or value.kind.is_real for value in given):
            raise KernelError("a range is of integers")
        return (zero, given[0], one) if len(given) == 1 else (*given, one)[:3]

    def _unrolled(self, node: ast.For, items: list[Value]) -> None:
        """The body once for each item of a tuple."""
        end = self.out.name("end")
        for item in items:
            following = self.out.name("next")
            self._to(node.target, item)
            self._inside(node.body, following, end)
            self.out.jump(following)
            self.out.begin(following)
        self.out.jump(end)
        self.out.begin(end)


def returned(kind: Kind) -> str:
    """What a function of LLVM returns for an answer of this kind."""
    parts = kind.parts
    return "void" if not parts else parts[0] if len(parts) == 1 else f"{{ {', '.join(parts)} }}"
