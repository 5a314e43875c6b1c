"""The whole-body program in compiled form: same program as `wholebody.qp.formulation`, on preallocated memory.

`wholebody.qp.formulation`, the tasks and the limits stay the specification; tests hold the two equal.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from wholebody.contacts.foot import FootContact
from wholebody.errors import InputError
from wholebody.limits.balance import BalanceLimit
from wholebody.limits.body import HeightLimit, OrientationLimit
from wholebody.limits.self_collision import SelfCollisionLimit
from wholebody.qp import blocks_core as b
from wholebody.qp.arena import Arena
from wholebody.qp.compiled import compiled_stages
from wholebody.qp.dynamics import body_table
from wholebody.qp.formulation import Regularisation, WholeBodySolution
from wholebody.qp.nearest import Blocks, near_shapes, near_tables
from wholebody.qp.problem import QPSolution, Residuals
from wholebody.robot import Robot
from wholebody.tasks.com import ComTask
from wholebody.tasks.hand import HandTask
from wholebody.tasks.height import HeightTask
from wholebody.tasks.momentum import AngularMomentumTask
from wholebody.tasks.orientation import OrientationTask
from wholebody.tasks.posture import PostureTask

ITERATION_LIMIT = 200
"""Changes of the working set after which the readable program is asked: a dual method can cycle."""
TOLERANCE = 1e-9
"""Violation from which a row enters the working set [m/s^2, rad/s^2, N, N m]."""
TORQUE_SIZE = 0.1
"""See `_sizes`."""
PRIMAL_ACCEPTED, DUAL_ACCEPTED = 1e-6, 1e-6
"""Largest accepted residuals, an order below those of the other solvers."""

_NONE = np.zeros(0)


@dataclass(frozen=True, kw_only=True)
class Parts:
    """What the program is made of: the readable tasks and limits, whose numbers are copied.

    Attributes:
        robot: The robot.
        feet: Contacts, all with the same number of points, friction and force bounds.
        palms: Tasks of the hands.
        pelvis, torso, height, com, momentum, posture: The other tasks.
        balance, pelvis_limit, torso_limit, height_limit, self_collision: The soft limits.
        safety: Whether the soft limits have rows.
        prices: Of accelerations, forces and slacks.
        joints: Rows ``q_min q_max dq_max ddq_max brake``, Pinocchio order, shape (5, n_joints).
        horizon: Over which joint bounds are kept viable [s].
        dt: Control period [s].
        leak: Share of its difference from the measured state that the desired one loses in a period.
        tau_max: Effort limits, shape (n_joints,), [N m].
        torque_share: Share of them that the program may plan with.
    """

    robot: Robot
    feet: Sequence[FootContact]
    palms: Sequence[HandTask]
    pelvis: OrientationTask
    torso: OrientationTask
    height: HeightTask
    com: ComTask
    momentum: AngularMomentumTask
    posture: PostureTask
    balance: BalanceLimit
    pelvis_limit: OrientationLimit
    torso_limit: OrientationLimit
    height_limit: HeightLimit
    self_collision: SelfCollisionLimit
    safety: bool
    prices: Regularisation
    joints: np.ndarray
    horizon: float
    dt: float
    leak: float
    tau_max: np.ndarray
    torque_share: float


class CompiledProgram:
    """Builds and solves the program in one compiled call.

    Attributes:
        dv: Accelerations of the last answer, shape (nv,).
        forces: Point forces in world axes, shape (n_points, 3), [N].
        tau: Joint torques in Pinocchio order, shape (n_joints,), [N m].
        slack: Of the balance and of the collision rows, shape (2,).
        dual: Multiplier of each row in the order of `rows_core`, positive at the upper side.
        desired: Joint positions and speeds of the integrated desired state, Pinocchio order, shape (2, n_joints).
        com, com_velocity: Of the state of the last call, shape (3,) each.
        code: What the last call came to, one of `blocks_core`.

    All are views of memory that the next call overwrites.
    """

    def __init__(self, parts: Parts) -> None:
        self.parts = parts
        tables = near_tables(parts.robot.spec, parts.self_collision.proximity) if parts.safety else ({}, {})
        self._reals, self._ints = _arenas(parts, *tables)
        self._fill()
        for arena, blocks in zip((self._reals, self._ints), tables, strict=True):
            for block, values in blocks.items():
                arena[block][:] = values
        reals = self._reals
        self.dv, self.forces, self.tau, self.slack = (
            reals[b.DV], reals[b.FORCE].reshape(-1, 3), reals[b.TAU_OUT], reals[b.SLACK]
        )  # fmt: skip
        self.desired, self._motors = reals[b.DESIRED], reals[b.COMMAND]
        self.dual, self.residuals = reals[b.DUAL], reals[b.RESIDUALS]
        self.com, self.com_velocity = reals[b.SUMS_][:3], reals[b.SUMS_][3:6]
        self.q, self.v, self.counts = reals[b.Q_], reals[b.V_], self._ints[b.COUNTS]
        self._parts = (self.dv, reals[b.FORCE], self.slack)
        self.code = b.SOLVED
        self._reference = reals.span(b.HAND_REF, b.POSTURE_REF)
        self._call = ((reals.memory, reals.table), (self._ints.memory, self._ints.table))
        self._move, self._nearest, self._assemble, self._search, self._conclude, self._command = compiled_stages()

    @property
    def iterations(self) -> int:
        """Changes of the working set in the last call."""
        return int(self.counts[b.ITERATIONS])

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

    def load_reference(self) -> None:
        """Copy the references of the tasks."""
        p = self.parts
        left, right = p.palms
        scalars = (left.share, right.share)
        height = (p.height.z_ref, p.height.dz_ref, p.height.ddz_ref)
        # One call for all: each assignment to a slice would take as long as all of the copying.
        np.concatenate(
            (
                *_palm(left), *_palm(right), scalars,
                p.com.position_ref, p.com.velocity_ref, p.com.acceleration_ref, p.momentum.momentum_ref,
                p.momentum.rate_ref,
                p.pelvis.R_world_ref.reshape(9), p.pelvis.rate_ref, p.pelvis.acceleration_ref,
                p.torso.R_world_ref.reshape(9), p.torso.rate_ref, p.torso.acceleration_ref, height,
                p.posture.q_ref, p.posture.dq_ref, p.posture.ddq_ref,
            ),
            out=self._reference,
        )  # fmt: skip

    def find_pairs(self) -> None:
        """Measure the near pairs at the placements that the last call computed."""
        if not self.parts.safety:
            return
        while self._nearest(*self._call):
            # Bodies that touch have a depth, which only the slower algorithm finds.
            unsure = self._ints[b.UNSURE_PAIRS][: self.counts[b.N_UNSURE]]
            self.parts.self_collision.proximity.measure(self.q, unsure)

    def solve(self, q: np.ndarray, v: np.ndarray, *, hands: bool = True) -> QPSolution:
        """Solve at a state; references are those loaded last.

        Args:
            q: Configuration, shape (nq,).
            v: Velocity, shape (nv,).
            hands: Without hands also the joint bounds are wide: the arms give way.

        Returns:
            The answer, judged: variables in the order of `formulation`, multipliers in that of `rows_core`.
        """
        self.q[:], self.v[:] = q, v
        self.counts[b.HANDS] = hands
        call = self._call
        self._move(*call)
        self.find_pairs()
        self.code = self._assemble(*call)
        if self.code == b.SOLVED:
            self.code = self._search(*call)
        if self.code == b.SOLVED:
            self.conclude()
        residuals = self.judged()
        ok = residuals.within(PRIMAL_ACCEPTED, DUAL_ACCEPTED)
        if not ok:
            self.counts[b.N_WORKING] = 0
        return QPSolution(np.concatenate(self._parts), _NONE, self.dual.copy(), _NONE, residuals, ok, "compiled")

    def conclude(self) -> None:
        """Torques, multipliers and residuals of ``dv``, ``forces`` and ``slack`` as they stand."""
        self._conclude(*self._call)

    def judged(self) -> Residuals:
        """Residuals of the last answer, infinite if there is none."""
        return Residuals(*self.residuals.tolist()) if self.code == b.SOLVED else Residuals(np.inf, np.inf, np.inf)

    def command(self) -> np.ndarray:
        """Integrate the last answer; positions, speeds and torques in motor order, shape (3, n_joints)."""
        self._command(*self._call)
        return self._motors.copy()

    def read(self, answer: QPSolution) -> WholeBodySolution:
        """The parts of the last answer."""
        nv, n = len(self.dv), len(answer.x)
        return WholeBodySolution(answer.x[:nv], answer.x[nv : n - 2].reshape(-1, 3), self.tau.copy(), answer.x[n - 2 :])

    def _fill(self) -> None:
        """Write everything that does not change."""
        p, reals = self.parts, self._reals
        model, limit = p.robot.model, p.self_collision
        reals[b.TABLE][:], self._ints[b.PARENT][:] = body_table(model)
        reals[b.ARMATURE][:], reals[b.GRAVITY][:] = model.armature, model.gravity.linear
        for row, frame in zip(reals[b.FRAME_TABLE], _frames(p), strict=True):
            placement = model.frames[p.robot.frame_id(frame)].placement
            row[:9], row[9:] = placement.rotation.ravel(), placement.translation
        self._ints[b.FRAME_BODY][:] = _bodies(p)
        reals[b.LOCAL_POINTS][:] = np.vstack([foot.points for foot in p.feet])
        reals[b.JOINTS][:], reals[b.TAU_FULL][:] = p.joints, p.tau_max
        reals[b.TAU_MAX][:] = p.torque_share * p.tau_max
        reals[b.POSTURE_GAIN][:] = p.posture.kp, p.posture.kd, p.posture.weight
        hand = p.palms[0]
        reals[b.HAND_GAIN][:] = hand.kp, hand.kd, *hand.pull, hand.weight[0], hand.weight[3]
        reals[b.COM_GAIN][:] = p.com.kp, p.com.kd, p.com.pull, *p.com.weight
        reals[b.MOMENTUM_GAIN][:] = p.momentum.kd, p.momentum.weight[0]
        for block, task in ((b.PELVIS_GAIN, p.pelvis), (b.TORSO_GAIN, p.torso), (b.HEIGHT_GAIN, p.height)):
            reals[block][:] = task.kp, task.kd, task.pull, task.weight[0]
        foot = p.feet[0]
        face = -foot.cone_rows[0, 2]
        reals[b.CONTACT][:] = foot.kp, foot.kd, face, foot.force_min, foot.force_max
        reals[b.BALANCE][:] = p.balance.margin, p.balance.gain
        for block, bound in ((b.PELVIS_LIMIT, p.pelvis_limit), (b.TORSO_LIMIT, p.torso_limit)):
            reals[block][:] = bound.angle_max, bound.rate_max, bound.brake, bound.dt
        band = p.height_limit
        reals[b.HEIGHT_LIMIT][:] = band.band, band.lowest, band.brake, band.dt
        reals[b.COLLISION_LIMIT][:] = limit.brake, limit.dt
        prices = p.prices
        reals[b.PRICES][:] = prices.acceleration, prices.force, prices.slack_linear, prices.slack_quadratic
        reals[b.OPTIONS][:] = p.horizon, p.posture.pull, TOLERANCE
        reals[b.SHARE][:] = 1.0
        reals[b.SIZE][:] = _sizes(p, len(reals[b.SIZE]))
        moves = _moves(p)
        reals[b.MOVES][:] = moves
        self._ints[b.BOUND][:], self._ints[b.FREE][:] = np.flatnonzero(moves.any(0)), np.flatnonzero(~moves.any(0))
        self._ints[b.OWNER][:] = np.repeat(np.arange(len(p.feet)), len(foot.points))
        self._ints[b.DRIVEN][:], self._ints[b.FINGERS][:] = limit.driven, limit.driven - 6
        self._ints[b.MOTORS][:], reals[b.STEP][:] = p.robot.pin_to_motor, (p.dt, p.leak)
        if p.safety:
            limit.proximity.share(reals[b.DISTANCE_], reals[b.BOUND_], reals[b.MEASURED], reals[b.TURNED])
            reals[b.TRIGGER][:] = limit.trigger
        counts = self._ints[b.COUNTS]
        counts[b.LEAST_PAIRS] = limit.least
        counts[b.N_CONTACTS], counts[b.TRUNK], counts[b.ITERATION_LIMIT] = len(p.feet), p.safety, ITERATION_LIMIT


def _palm(task: HandTask) -> tuple[np.ndarray, ...]:
    T = task.T_world_ref
    return T.rotation.reshape(9), T.translation, task.twist_ref, task.acceleration_ref


def _sizes(p: Parts, rows: int) -> np.ndarray:
    """About one over the length of each row in the metric of the cost: violations are compared in these units."""
    n, points = p.robot.n_joints, sum(len(foot.points) for foot in p.feet)
    sizes = np.ones(rows)
    sizes[n : 2 * n] = TORQUE_SIZE
    sizes[2 * n : 2 * n + 5 * points] = np.sqrt(p.prices.force)
    sizes[-2:] = np.sqrt(p.prices.slack_quadratic)
    return sizes


def _frames(p: Parts) -> list[str]:
    """Frames in the order of `assemble_core`: contacts, palms, pelvis, torso."""
    return [*(foot.frame for foot in p.feet), *(palm.frame for palm in p.palms), p.pelvis.frame, p.torso.frame]


def _bodies(p: Parts) -> list[int]:
    model, robot = p.robot.model, p.robot
    return [model.frames[robot.frame_id(frame)].parentJoint - 1 for frame in _frames(p)]


def _moves(p: Parts) -> np.ndarray:
    """Which velocity moves which contact, shape (n_contacts, nv), of bool."""
    model: pin.Model = p.robot.model
    moves = np.zeros((len(p.feet), model.nv), dtype=bool)
    for row, body in zip(moves, _bodies(p), strict=False):
        joint = body + 1
        while joint > 0:
            start = model.joints[joint].idx_v
            row[start : start + model.joints[joint].nv] = True
            joint = model.parents[joint]
    return moves


def _arenas(p: Parts, near_reals: Blocks, near_ints: Blocks) -> tuple[Arena, Arena]:
    """Memory for everything; the sizes follow from robot and contacts."""
    each = {len(foot.points) for foot in p.feet}
    if len(each) != 1 or p.torso.frame == p.pelvis.frame:
        raise InputError("the compiled program needs contacts with the same number of points; use `compiled: false`")
    model, n_contacts, n_points = p.robot.model, len(p.feet), sum(len(foot.points) for foot in p.feet)
    nv, nj, nb = model.nv, model.nv - 6, model.njoints - 1
    n_bound = int(_moves(p).any(0).sum())
    m, nr = 6 * n_contacts, n_bound - 6 * n_contacts
    ny, nf, frames, most = nr + nv - n_bound, 3 * n_points, n_contacts + 4, p.self_collision.most if p.safety else 0
    edges = n_points if p.safety else 0
    soft = edges + 15 + most if p.safety else 0
    rows, nu = 2 * nj + 5 * n_points + soft + 2, ny + nf + 2
    reals = {
        b.TABLE: (nb, 25), b.ARMATURE: (nv,), b.GRAVITY: (3,), b.FRAME_TABLE: (frames, 12),
        b.LOCAL_POINTS: (n_points, 3), b.JOINTS: (5, nj), b.TAU_MAX: (nj,), b.TAU_FULL: (nj,),
        b.POSTURE_GAIN: (3, nj), b.HAND_GAIN: (6,), b.COM_GAIN: (6,), b.MOMENTUM_GAIN: (2,), b.PELVIS_GAIN: (4,),
        b.TORSO_GAIN: (4,), b.HEIGHT_GAIN: (4,), b.CONTACT: (5,), b.BALANCE: (2,), b.PELVIS_LIMIT: (4,),
        b.TORSO_LIMIT: (4,), b.HEIGHT_LIMIT: (4,), b.COLLISION_LIMIT: (2,), b.PRICES: (4,), b.OPTIONS: (3,),
        b.FOOT_REF: (n_contacts, 12), b.EDGES: (edges, 3), b.MOVES: (n_contacts, nv),
        b.Q_: (model.nq,), b.V_: (nv,), b.HAND_REF: (2, 24), b.SHARE: (2,), b.COM_REF: (15,), b.PELVIS_REF: (15,),
        b.TORSO_REF: (15,), b.HEIGHT_REF: (3,), b.POSTURE_REF: (3, nj), b.PAIRS: (most, 10),
        b.R_: (nb, 9), b.P_: (nb, 3), b.S_: (nv, 6), b.TWIST: (nb, 6), b.DRIFT: (nb, 6), b.INERTIA_: (nb, 10),
        b.MOMENTA: (nb, 6), b.FORCES: (nb, 6), b.M_: (nv, nv), b.F_: (nv, 6), b.NLE: (nv,), b.SUMS_: (22,),
        b.FR_: (frames, 9), b.FP_: (frames, 3), b.FV_: (frames, 6), b.FA_: (frames, 6), b.FJ_: (6 * frames, nv),
        b.POINTS: (n_points, 3), b.ARMS: (n_points, 3), b.LOW: (nj,), b.HIGH: (nj,), b.TAU: (nj,), b.JS_: (soft, nv),
        b.SOFT_UPPER: (soft,), b.LOWER: (rows,), b.UPPER: (rows,), b.VALUE: (rows,), b.B_: (m, n_bound),
        b.BETA: (2, m), b.Z_: (n_bound, nr), b.DV_P: (n_bound,), b.CONTACT_TARGET: (m,), b.GRAM: (6, 6), b.W_: (6, 6),
        b.TARGET: (frames, 6), b.WEIGHT: (frames, 6), b.BODY_TARGET: (6,), b.BODY_WEIGHT: (6,),
        b.POSTURE_TARGET: (nj,), b.K_: (6, 6), b.K_RHS: (6,), b.REDUCED_F: (6, ny), b.W_P: (6,), b.KF_: (6, ny),
        b.H_: (ny, ny), b.U_: (ny, ny), b.G_: (ny,), b.Y0: (ny,), b.CENTRE: (3,), b.ROOT: (6,),
        b.QR_Q: (nu + 1, nu), b.QR_R: (nu + 1, nu + 1), b.RHS: (nu + 1,), b.LAM: (nu + 1,), b.SIDES: (nu + 1,),
        b.Y_: (nu + 1,), b.WANTED: (nu + 1,), b.ROW_M: (nu,), b.U_VEC: (nu,), b.X_Y: (ny,), b.DV: (nv,),
        b.FORCE: (nf,), b.SLACK: (2,), b.TAU_OUT: (nj,), b.A_V: (nv,), b.A_F: (nf,), b.A_S: (2,),
        b.WRENCH: (n_contacts, 6), b.SIX_A: (6,), b.SIX_B: (6,), b.SCRATCH: (max(m, 12),),
        b.COEFFICIENTS: (nu + 1,), b.DUAL: (rows,), b.GRADIENT: (nv,), b.GRADIENT_F: (nf,), b.REDUCED_G: (ny,),
        b.RESIDUALS: (3,), b.SIZE: (rows,), b.FRAME_ROWS: (6, ny), b.DESIRED: (2, nj), b.COMMAND: (3, nj), b.STEP: (2,),
    }  # fmt: skip
    ints = {
        b.PARENT: (nb,), b.FRAME_BODY: (frames,), b.BOUND: (n_bound,), b.FREE: (nv - n_bound,), b.OWNER: (n_points,),
        b.DRIVEN: (len(p.self_collision.driven),), b.PAIR_BODY: (2 * most,), b.PAIR_NOW: (most,),
        b.PAIR_BEFORE: (most,), b.ROWS: (nu + 1,), b.COUNTS: (b.COUNTS_SIZE,),
        b.MOTORS: (nj,), b.FINGERS: (len(p.self_collision.driven),),
    }  # fmt: skip
    if p.safety:
        for shapes, blocks, changing in zip(
            (reals, ints),
            (near_reals, near_ints),
            near_shapes(len(p.self_collision.proximity.pairs), nj, len(near_reals[b.REACH]), most),
            strict=True,
        ):
            shapes.update({block: values.shape for block, values in blocks.items()})
            shapes.update(changing)
    return Arena(reals, b.BLOCKS, np.float64), Arena(ints, b.INT_BLOCKS, np.int64)
