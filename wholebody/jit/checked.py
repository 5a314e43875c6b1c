"""Comparison of a kernel's arguments with those that it was compiled for: slower, and so on request.

Its native entry looks at arrays, not at the fields of packed memory nor at whole numbers where it has read truth
values. What Python calls has converted its arguments by then; this is how the tests know.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from inspect import signature
from numbers import Integral, Real

import numpy as np

from wholebody.jit.packed import Packed

SWITCH = "WHOLEBODY_CHECK_ENTRIES"
"""Environment variable that asks for the comparison, with anything in it; processes that are started inherit it."""
BOUNDS = "WHOLEBODY_CHECK_BOUNDS"
"""Variable of the environment that asks for checks of indices: kernels are compiled so that one outside of its array
aborts the process."""

CLOSELY, RARELY = 1000, 16
"""First calls of a kernel that are all compared, and of how many later ones one is. Chosen: a tick of the controller
has some dozens of calls, and compared each time they make the tests a fifth slower."""


def is_asked_for(switch: str = SWITCH) -> bool:
    """Whether the environment asks for the comparison, or what another switch stands for."""
    return bool(os.environ.get(switch))


def checked(function: Callable, native: Callable, first: tuple) -> Callable:
    """The native entry of a function behind a comparison with the arguments of its first call.

    The first `CLOSELY` calls are compared, and one in `RARELY` of those after.

    Raises:
        TypeError: By the callable: if an argument has another dtype, number of dimensions, memory order or length (of a
            tuple) than in the first call. Reals may be given as whole numbers, which are converted.
    """
    names, kinds = tuple(signature(function).parameters), tuple(map(_kind, first))
    before: tuple[tuple, list] | None = None
    calls = 0

    def call(*arguments: object) -> object:
        nonlocal before, calls
        calls += 1
        if calls > CLOSELY and calls % RARELY:
            return native(*arguments)
        if before is not None and _alike(arguments, *before):
            before = arguments, before[1]
            return native(*arguments)
        if len(arguments) != len(kinds):
            raise TypeError(f"{function.__qualname__} takes {len(kinds)} arguments, not {len(arguments)}")
        for name, kind, argument in zip(names, kinds, arguments, strict=True):
            given = _kind(argument)
            if not _fits(kind, given):
                raise TypeError(
                    f"{function.__module__}.{function.__qualname__} was compiled for {name} = {kind}, not {given}: "
                    "convert it before the call"
                )
        before = arguments, [_mark(argument) for argument in arguments]
        return native(*arguments)

    return call


def _alike(arguments: tuple, known: tuple, marks: list) -> bool:
    """Whether arguments are those that fitted, or of the same kinds: most calls are, and this is the quicker look."""
    if len(arguments) != len(known):
        return False
    for argument, one, mark in zip(arguments, known, marks, strict=True):
        if argument is not one and mark is not type(argument) and _mark(argument) != mark:
            return False
    return True


def _mark(argument: object) -> object:
    """What is the same only for arguments of the same kind; a type where that says all."""
    if isinstance(argument, np.ndarray):
        return argument.dtype, argument.ndim, argument.flags.num
    if isinstance(argument, Packed):
        return argument.fields
    if isinstance(argument, tuple):
        return type(argument), *map(_mark, argument)
    return type(argument)


def _kind(argument: object) -> object:
    """What compiled code depends on in an argument, comparable."""
    if isinstance(argument, np.ndarray):
        flags = argument.flags
        order = "C" if flags.c_contiguous else "F" if flags.f_contiguous else "any order"
        return "array", argument.dtype, argument.ndim, order, flags.aligned
    if isinstance(argument, Packed):
        return argument.fields
    if isinstance(argument, tuple):
        return type(argument), *map(_kind, argument)
    for kind in (bool, np.bool_, Integral, Real):
        if isinstance(argument, kind):
            return kind
    return type(argument)


def _fits(kind: object, given: object) -> bool:
    if kind == given or (kind is Real and given is Integral):
        return True
    if not (isinstance(kind, tuple) and isinstance(given, tuple) and len(kind) == len(given)):
        return False
    if kind[:1] == ("array",):
        return kind[:3] == given[:3] and kind[3] == "any order" and kind[4] <= given[4]
    return all(map(_fits, kind, given))
