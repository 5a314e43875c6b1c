"""The kinematic program in compiled form: same program as `formulation`, on preallocated memory."""

from __future__ import annotations

import numpy as np

from wholebody.backends.kinematic.kernels import placement
from wholebody.backends.kinematic.kernels import program as kernels
from wholebody.backends.kinematic.workspace import make_workspace
from wholebody.jit.entry import Entry
from wholebody.qp.kernels.active_set import SOLVED
from wholebody.qp.problem import QPSolution, Residuals
from wholebody.qp.program_inputs import BodyInputs, place_feet

_NONE = np.zeros(0)
_solve, _support = Entry(kernels.solve), Entry(placement.support)


class KinematicProgram:
    """Builds and solves the program in one compiled call.

    Attributes:
        tick: The memory, by names; see `workspace`.
        v: Velocity of the last answer, shape (nv,).
        tau: Joint torques that hold the measured configuration, shape (n_joints,), [N m].
        dual: Multiplier of each row, positive at the upper side: speeds of the joints, edges of the support.
        reference: Where the references of the tasks are read, laid out as in `wholebody.control.reference_packet`.
        trust: Trust in the hands, shape (2,).
        palms: Palm points from the origin of the base, shape (2, 3), [m].
        com: Centre of mass, shape (3,). J_com: Its Jacobian, shape (3, nv).
        code: What the last call came to, one of the codes of `active_set`.

    All are views of memory that the next call overwrites.
    """

    def __init__(self, inputs: BodyInputs) -> None:
        self.inputs, n = inputs, len(inputs.feet)
        self.tick = tick = make_workspace(inputs)
        self.v, self.tau, self.dual, self.residuals, self.q = tick.dv, tick.tau, tick.dual, tick.residuals, tick.q
        self.reference, self.trust = tick.span("hand_ref", "posture_ref"), tick.trust
        self.palms, self.com, self.J_com = tick.frame_p[n : n + 2], tick.com[:3], tick.J_com
        self.code = SOLVED
        self._solve, self._support = _solve.native(tick), _support.native(tick)

    @property
    def active(self) -> int:
        """Number of rows in the working set."""
        return self.tick.n_working

    def reset(self) -> None:
        """Take over where the feet and the support are; the working set is forgotten."""
        support, tick = self.inputs.balance.support, self.tick
        tick.n_edges, tick.n_working = len(support.offsets), 0
        tick.edges[: tick.n_edges] = np.column_stack([support.normals, support.offsets])
        place_feet(self.inputs, tick)

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
