"""The kinematic program in compiled form: same program as `formulation`, on preallocated memory."""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import cache
from importlib import import_module

import numpy as np

from wholebody.backends.kinematic.kernels import placement
from wholebody.backends.kinematic.kernels import program as core
from wholebody.backends.kinematic.workspace import KinematicInputs, make_memory
from wholebody.jit.former import digest, native
from wholebody.qp.compiled import CORES, OPTIONS, memories, register_cores
from wholebody.qp.kernels import blocks as b
from wholebody.qp.problem import QPSolution, Residuals

_NONE = np.zeros(0)


class KinematicProgram:
    """Builds and solves the program in one compiled call.

    Attributes:
        v: Velocity of the last answer, shape (nv,).
        tau: Joint torques that hold the measured configuration, shape (n_joints,), [N m].
        dual: Multiplier of each row, positive at the upper side: speeds of the joints, edges of the support.
        reference: Where the references of the tasks are read, laid out as in `wholebody.control.reference_packet`.
        share: Trust in the hands, shape (2,).
        palms: Palm points from the origin of the base, shape (2, 3), [m].
        com: Centre of mass, shape (3,). J_com: Its Jacobian, shape (3, nv).
        code: What the last call came to, one of `blocks`.

    All are views of memory that the next call overwrites.
    """

    def __init__(self, parts: KinematicInputs) -> None:
        self.parts, n = parts, len(parts.feet)
        self._reals, self._ints = make_memory(parts)
        reals = self._reals
        self.v, self.tau, self.dual, self.residuals = reals[b.DV], reals[b.TAU_OUT], reals[b.DUAL], reals[b.RESIDUALS]
        self.q, self.measured, self.counts = reals[b.Q_], reals[b.DESIRED], self._ints[b.COUNTS]
        self.reference, self.share = reals.span(b.HAND_REF, b.POSTURE_REF), reals[b.SHARE]
        self.palms, self.com, self.J_com = reals[b.FP_][n : n + 2], reals[b.CENTRE_NOW][:3], reals[b.JS_]
        self.code = b.SOLVED
        self._call = ((reals.memory, reals.table), (self._ints.memory, self._ints.table))
        self._solve, self._support = compiled_stages()

    @property
    def active(self) -> int:
        """Number of rows in the working set."""
        return int(self.counts[b.N_WORKING])

    def reset(self) -> None:
        """Take over where the feet and the support are; the working set is forgotten."""
        support, edges = self.parts.balance.support, self._reals[b.EDGES]
        edges[: len(support.offsets)] = np.column_stack([support.normals, support.offsets])
        for row, foot in zip(self._reals[b.FOOT_REF], self.parts.feet, strict=True):
            row[:9], row[9:] = foot.T_world_ref.rotation.ravel(), foot.T_world_ref.translation
        self.counts[b.N_EDGES], self.counts[b.N_WORKING] = len(support.offsets), 0

    def compute(self, q: np.ndarray) -> bool:
        """Solve at a configuration (nq,) for the references in memory; whether the answer is accepted."""
        self.q[:] = q
        self.code = self._solve(*self._call)
        return self.code == b.SOLVED

    def support(self, q: np.ndarray) -> None:
        """Torques that hold a configuration (nq,) still, into ``tau``."""
        self.measured[:] = q
        self._support(*self._call)

    def answer(self) -> QPSolution:
        """A copy of the last answer, with our judgement of it."""
        ok = self.code == b.SOLVED
        residuals = Residuals(*(self.residuals.tolist() if ok else [np.inf] * 3))
        return QPSolution(self.v.copy(), _NONE, self.dual.copy(), _NONE, residuals, ok, "compiled")


@cache
def compiled_stages() -> tuple[Callable, ...]:
    """`core.solve` and `placement.support`, compiled or loaded from numba's cache; arguments are ``reals, ints``."""
    register_cores(placement, core)
    modules = [sys.modules[__name__], placement, core, *(import_module(name) for name in CORES)]
    version = digest(modules)
    return tuple(native(stage, memories(), version, **OPTIONS) for stage in (core.solve, placement.support))
