"""The memory of the compiled kinematic tick: blocks of `blocks`, few of them used."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wholebody.backends.kinematic.formulation import FOOT_GAIN, RETREAT, SPEED_PRICE
from wholebody.backends.kinematic.kernels.placement import STEP
from wholebody.contacts.foot import FootContact
from wholebody.jit.packed import Arena
from wholebody.limits.balance import CapturePointLimit
from wholebody.qp.kernels import blocks as b
from wholebody.qp.workspace import (
    DUAL_ACCEPTED,
    ITERATION_LIMIT,
    PRIMAL_ACCEPTED,
    TOLERANCE,
    contact_moves,
    frame_bodies,
    frame_names,
)
from wholebody.robot.body_table import body_table
from wholebody.robot.kernels.pendulum import GRAVITY
from wholebody.robot.state import Robot
from wholebody.tasks.com import ComTask
from wholebody.tasks.hand import HandTask
from wholebody.tasks.height import HeightTask
from wholebody.tasks.orientation import OrientationTask
from wholebody.tasks.posture import PostureTask


@dataclass(frozen=True, kw_only=True)
class KinematicInputs:
    """What the program is made of; names and meanings as in `wholebody.qp.workspace.ProgramInputs`.

    Attributes:
        joints: Rows ``q_min q_max dq_max``, Pinocchio order, shape (3, n_joints).
        dt: Control period [s].
    """

    robot: Robot
    feet: Sequence[FootContact]
    palms: Sequence[HandTask]
    pelvis: OrientationTask
    torso: OrientationTask
    height: HeightTask
    com: ComTask
    posture: PostureTask
    balance: CapturePointLimit
    joints: np.ndarray
    dt: float


def make_memory(p: KinematicInputs) -> tuple[Arena, Arena]:
    """Blocks of reals and of integers, with everything in them that does not change."""
    moves = contact_moves(p)
    bound, free = np.flatnonzero(moves.any(0)), np.flatnonzero(~moves.any(0))
    reals, ints = _arenas(p, len(bound))
    model, counts = p.robot.model, ints[b.COUNTS]
    reals[b.TABLE][:], ints[b.PARENT][:] = body_table(model)
    for i, frame in enumerate(frame_names(p)):
        placement = model.frames[p.robot.frame_id(frame)].placement
        reals[b.FRAME_R][i], reals[b.FRAME_P][i] = placement.rotation.ravel(), placement.translation
    ints[b.FRAME_BODY][:], ints[b.BOUND][:], ints[b.FREE][:] = frame_bodies(p), bound, free
    reals[b.LOCAL_POINTS][:] = np.vstack([foot.points for foot in p.feet])
    reals[b.JOINTS][:], reals[b.BALANCE][:] = p.joints, (p.balance.margin, p.balance.gain)
    hand, com = p.palms[0], p.com
    reals[b.HAND_GAIN][:] = hand.kp, hand.kd, *hand.pull, hand.weight[0], hand.weight[3]
    reals[b.COM_GAIN][:] = com.kp, com.kd, com.pull, *com.weight
    reals[b.POSTURE_GAIN][:] = p.posture.kp, p.posture.kd, p.posture.weight
    for block, task in ((b.PELVIS_GAIN, p.pelvis), (b.TORSO_GAIN, p.torso), (b.HEIGHT_GAIN, p.height)):
        reals[block][:] = task.kp, task.kd, task.pull, task.weight[0]
    reals[b.STEP][:] = p.dt, FOOT_GAIN, SPEED_PRICE, RETREAT, hand.kd, p.torso.kd, com.kd, GRAVITY
    reals[b.OPTIONS][:] = 0.0, p.posture.pull, TOLERANCE, PRIMAL_ACCEPTED, DUAL_ACCEPTED
    reals[b.SIZE][:] = reals[b.SHARE][:] = 1.0
    counts[b.N_CONTACTS], counts[b.HANDS], counts[b.ITERATION_LIMIT] = len(p.feet), 1, ITERATION_LIMIT
    return reals, ints


def _arenas(p: KinematicInputs, n_bound: int) -> tuple[Arena, Arena]:
    """Memory for everything; the sizes follow from robot and contacts."""
    model, n_points = p.robot.model, sum(len(foot.points) for foot in p.feet)
    nv, nj, nb, m, frames = model.nv, model.nv - 6, model.njoints - 1, 6 * len(p.feet), len(p.feet) + 4
    nr = n_bound - m
    ny = nr + nv - n_bound
    rows = nj + n_points
    reals = {
        b.TABLE: (nb, 25), b.FRAME_R: (frames, 9), b.FRAME_P: (frames, 3), b.LOCAL_POINTS: (n_points, 3),
        b.JOINTS: (3, nj),
        b.POSTURE_GAIN: (3, nj), b.HAND_GAIN: (6,), b.COM_GAIN: (6,), b.MOMENTUM_GAIN: (2,), b.PELVIS_GAIN: (4,),
        b.TORSO_GAIN: (4,), b.HEIGHT_GAIN: (4,), b.BALANCE: (2,), b.OPTIONS: (5,), b.FOOT_REF: (len(p.feet), 12),
        b.EDGES: (n_points, 3), b.STEP: (STEP,), b.Q_: (model.nq,), b.V_: (nv,), b.DESIRED: (model.nq,),
        b.HAND_REF: (2, 24), b.SHARE: (2,), b.COM_REF: (15,), b.PELVIS_REF: (15,), b.TORSO_REF: (15,),
        b.HEIGHT_REF: (3,), b.POSTURE_REF: (3, nj), b.R_: (nb, 9), b.P_: (nb, 3), b.S_: (nv, 6),
        b.INERTIA_: (nb, 4), b.FORCES: (nb, 6), b.SUMS_: (22,), b.CENTRE_NOW: (6,), b.FR_: (frames, 9),
        b.FP_: (frames, 3), b.FV_: (frames, 6), b.FA_: (frames, 6), b.FJ_: (6 * frames, nv), b.JS_: (3, nv),
        b.POINTS: (n_points, 3), b.ARMS: (n_points, 3), b.GRAM: (6, 6), b.K_: (6, 6), b.W_: (6, 6),
        b.B_: (m, n_bound), b.BETA: (2, m), b.Z_: (n_bound, nr), b.DV_P: (n_bound,), b.CONTACT_TARGET: (m,),
        b.TARGET: (frames, 6), b.WEIGHT: (frames, 6), b.BODY_TARGET: (6,), b.BODY_WEIGHT: (6,),
        b.POSTURE_TARGET: (nj,), b.KF_: (6, ny), b.FRAME_ROWS: (6, ny), b.H_: (ny, ny), b.U_: (ny, ny), b.G_: (ny,),
        b.Y0: (ny,), b.X_Y: (ny,), b.U_VEC: (ny,), b.ROW_M: (ny,), b.REDUCED_G: (ny,), b.LOWER: (rows,),
        b.UPPER: (rows,), b.VALUE: (rows,), b.SIZE: (rows,), b.DUAL: (rows,), b.QR_Q: (ny + 1, ny),
        b.QR_R: (ny + 1, ny + 1), b.RHS: (ny + 1,), b.LAM: (ny + 1,), b.SIDES: (ny + 1,), b.Y_: (ny + 1,),
        b.WANTED: (ny + 1,), b.COEFFICIENTS: (ny + 1,), b.A_V: (nv,), b.DV: (nv,), b.TAU_OUT: (nj,),
        b.SIX_A: (6,), b.SIX_B: (6,), b.SCRATCH: (12,), b.RESIDUALS: (3,),
    }  # fmt: skip
    ints = {
        b.PARENT: (nb,), b.FRAME_BODY: (frames,), b.BOUND: (n_bound,), b.FREE: (nv - n_bound,), b.ROWS: (ny + 1,),
        b.COUNTS: (b.COUNTS_SIZE,),
    }  # fmt: skip
    return Arena(reals, b.BLOCKS, np.float64), Arena(ints, b.INT_BLOCKS, np.int64)
