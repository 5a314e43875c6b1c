"""Strategy: every function among kernels, or that an `Entry` of any module reaches, is asked for its signature: what it
takes and answers is named by types that exist."""

import inspect
import pkgutil
from collections.abc import Callable
from importlib import import_module
from types import FunctionType
from typing import get_args, get_type_hints

import numpy as np
import pytest

import wholebody
from wholebody.jit.entry import Entry, kernels_of
from wholebody.jit.packed import Packed

TAKEN = (bool, int, float, np.ndarray, np.record, Packed, Callable, type(None))
"""What a kernel takes, beside tuples of it, with names or without."""


def modules():
    """Every module of the library."""
    names = [one.name for one in pkgutil.walk_packages(wholebody.__path__, "wholebody.")]
    return [import_module(name) for name in names if not name.endswith("__main__")]


def kernels():
    """All kernels, each once: functions of modules in folders of that name, and what entries call."""
    found = {}
    for module in modules():
        for value in vars(module).values():
            entries = [one for one in (value if isinstance(value, tuple) else (value,)) if isinstance(one, Entry)]
            found |= dict.fromkeys(kernel for entry in entries for kernel in kernels_of(entry.function))
            if ".kernels." in module.__name__ and isinstance(value, FunctionType):
                found |= {value: None} if value.__module__ == module.__name__ else {}
    return list(found)


KERNELS = kernels()


def is_taken(hint):
    """Whether kernels take what an annotation names."""
    if hint in TAKEN:
        return True
    items = get_args(hint) or getattr(hint, "__annotations__", ())
    return bool(items)


def test_the_kernels_are_found():
    assert len(KERNELS) > 300


@pytest.mark.parametrize("kernel", KERNELS, ids=lambda kernel: f"{kernel.__module__}.{kernel.__name__}")
def test_what_a_kernel_takes_and_answers_is_annotated(kernel):
    signature, hints = inspect.signature(kernel), get_type_hints(kernel)
    assert set(hints) == {*signature.parameters, "return"}
    assert [name for name in signature.parameters if not is_taken(hints[name])] == []
