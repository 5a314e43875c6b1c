"""The whole-body program in compiled form: same program as `wholebody.qp.formulation`, on preallocated memory.

`wholebody.qp.formulation`, the tasks and the limits stay the specification; tests hold the two equal.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from wholebody.errors import InputError
from wholebody.jit.entry import Entry
from wholebody.jit.packed import Packed
from wholebody.limits.base import Rows
from wholebody.qp.formulation import WholeBodySolution
from wholebody.qp.kernels import active_set, assemble, command, proximity, residuals, solve
from wholebody.qp.problem import QPSolution, Residuals, check_further
from wholebody.qp.program_inputs import BodyInputs, ProgramInputs, StandingShapes, stand
from wholebody.qp.workspace import BLOCK, make_workspace, shapes_of
from wholebody.robot.kernels.frames import PALM_FRAME
from wholebody.tasks.base import Objective

ENTRIES = tuple(
    Entry(kernel)
    for kernel in (
        assemble.move,
        proximity.near_pairs,
        assemble.assemble,
        solve.search,
        residuals.conclude,
        command.command,
    )
)
"""What a tick calls one after the other. One function around them would be optimised once more as a whole: seconds of
compiling for a few microseconds of calling."""

MEASURED = (
    "q_before", "room", "distance", "distance_bound", "measured", "simplex", "gjk_state", "known", "nearest", "n_pairs",
    "n_unsure", "pair_now", "pair_before", "floor_vertex",
)  # fmt: skip
"""Fields in which searches for distances begin where the last ones ended."""

_NONE = np.zeros(0)


class CompiledAnswer:
    """A copy of one answer; its parts are taken out of it when they are asked for.

    Args:
        row: The fields from ``dv`` to ``dual`` of `workspace`.
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


class CompiledBody:
    """What compiled programs have alike: memory that the controller reads and writes.

    Attributes:
        tick: The memory, by names; see `workspace`.
        q: Configuration of the last call, shape (nq,).
        tau: Joint torques in Pinocchio order, shape (n_joints,), [N m].
        dual: Multiplier of each row, positive at the upper side.
        reference: Where the references of the tasks are read, laid out as in `wholebody.control.reference_packet`.
        trust: Trust in the hands, shape (2,).
        palms: Where the palms are, from the origin of the base in world axes, shape (2, 3), [m].
        code: What the last call came to, one of the codes of `active_set`.

    All are views of memory that the next call overwrites.
    """

    def __init__(self, inputs: BodyInputs, tick: Packed, shapes: StandingShapes, *, supported: bool) -> None:
        self.inputs, self.tick, self._supported, self._shapes = inputs, tick, supported, shapes
        stand(inputs, tick, shapes)
        self.q, self.tau, self.dual, self.residuals = tick.q, tick.tau, tick.dual, tick.residuals
        self.reference, self.trust = tick.span("hand_ref", "posture_ref"), tick.trust
        self.palms = tick.frame_p[PALM_FRAME : PALM_FRAME + 2]
        self.code = active_set.SOLVED

    @property
    def active(self) -> int:
        """Number of rows in the working set."""
        return self.tick.n_working

    def reset(self) -> None:
        """Take over which feet stand, where, and the support; the working set is forgotten."""
        balance = self.inputs.balance
        tick, support = self.tick, balance.support if self._supported and balance.active else None
        tick.n_edges = 0 if support is None else len(support.offsets)
        if support is not None:
            tick.edges[: tick.n_edges] = np.column_stack([support.normals, support.offsets])
        stand(self.inputs, tick, self._shapes)


