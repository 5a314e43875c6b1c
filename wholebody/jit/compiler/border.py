"""The border between Python and a kernel: a function of CPython's interface that takes arguments apart.

It looks at the type, the dimensions and the order of every array, which takes a few nanoseconds, so an argument of
another kind than the kernel was compiled for is refused by name instead of read as something that it is not.

Source:
    CPython, "Common Object Structures" (``METH_FASTCALL``); numpy, "NumPy C-API", ``PyArrayObject_fields`` and
    ``PyArray_Descr``, whose layouts are those of numpy 1 and 2 alike.
"""

from __future__ import annotations

import numpy as np

from wholebody.jit.compiler.assembly import Assembly, Value, real
from wholebody.jit.compiler.kinds import (
    BOOL,
    INT,
    NONE,
    REAL,
    SINGLE,
    STORED,
    Array,
    KernelError,
    Kind,
    Memory,
    Scalar,
    Tuple,
)
from wholebody.jit.compiler.translate import returned

CONSTANTS = (np.ndarray, None, True, False, TypeError)
"""Objects whose addresses compiled code finds behind the first argument, in this order."""
TYPE, DATA, NDIM, LENGTHS, STRIDES, DESCRIPTION, FLAGS = 8, 16, 24, 32, 40, 56, 64
"""Bytes at which an array has its type, its memory, and what describes it."""
BYTE_ORDER, NUMBER = 26, 28
"""Bytes at which a dtype has them."""
IN_C_ORDER, ALIGNED = 0x1, 0x100
"""Flags of an array."""

DECLARED = """\
declare double @PyFloat_AsDouble(ptr)
declare i64 @PyLong_AsLongLong(ptr)
declare i32 @PyObject_IsTrue(ptr)
declare ptr @PyErr_Occurred()
declare void @PyErr_SetString(ptr, ptr)
declare i32 @PyType_IsSubtype(ptr, ptr)
declare ptr @PyTuple_GetItem(ptr, i64)
declare ptr @PyObject_GetAttrString(ptr, ptr)
declare ptr @PyFloat_FromDouble(double)
declare ptr @PyLong_FromLongLong(i64)
declare ptr @PyTuple_New(i64)
declare i32 @PyTuple_SetItem(ptr, i64, ptr)
declare void @Py_IncRef(ptr)
declare void @Py_DecRef(ptr)
declare ptr @PyEval_SaveThread()
declare void @PyEval_RestoreThread(ptr)"""


