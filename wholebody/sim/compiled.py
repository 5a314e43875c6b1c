"""Compile the arithmetic of the plant with numba, on first use."""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import cache

from wholebody.jit.entry import digest, native
from wholebody.sim.kernels import motors as drive_core

OPTIONS = {"_nrt": False, "no_cfunc_wrapper": True}
"""Nothing is allocated, so nobody has to count references."""


@cache
def compiled_plant() -> tuple[Callable[..., None], Callable[..., None]]:
    """The compiled `drive_core.drive` and `drive_core.read`, by their native entries (`wholebody.jit.entry`)."""
    from numba import boolean, float64, int64, types

    version, vector = digest([sys.modules[__name__], drive_core]), float64[::1]
    two = types.UniTuple(vector, 2)
    drive = types.UniTuple(vector, 5), int64[:, ::1], vector, two, vector, vector, vector, boolean
    read = two, types.UniTuple(int64[::1], 2), vector, vector
    return (
        native(drive_core.drive, drive, version, **OPTIONS),
        native(drive_core.read, read, version, **OPTIONS),
    )
