"""LLVM: from text to machine code, and from machine code to functions that Python calls."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cache

import llvmlite
import llvmlite.binding as llvm
import numpy as np

from wholebody.jit.compiler.border import CONSTANTS, DATA, DESCRIPTION, FLAGS, NDIM, TYPE
from wholebody.jit.compiler.kinds import KernelError

OPTIMISATION = 3
"""LLVM's level for what is compiled."""
FASTCALL = 0x80
"""``METH_FASTCALL`` of CPython: arguments come as an array and their number."""

_kept: list[object] = []
"""What compiled functions need as long as the process lives."""


class _Method(ctypes.Structure):
    """``PyMethodDef`` of CPython."""

    _fields_ = (("name", ctypes.c_char_p), ("call", ctypes.c_void_p), ("flags", ctypes.c_int), ("doc", ctypes.c_char_p))


@cache
def host() -> str:
    """The processor, and the version of LLVM: machine code serves these alone."""
    features = llvm.get_host_cpu_features().flatten()
    return f"{llvmlite.__version__} {llvm.get_process_triple()} {llvm.get_host_cpu_name()} {features}"


@cache
def _target() -> llvm.TargetMachine:
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    target = llvm.Target.from_triple(llvm.get_process_triple())
    return target.create_target_machine(
        cpu=llvm.get_host_cpu_name(), features=llvm.get_host_cpu_features().flatten(), opt=OPTIMISATION,
        reloc="default", codemodel="jitdefault", jit=True,
    )  # fmt: skip


@cache
def _engine() -> llvm.ExecutionEngine:
    return llvm.create_mcjit_compiler(llvm.parse_assembly(""), _target())


def object_of(text: str) -> bytes:
    """Machine code of a module of LLVM's language."""
    target = _target()
    module = llvm.parse_assembly(text)
    module.triple, module.data_layout = llvm.get_process_triple(), str(target.target_data)
    options = llvm.create_pipeline_tuning_options(speed_level=OPTIMISATION)
    options.loop_vectorization = options.slp_vectorization = True
    builder = llvm.create_pass_builder(target, options)
    builder.getModulePassManager().run(module, builder)
    return target.emit_object(module)


def function_of(code: bytes, symbol: str, shown: str) -> Callable:
    """The function of a name in machine code, as one of Python.

    Raises:
        KernelError: If this Python keeps its objects in another way than compiled code reads them.
    """
    _require_layout()
    engine = _engine()
    engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    method = _Method(shown.encode(), engine.get_function_address(symbol), FASTCALL, None)
    _kept.append(method)
    make = ctypes.pythonapi.PyCFunction_NewEx
    make.restype, make.argtypes = ctypes.py_object, (ctypes.c_void_p, ctypes.py_object, ctypes.c_void_p)
    return make(ctypes.addressof(method), _constants(), None)


@cache
def _require_layout() -> None:
    probe = np.zeros((2, 3))
    words = {TYPE: id(np.ndarray), DATA: probe.ctypes.data, DESCRIPTION: id(probe.dtype)}
    small = {NDIM: probe.ndim, FLAGS: probe.flags.num}
    fine = all(ctypes.c_uint64.from_address(id(probe) + at).value == value for at, value in words.items())
    if not (fine and all(ctypes.c_int32.from_address(id(probe) + at).value == value for at, value in small.items())):
        raise KernelError(
            "this Python keeps arrays in another way than compiled kernels read them; use CPython 3.12 or 3.13 of 64 "
            "bits, not its free-threaded build"
        )


@cache
def _constants() -> np.ndarray:
    return np.array([id(one) for one in CONSTANTS], dtype=np.uint64)
