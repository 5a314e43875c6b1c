"""Compile the arithmetic of the plant with numba, on first use."""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import cache

from wholebody.jit.former import digest, native
from wholebody.sim.kernels import motors

OPTIONS = {"_nrt": False, "no_cfunc_wrapper": True}
"""Nothing is allocated, so nobody has to count references."""


@cache
def compiled_plant() -> tuple[Callable[..., None], Callable[..., None]]:
    """The compiled `motors.drive` and `motors.read`, by their native entries (`wholebody.jit.entry`)."""
    from numba import boolean, float64, int64, types

    version, vector = digest([sys.modules[__name__], motors]), float64[::1]
    two = types.UniTuple(vector, 2)
    drive = types.UniTuple(vector, 5), int64[:, ::1], vector, two, vector, vector, vector, boolean
    read = two, types.UniTuple(int64[::1], 2), vector, vector
    return (
        native(motors.drive, drive, version, **OPTIONS),
        native(motors.read, read, version, **OPTIONS),
    )
