"""Compile the flat-array arithmetic of this package with numba, on first use."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from types import ModuleType


@cache
def compiled(module: ModuleType, entry: str) -> Callable:
    """The function ``entry`` of ``module``, compiled; its callees are the other plain functions of the same module.

    numba takes a second to import, so nothing does it before a compiled function is asked for. Callees stay in the file
    of the entry: numba's cache on disk notices changes of that file only. No fastmath: the result is that of the
    interpreted function up to rounding.

    Args:
        module: Module whose functions compile as they stand.
        entry: Name of the function to return.
    """
    import numba
    from numba.extending import register_jitable

    for name, member in vars(module).items():
        if callable(member) and getattr(member, "__module__", None) == module.__name__ and name != entry:
            register_jitable(error_model="numpy")(member)
    return numba.njit(cache=True, error_model="numpy", nogil=True)(getattr(module, entry))
