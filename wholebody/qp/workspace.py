"""The memory of the compiled tick: how large its blocks are, and what is in those that do not change."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from wholebody.contacts.foot import FootContact
from wholebody.errors import InputError
from wholebody.jit.packed import Arena
from wholebody.limits.balance import CapturePointLimit
from wholebody.limits.body import HeightLimit, OrientationLimit
from wholebody.limits.floor import FloorLimit
from wholebody.limits.self_collision import SelfCollisionLimit
from wholebody.qp.formulation import Regularisation
from wholebody.qp.kernels import blocks as b
from wholebody.qp.proximity_tables import Blocks, near_shapes, near_tables
from wholebody.robot.body_table import body_table
from wholebody.robot.state import Robot
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


@dataclass(frozen=True, kw_only=True)
class ProgramInputs:
    """What the program is made of: the readable tasks and limits, whose numbers are copied.

    Attributes:
        robot: The robot.
        feet: Contacts, all with the same number of points, friction and force bounds.
        palms: Tasks of the hands.
        pelvis, torso, height, com, momentum, posture: The other tasks.
        balance, pelvis_limit, torso_limit, height_limit, floor, self_collision: The soft limits.
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
    balance: CapturePointLimit
    pelvis_limit: OrientationLimit
    torso_limit: OrientationLimit
    height_limit: HeightLimit
    floor: FloorLimit
    self_collision: SelfCollisionLimit
    safety: bool
    prices: Regularisation
    joints: np.ndarray
    horizon: float
    dt: float
    leak: float
    tau_max: np.ndarray
    torque_share: float


def make_memory(p: ProgramInputs) -> tuple[Arena, Arena]:
    """Blocks of reals and of integers of `blocks`, with everything in them that does not change.

    Raises:
        InputError: If the contacts differ in their number of points, or pelvis and torso are one body.
    """
    tables = near_tables(p.robot.spec, p.self_collision.proximity, p.floor.underside) if p.safety else ({}, {})
    reals, ints = _arenas(p, *tables)
    for arena, blocks in zip((reals, ints), tables, strict=True):
        for block, values in blocks.items():
            arena[block][:] = values
    _fill_robot(p, reals, ints)
    _fill_tasks(p, reals)
    _fill_limits(p, reals, ints)
    return reals, ints


def _fill_robot(p: ProgramInputs, reals: Arena, ints: Arena) -> None:
    model, counts, moves = p.robot.model, ints[b.COUNTS], contact_moves(p)
    reals[b.TABLE][:], ints[b.PARENT][:] = body_table(model)
    reals[b.ARMATURE][:], reals[b.GRAVITY][:] = model.armature, model.gravity.linear
    for i, frame in enumerate(frame_names(p)):
        placement = model.frames[p.robot.frame_id(frame)].placement
        reals[b.FRAME_R][i], reals[b.FRAME_P][i] = placement.rotation.ravel(), placement.translation
    ints[b.FRAME_BODY][:] = frame_bodies(p)
    reals[b.LOCAL_POINTS][:] = np.vstack([foot.points for foot in p.feet])
    reals[b.JOINTS][:], reals[b.TAU_FULL][:] = p.joints, p.tau_max
    reals[b.TAU_MAX][:] = p.torque_share * p.tau_max
    reals[b.MOVES][:] = moves
    ints[b.BOUND][:], ints[b.FREE][:] = np.flatnonzero(moves.any(0)), np.flatnonzero(~moves.any(0))
    ints[b.OWNER][:] = np.repeat(np.arange(len(p.feet)), len(p.feet[0].points))
    ints[b.MOTORS][:], reals[b.STEP][:] = p.robot.pin_to_motor, (p.dt, p.leak)
    counts[b.N_CONTACTS], counts[b.TRUNK], counts[b.ITERATION_LIMIT] = len(p.feet), p.safety, ITERATION_LIMIT


def _fill_tasks(p: ProgramInputs, reals: Arena) -> None:
    hand, prices = p.palms[0], p.prices
    reals[b.POSTURE_GAIN][:] = p.posture.kp, p.posture.kd, p.posture.weight
    reals[b.HAND_GAIN][:] = hand.kp, hand.kd, *hand.pull, hand.weight[0], hand.weight[3]
    reals[b.COM_GAIN][:] = p.com.kp, p.com.kd, p.com.pull, *p.com.weight
    reals[b.MOMENTUM_GAIN][:] = p.momentum.kd, p.momentum.weight[0]
    for block, task in ((b.PELVIS_GAIN, p.pelvis), (b.TORSO_GAIN, p.torso), (b.HEIGHT_GAIN, p.height)):
        reals[block][:] = task.kp, task.kd, task.pull, task.weight[0]
    reals[b.PRICES][:] = prices.acceleration, prices.force, prices.slack_linear, prices.slack_quadratic
    reals[b.OPTIONS][:] = p.horizon, p.posture.pull, TOLERANCE, PRIMAL_ACCEPTED, DUAL_ACCEPTED
    reals[b.SHARE][:] = 1.0
    reals[b.SIZE][:] = _sizes(p, len(reals[b.SIZE]))