class CompiledProgram(CompiledBody):
    """Builds and solves the program in compiled calls.

    Attributes:
        v: Velocity of the last call, shape (nv,).
        dv: Accelerations of the last answer, shape (nv,).
        forces: Point forces in world axes, shape (n_points, 3), [N].
        desired: Joint positions and speeds of the integrated desired state, Pinocchio order, shape (2, n_joints).
    """

    inputs: ProgramInputs

    def __init__(self, inputs: ProgramInputs) -> None:
        super().__init__(inputs, make_workspace(inputs), partial(shapes_of, inputs), supported=inputs.safety)
        self.bound_loads()
        tick = self.tick
        self.v, self.dv, self.forces, self.desired = tick.v, tick.dv, tick.f.reshape(-1, 3), tick.desired
        self._answer = tick.span("dv", "dual")
        self._sizes = len(self.dv), self.forces.size, len(self.tau)
        self._first = {name: np.copy(getattr(tick, name)) for name in MEASURED}
        self._move, self._near_pairs, self._assemble, self._search, self._conclude, self._command = (
            entry.native(tick) for entry in ENTRIES
        )

    def reset(self) -> None:
        """Take over which feet stand, where, what each may carry, and the support; the working set is forgotten."""
        super().reset()
        self.bound_loads()

    def bound_loads(self) -> None:
        """Take over what each foot may carry."""
        for c, foot in enumerate(self.inputs.feet):
            self.tick.force_min[c], self.tick.force_max[c] = foot.load_bounds

    def forget(self) -> None:
        """Measure distances as at first: what is found does not depend on what was before, to the last bit."""
        for name, first in self._first.items():
            if first.ndim:
                getattr(self.tick, name)[:] = first
            else:
                setattr(self.tick, name, first.item())

    @property
    def iterations(self) -> int:
        """Changes of the working set in the last call."""
        return self.tick.iterations

    def set_extra(self, objectives: Sequence[Objective], limits: Sequence[Rows]) -> None:
        """Hand over what further tasks and limits ask for in the next call.

        Args:
            objectives: Any number of rows each.
            limits: Soft rows; they share the slack of the balance.

        Raises:
            InputError: If there are more rows than `ProgramInputs.extra_rows` has room for, or one is not finite.
        """
        tick, (task_room, limit_room) = self.tick, self.inputs.extra_rows
        n, slot = len(tick.frame_body), tick.n_balance - limit_room
        counts = sum(len(one.target) for one in objectives), sum(len(one.upper) for one in limits)
        if counts[0] > task_room or counts[1] > limit_room:
            raise InputError(
                f"further tasks have {counts[0]} rows and further limits {counts[1]}; there is room for "
                f"{task_room} and {limit_room}: see `EXTRA_ROWS`"
            )
        target, weight, upper = tick.target[n:].reshape(-1), tick.weight[n:].reshape(-1), tick.soft_upper[slot:]
        weight[:], upper[:limit_room], at = 0.0, np.inf, 0
        for one in objectives:
            check_further("task", one.J, one.target, one.weight)
            end = at + len(one.target)
            tick.J[BLOCK * n + at : BLOCK * n + end], target[at:end], weight[at:end] = one.J, one.target, one.weight
            at = end
        at = 0
        for one in limits:
            check_further(f"limit {', '.join(one.labels)}", one.J, one.upper)
            end = at + len(one.upper)
            tick.soft_J[slot + at : slot + end], upper[at:end] = one.J, one.upper
            at = end

    def compute(self, q: np.ndarray, v: np.ndarray, *, hands: bool = True) -> bool:
        """Solve at a state for the references in memory; whether the answer is accepted.

        Args:
            q: Configuration, shape (nq,).
            v: Velocity, shape (nv,).
            hands: Without hands also the joint bounds are wide: the arms give way.
        """
        tick = self.tick
        self.q[:], self.v[:], tick.hands = q, v, hands
        self._move(tick)
        if self.inputs.safety:
            self._find_pairs()
        self.code = self._assemble(tick)
        if self.code == active_set.SOLVED:
            self.code = self._search(tick)
        if self.code == active_set.SOLVED and self._conclude(tick):
            return True
        tick.n_working = 0
        return False

    def answer(self, *, ok: bool = True) -> CompiledAnswer:
        """A copy of the last answer."""
        return CompiledAnswer(self._answer.copy(), self._sizes, ok)

    def integrate(self) -> None:
        """Integrate the last answer into the desired state and the command."""
        self._command(self.tick)

    def solve(self, q: np.ndarray, v: np.ndarray, *, hands: bool = True) -> QPSolution:
        """`compute`, and the answer with our judgement of it."""
        ok = self.compute(q, v, hands=hands)
        if self.code != active_set.SOLVED:
            self.residuals[:] = np.inf
        return self.answer(ok=ok).qp()

    def conclude(self) -> bool:
        """Torques, multipliers and residuals of ``dv``, ``forces`` and the slacks as they stand; whether accepted."""
        return bool(self._conclude(self.tick))

    def _find_pairs(self) -> None:
        """Measure the near pairs at the placements that the last call computed."""
        while self._near_pairs(self.tick):
            # Bodies that touch have a depth, which only the slower algorithm finds.
            unsure = self.tick.unsure_pairs[: self.tick.n_unsure]
            self.inputs.self_collision.proximity.measure(self.q, unsure)
