"""The whole-body program in compiled form: same program as `wholebody.qp.formulation`, on preallocated memory.

`wholebody.qp.formulation`, the tasks and the limits stay the specification; tests hold the two equal.
"""

from __future__ import annotations

import numpy as np

from wholebody.qp.compiled import compiled_stages
from wholebody.qp.formulation import WholeBodySolution
from wholebody.qp.kernels import blocks as b
from wholebody.qp.problem import QPSolution, Residuals
from wholebody.qp.workspace import ProgramInputs, make_memory

_NONE = np.zeros(0)


class CompiledAnswer:
    """A copy of one answer; its parts are taken out of it when they are asked for.

    Args:
        row: The blocks from DV to DUAL of `blocks`.
        sizes: Sizes of accelerations, forces and joints.
        ok: Whether its residuals were accepted.
    """

    __slots__ = ("_row", "_sizes", "ok")

    def __init__(self, row: np.ndarray, sizes: tuple[int, int, int], ok: bool) -> None:
        self._row, self._sizes, self.ok = row, sizes, ok

    def solution(self) -> WholeBodySolution:
        """Accelerations, forces, torques and slacks."""
        nv, nf, _ = self._sizes
        row, end = self._row, nv + nf + 2
        return WholeBodySolution(row[:nv], row[nv : nv + nf].reshape(-1, 3), self.torques(), row[end - 2 : end])

    def torques(self) -> np.ndarray:
        """Joint torques in Pinocchio order, (n_joints,)."""
        nv, nf, nj = self._sizes
        return self._row[nv + nf + 2 : nv + nf + 2 + nj]

    def qp(self) -> QPSolution:
        """The answer in the variables of `formulation`, with multipliers in the order of `constraints`."""
        nv, nf, nj = self._sizes
        end = nv + nf + 2
        at = end + 4 * nj + 9
        residuals = Residuals(*self._row[at - 3 : at].tolist())
        return QPSolution(self._row[:end], _NONE, self._row[at:], _NONE, residuals, self.ok, "compiled")

    def centre(self) -> tuple[np.ndarray, np.ndarray]:
        """Centre of mass and its velocity, (3,) each."""
        nv, nf, nj = self._sizes
        at = nv + nf + 2 + nj
        return self._row[at : at + 3], self._row[at + 3 : at + 6]

    def command(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Positions, speeds and torques in motor order, (n_joints,) each, as `CompiledProgram.integrate` left them."""
        nv, nf, nj = self._sizes
        at = nv + nf + 8 + nj
        return self._row[at : at + nj], self._row[at + nj : at + 2 * nj], self._row[at + 2 * nj : at + 3 * nj]


class CompiledProgram:
    """Builds and solves the program in compiled calls.

    Attributes:
        dv: Accelerations of the last answer, shape (nv,).
        forces: Point forces in world axes, shape (n_points, 3), [N].
        tau: Joint torques in Pinocchio order, shape (n_joints,), [N m].
        slack: Of the balance and of the collision rows, shape (2,).
        dual: Multiplier of each row in the order of `constraints`, positive at the upper side.
        desired: Joint positions and speeds of the integrated desired state, Pinocchio order, shape (2, n_joints).
        reference: Where the references of the tasks are read, laid out as in `wholebody.control.reference_packet`.
        share: Trust in the hands, shape (2,).
        palms: Where the palms are, from the origin of the base in world axes, shape (2, 3), [m].
        code: What the last call came to, one of `blocks`.

    All are views of memory that the next call overwrites.
    """

    def __init__(self, parts: ProgramInputs) -> None:
        self.parts = parts
        self._reals, self._ints = make_memory(parts)
        reals = self._reals
        self.dv, self.forces, self.tau, self.slack = (
            reals[b.DV], reals[b.FORCE].reshape(-1, 3), reals[b.TAU_OUT], reals[b.SLACK]
        )  # fmt: skip
        self.dual, self.residuals, self.desired = reals[b.DUAL], reals[b.RESIDUALS], reals[b.DESIRED]
        self.q, self.v, self.counts = reals[b.Q_], reals[b.V_], self._ints[b.COUNTS]
        self.reference, self.share = reals.span(b.HAND_REF, b.POSTURE_REF), reals[b.SHARE]
        n = len(parts.feet)
        self.palms, self._base = reals[b.FP_][n : n + 2], reals[b.Q_][:3]
        self._answer = reals.span(b.DV, b.DUAL)
        self._sizes = len(self.dv), self.forces.size, len(self.tau)
        self.code = b.SOLVED
        self._call = ((reals.memory, reals.table), (self._ints.memory, self._ints.table))
        self._move, self._nearest, self._assemble, self._search, self._conclude, self._command = compiled_stages()

    @property
    def iterations(self) -> int:
        """Changes of the working set in the last call."""
        return int(self.counts[b.ITERATIONS])

    @property
    def active(self) -> int:
        """Number of rows in the working set."""
        return int(self.counts[b.N_WORKING])

    def palms_in_world(self) -> np.ndarray:
        """Where the palms were in the last call, shape (2, 3), [m]."""
        return self.palms + self._base

    def reset(self) -> None:
        """Take over where the feet and the support are; the working set is forgotten."""
        support, reals = self.parts.balance.support if self.parts.safety else None, self._reals
        edges = 0 if support is None else len(support.offsets)
        if edges:
            reals[b.EDGES][:edges] = np.column_stack([support.normals, support.offsets])
        for row, foot in zip(reals[b.FOOT_REF], self.parts.feet, strict=True):
            if foot.T_world_ref is not None:
                row[:9], row[9:] = foot.T_world_ref.rotation.ravel(), foot.T_world_ref.translation
        self.counts[b.N_EDGES], self.counts[b.N_WORKING] = edges, 0

    def compute(self, q: np.ndarray, v: np.ndarray, *, hands: bool = True) -> bool:
        """Solve at a state for the references in memory; whether the answer is accepted.

        Args:
            q: Configuration, shape (nq,).
            v: Velocity, shape (nv,).
            hands: Without hands also the joint bounds are wide: the arms give way.
        """
        self.q[:], self.v[:], self.counts[b.HANDS] = q, v, hands
        reals, ints = self._call
        self._move(reals, ints)
        if self.parts.safety:
            self._find_pairs()
        self.code = self._assemble(reals, ints)
        if self.code == b.SOLVED:
            self.code = self._search(reals, ints)
        if self.code == b.SOLVED and self._conclude(reals, ints):
            return True
        self.counts[b.N_WORKING] = 0
        return False

    def answer(self, *, ok: bool = True) -> CompiledAnswer:
        """A copy of the last answer."""
        return CompiledAnswer(self._answer.copy(), self._sizes, ok)

    def integrate(self) -> None:
        """Integrate the last answer into the desired state and the command."""
        self._command(*self._call)

    def solve(self, q: np.ndarray, v: np.ndarray, *, hands: bool = True) -> QPSolution:
        """`compute`, and the answer with our judgement of it."""
        ok = self.compute(q, v, hands=hands)
        if self.code != b.SOLVED:
            self.residuals[:] = np.inf
        return self.answer(ok=ok).qp()

    def conclude(self) -> bool:
        """Torques, multipliers and residuals of ``dv``, ``forces`` and ``slack`` as they stand; whether accepted."""
        return bool(self._conclude(*self._call))

    def _find_pairs(self) -> None:
        """Measure the near pairs at the placements that the last call computed."""
        while self._nearest(*self._call):
            # Bodies that touch have a depth, which only the slower algorithm finds.
            unsure = self._ints[b.UNSURE_PAIRS][: self.counts[b.N_UNSURE]]
            self.parts.self_collision.proximity.measure(self.q, unsure)