def _fill_limits(p: ProgramInputs, reals: Arena, ints: Arena) -> None:
    foot, limit, band = p.feet[0], p.self_collision, p.height_limit
    face = -foot.cone_rows[0, 2]
    reals[b.CONTACT][:] = foot.kp, foot.kd, face, foot.force_min, foot.force_max
    reals[b.BALANCE][:] = p.balance.margin, p.balance.gain
    for block, bound in ((b.PELVIS_LIMIT, p.pelvis_limit), (b.TORSO_LIMIT, p.torso_limit)):
        reals[block][:] = bound.angle_max, bound.rate_max, bound.brake, bound.dt
    reals[b.HEIGHT_LIMIT][:] = band.band, band.lowest, band.brake, band.dt
    reals[b.COLLISION_LIMIT][:] = limit.brake, limit.dt
    ints[b.DRIVEN][:], ints[b.FINGERS][:] = limit.driven, limit.driven - 6
    if p.safety:
        limit.proximity.share(reals[b.DISTANCE_], reals[b.BOUND_], reals[b.MEASURED], reals[b.TURNED])
        reals[b.TRIGGER][:], ints[b.COUNTS][b.LEAST_PAIRS] = limit.trigger, limit.least
        reals[b.FLOOR_LIMIT][:] = p.floor.distance, p.floor.trigger, p.floor.brake, p.floor.dt


def _sizes(p: ProgramInputs, rows: int) -> np.ndarray:
    """About one over the length of each row in the metric of the cost: violations are compared in these units."""
    n, points = p.robot.n_joints, sum(len(foot.points) for foot in p.feet)
    sizes = np.ones(rows)
    sizes[n : 2 * n] = TORQUE_SIZE
    sizes[2 * n : 2 * n + 5 * points] = np.sqrt(p.prices.force)
    sizes[-2:] = np.sqrt(p.prices.slack_quadratic)
    return sizes


def frame_names(p: ProgramInputs) -> list[str]:
    """Frames in the order of `assemble`: contacts, palms, pelvis, torso."""
    return [*(foot.frame for foot in p.feet), *(palm.frame for palm in p.palms), p.pelvis.frame, p.torso.frame]


def frame_bodies(p: ProgramInputs) -> list[int]:
    """Body of each of those frames."""
    model, robot = p.robot.model, p.robot
    return [model.frames[robot.frame_id(frame)].parentJoint - 1 for frame in frame_names(p)]


def contact_moves(p: ProgramInputs) -> np.ndarray:
    """Which velocity moves which contact, shape (n_contacts, nv), of bool."""
    model: pin.Model = p.robot.model
    moves = np.zeros((len(p.feet), model.nv), dtype=bool)
    for row, body in zip(moves, frame_bodies(p), strict=False):
        joint = body + 1
        while joint > 0:
            start = model.joints[joint].idx_v
            row[start : start + model.joints[joint].nv] = True
            joint = model.parents[joint]
    return moves


def _arenas(p: ProgramInputs, near_reals: Blocks, near_ints: Blocks) -> tuple[Arena, Arena]:
    """Memory for everything; the sizes follow from robot and contacts."""
    each = {len(foot.points) for foot in p.feet}
    if len(each) != 1 or p.torso.frame == p.pelvis.frame:
        raise InputError("the compiled program needs contacts with the same number of points; use `compiled: false`")
    model, n_contacts, n_points = p.robot.model, len(p.feet), sum(len(foot.points) for foot in p.feet)
    nv, nj, nb = model.nv, model.nv - 6, model.njoints - 1
    n_bound = int(contact_moves(p).any(0).sum())
    m, nr = 6 * n_contacts, n_bound - 6 * n_contacts
    ny, nf, frames, most = nr + nv - n_bound, 3 * n_points, n_contacts + 4, p.self_collision.most if p.safety else 0
    edges = n_points if p.safety else 0
    low = len(p.floor.underside.labels)
    soft = edges + 15 + low + most if p.safety else 0
    rows, nu = 2 * nj + 5 * n_points + soft + 2, ny + nf + 2
    reals = {
        b.TABLE: (nb, 25), b.ARMATURE: (nv,), b.GRAVITY: (3,), b.FRAME_R: (frames, 9), b.FRAME_P: (frames, 3),
        b.LOCAL_POINTS: (n_points, 3), b.JOINTS: (5, nj), b.TAU_MAX: (nj,), b.TAU_FULL: (nj,),
        b.POSTURE_GAIN: (3, nj), b.HAND_GAIN: (6,), b.COM_GAIN: (6,), b.MOMENTUM_GAIN: (2,), b.PELVIS_GAIN: (4,),
        b.TORSO_GAIN: (4,), b.HEIGHT_GAIN: (4,), b.CONTACT: (5,), b.BALANCE: (2,), b.PELVIS_LIMIT: (4,),
        b.TORSO_LIMIT: (4,), b.HEIGHT_LIMIT: (4,), b.COLLISION_LIMIT: (2,), b.PRICES: (4,), b.OPTIONS: (5,),
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
        b.FORCE: (nf,), b.SLACK: (2,), b.TAU_OUT: (nj,), b.CENTRE_NOW: (6,), b.A_V: (nv,), b.A_F: (nf,), b.A_S: (2,),
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
