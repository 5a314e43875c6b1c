"""The kinematic program in compiled form: same program as `formulation`, on preallocated memory."""

from __future__ import annotations

from functools import partial

import numpy as np

from wholebody.backends.kinematic.kernels import placement
from wholebody.backends.kinematic.kernels import program as kernels
from wholebody.backends.kinematic.workspace import make_workspace
from wholebody.jit.entry import Entry
from wholebody.qp.compiled_program import CompiledBody
from wholebody.qp.kernels.active_set import SOLVED
from wholebody.qp.problem import QPSolution, Residuals
from wholebody.qp.program_inputs import BodyInputs, standing_shapes

_NONE = np.zeros(0)
_solve, _support = Entry(kernels.solve), Entry(placement.support)


class KinematicProgram(CompiledBody):
    """Builds and solves the program in one compiled call; ``tau`` holds the measured configuration.

    Attributes:
        v: Velocity of the last answer, shape (nv,).
        com: Centre of mass, shape (3,). J_com: Its Jacobian, shape (3, nv).
    """

    def __init__(self, inputs: BodyInputs) -> None:
        super().__init__(inputs, make_workspace(inputs), partial(standing_shapes, inputs), supported=True)
        tick = self.tick
        self.v, self.com, self.J_com = tick.dv, tick.com[:3], tick.J_com
        self._solve, self._support = _solve.native(tick), _support.native(tick)

    def compute(self, q: np.ndarray) -> bool:
        """Solve at a configuration (nq,) for the references in memory; whether the answer is accepted."""
        self.q[:] = q
        self.code = self._solve(self.tick)
        return self.code == SOLVED

    def support(self, q: np.ndarray) -> None:
        """Torques that hold a configuration (nq,) still, into ``tau``."""
        self.tick.q_measured[:] = q
        self._support(self.tick)

    def answer(self) -> QPSolution:
        """A copy of the last answer, with our judgement of it."""
        ok = self.code == SOLVED
        residuals = Residuals(*(self.residuals.tolist() if ok else [np.inf] * 3))
        return QPSolution(self.v.copy(), _NONE, self.dual.copy(), _NONE, residuals, ok, "compiled")