class Border:
    """Text of the function that Python calls.

    Args:
        name: Its name.
        kernel: Name of the kernel's function.
        kinds: Kinds of the arguments.
        answer: Kind of the answer.
        shown: What messages call it.
    """

    def __init__(self, name: str, kernel: str, kinds: tuple[Kind, ...], answer: Kind, shown: str) -> None:
        self.name, self.kernel, self.kinds, self.answer, self.shown = name, kernel, kinds, answer, shown
        self.out, self.texts = Assembly(), []

    def text(self) -> str:
        """The function, and the texts of its messages."""
        out = self.out
        constants = self._load("ptr", "%self", DATA)
        self._constants = [self._load("ptr", constants, 8 * i) for i in range(len(CONSTANTS))]
        self._check(out.op(f"icmp eq i64 %count, {len(self.kinds)}"), f"takes {len(self.kinds)} arguments")
        values = []
        for k, kind in enumerate(self.kinds):
            given = self._load("ptr", "%given", 8 * k)
            values.append(self._taken(given, kind, f"{k + 1}"))
        result = self._call(values)
        out.end(f"ret ptr {self._given(result)}")
        out.begin("fail")
        out.end("ret ptr null")
        head = f"define ptr @{self.name}(ptr %self, ptr %given, i64 %count) #0 {{"
        return "\n".join([*self.texts, head, "begin:", *out.lines, "}"])

    def _call(self, values: list[Value]) -> Value:
        """Call the kernel, while other threads of Python go on."""
        out, answer = self.out, self.answer
        pairs = [pair for value in values for pair in zip(value.kind.parts, value.parts, strict=True)]
        call = f"call {returned(answer)} @{self.kernel}({', '.join(f'{llvm} {part}' for llvm, part in pairs)})"
        thread = out.op("call ptr @PyEval_SaveThread()")
        whole = out.op(call) if answer.parts else out.do(call)
        out.do(f"call void @PyEval_RestoreThread(ptr {thread})")
        if len(answer.parts) < 2:
            return Value(answer, (whole,) if answer.parts else ())
        row = returned(answer)
        return Value(answer, tuple(out.op(f"extractvalue {row} {whole}, {i}") for i in range(len(answer.parts))))

    def _load(self, llvm: str, address: str, at: int) -> str:
        return self.out.op(f"load {llvm}, ptr {self._at(address, at)}")

    def _at(self, address: str, at: int) -> str:
        return self.out.op(f"getelementptr i8, ptr {address}, i64 {at}") if at else address

    def _check(self, condition: str, message: str | None) -> None:
        """Fail unless a condition holds; without a message if Python has one already."""
        good, bad = self.out.name("good"), self.out.name("bad") if message else "fail"
        self.out.branch(condition, good, bad)
        if message:
            self.out.begin(bad)
            error, text = self._constants[CONSTANTS.index(TypeError)], self._string(message)
            self.out.do(f"call void @PyErr_SetString(ptr {error}, ptr {text})")
            self.out.jump("fail")
        self.out.begin(good)

    def _string(self, message: str) -> str:
        data = f"{self.shown}: {message}".encode() if message != "memory" else b"memory"
        name, text = f"@{self.name}.{len(self.texts)}", "".join(f"\\{byte:02X}" for byte in data)
        self.texts.append(f'{name} = private constant [{len(data) + 1} x i8] c"{text}\\00"')
        return name

    def _taken(self, given: str, kind: Kind, at: str) -> Value:
        """Parts of an argument."""
        if isinstance(kind, Scalar):
            return self._number(given, kind)
        if isinstance(kind, Array):
            return self._array(given, kind, at)
        if isinstance(kind, Tuple):
            parts: tuple[str, ...] = ()
            for i, item in enumerate(kind.items):
                one = self.out.op(f"call ptr @PyTuple_GetItem(ptr {given}, i64 {i})")
                self._check(self.out.op(f"icmp ne ptr {one}, null"), None)
                parts += self._taken(one, item, f"{at}[{i}]").parts
            return Value(kind, parts)
        if isinstance(kind, Memory):
            array = self.out.op(f"call ptr @PyObject_GetAttrString(ptr {given}, ptr {self._string('memory')})")
            self._check(self.out.op(f"icmp ne ptr {array}, null"), None)
            address = self._load("ptr", array, DATA)
            self.out.do(f"call void @Py_DecRef(ptr {array})")
            return Value(kind, (address,))
        return Value(kind)

    def _number(self, given: str, kind: Scalar) -> Value:
        out = self.out
        if kind == BOOL:
            text = out.op(f"call i32 @PyObject_IsTrue(ptr {given})")
            self._check(out.op(f"icmp sge i32 {text}, 0"), None)
            return Value(BOOL, (out.op(f"icmp ne i32 {text}, 0"),))
        if kind == INT:
            text = out.op(f"call i64 @PyLong_AsLongLong(ptr {given})")
            fine = out.op(f"icmp ne i64 {text}, -1")
        else:
            text = out.op(f"call double @PyFloat_AsDouble(ptr {given})")
            fine = out.op(f"fcmp une double {text}, {real(-1.0)}")
        ask, good = out.name("ask"), out.name("good")
        out.branch(fine, good, ask)
        out.begin(ask)
        out.branch(out.op(f"icmp eq ptr {out.op('call ptr @PyErr_Occurred()')}, null"), good, "fail")
        out.begin(good)
        return Value(kind, (text,))

    def _array(self, given: str, kind: Array, at: str) -> Value:
        out, ndarray = self.out, self._constants[CONSTANTS.index(np.ndarray)]
        message = f"argument {at} is not {described(kind)}, for which this was compiled"
        ask, good = out.name("ask"), out.name("good")
        of = self._load("ptr", given, TYPE)
        out.branch(out.op(f"icmp eq ptr {of}, {ndarray}"), good, ask)
        out.begin(ask)
        below = out.op(f"call i32 @PyType_IsSubtype(ptr {of}, ptr {ndarray})")
        self._check(out.op(f"icmp ne i32 {below}, 0"), message)
        out.jump(good)
        out.begin(good)
        description, needed = self._load("ptr", given, DESCRIPTION), ALIGNED | (IN_C_ORDER if kind.ordered else 0)
        flags = out.op(f"and i32 {self._load('i32', given, FLAGS)}, {needed}")
        tests = [
            out.op(f"icmp eq i32 {self._load('i32', given, NDIM)}, {kind.ndim}"),
            out.op(f"icmp eq i32 {self._load('i32', description, NUMBER)}, {_number_of(kind)}"),
            out.op(f"icmp ne i8 {self._load('i8', description, BYTE_ORDER)}, {ord('>')}"),
            out.op(f"icmp eq i32 {flags}, {needed}"),
        ]
        fine = tests[0]
        for one in tests[1:]:
            fine = out.op(f"and i1 {fine}, {one}")
        self._check(fine, message)
        parts = [self._load("ptr", given, DATA)]
        for at_, wanted in ((LENGTHS, True), (STRIDES, not kind.ordered)):
            if wanted and kind.ndim:
                table = self._load("ptr", given, at_)
                parts += [self._load("i64", table, 8 * d) for d in range(kind.ndim)]
        return Value(kind, tuple(parts))

    def _given(self, value: Value) -> str:
        """Python's object of a value."""
        out, kind = self.out, value.kind
        if kind in (NONE, BOOL):
            yes, no = (self._constants[i] for i in (2, 3))
            text = self._constants[1] if kind == NONE else out.op(f"select i1 {value.text}, ptr {yes}, ptr {no}")
            out.do(f"call void @Py_IncRef(ptr {text})")
            return text
        if kind == INT:
            return out.op(f"call ptr @PyLong_FromLongLong(i64 {value.text})")
        if kind in (REAL, SINGLE):
            return out.op(f"call ptr @PyFloat_FromDouble(double {out.convert(value, REAL).text})")
        if isinstance(kind, Tuple):
            row = out.op(f"call ptr @PyTuple_New(i64 {len(kind.items)})")
            for i, item in enumerate(value.items):
                out.op(f"call i32 @PyTuple_SetItem(ptr {row}, i64 {i}, ptr {self._given(item)})")
            return row
        raise KernelError(f"{self.shown} gives {kind} to Python: return numbers, and write arrays in place")


def _number_of(kind: Array) -> int:
    """Numpy's number of what an array holds."""
    letters = [letter for letter, entry in STORED.items() if entry == kind.entry]
    return np.dtype(letters[0]).num if letters else np.dtype(np.void).num


def described(kind: Array) -> str:
    """What an array has to be, in words."""
    letters = [letter for letter, entry in STORED.items() if entry == kind.entry]
    held = np.dtype(letters[0]).name if letters else "records"
    return f"an array of {held} of {kind.ndim} dimensions{' in C order' if kind.ordered else ''}"
