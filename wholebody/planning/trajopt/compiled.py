"""Compile the arithmetic of the plan, which lies in several files, with numba."""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import cache
from importlib import import_module

from wholebody.jit import blas
from wholebody.jit.former import digest, native, register
from wholebody.planning.trajopt import layout as tables

CORES = (
    "fixed_feet_kinematics", "configuration_terms", "spline", "inverse_dynamics", "static_torque", "capture_point",
    "linearise", "proximity", "cost", "inequalities", "newton", "warm_start", "spline_offset", "centroidal",
)  # fmt: skip
"""Modules whose functions compile as they stand."""

OPTIONS = {"_nrt": False, "no_cfunc_wrapper": True}
"""Nothing is allocated, so nobody has to count references: that takes longer than most of what is done with a row."""


class Stages:
    """Native functions of the plan, made when first called; always called with the same kinds of arguments."""

    def __init__(self) -> None:
        self._made: dict[str, Callable] = {}

    def __call__(self, module: str, name: str, *arguments: object) -> object:
        """Call the function ``name`` of a module of this package."""
        key = f"{module}.{name}"
        stage = self._made.get(key)
        if stage is None:
            stage = self._made[key] = _stage(module, name, arguments)
        return stage(*arguments)


@cache
def _version() -> int:
    modules = [import_module(f"wholebody.planning.trajopt.kernels.{name}") for name in CORES]
    modules.append(import_module("wholebody.collision.gjk"))
    for module in modules:
        register(module, **OPTIONS)
    register(blas, _nrt=True)  # numba wants to count what it gives to BLAS
    return digest([sys.modules[__name__], tables, blas, *modules])


def _stage(module: str, name: str, arguments: tuple) -> Callable:
    from numba import typeof

    version = _version()
    function = getattr(import_module(f"wholebody.planning.trajopt.kernels.{module}"), name)
    return native(function, tuple(typeof(argument) for argument in arguments), version, **OPTIONS)


run = Stages()
