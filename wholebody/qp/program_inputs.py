"""What the whole-body program is made of, and what of it two compiled programs need alike."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import pinocchio as pin

from wholebody.config import ControllerConfig
from wholebody.contacts.foot import FootContact
from wholebody.errors import InputError
from wholebody.jit.packed import Packed, Shape
from wholebody.limits.balance import CapturePointLimit
from wholebody.limits.body import HeightLimit, OrientationLimit
from wholebody.limits.floor import FloorLimit
from wholebody.limits.joint import JointLimits
from wholebody.limits.self_collision import SelfCollisionLimit
from wholebody.qp.formulation import Regularisation
from wholebody.robot.body_table import body_table
from wholebody.robot.kernels.frames import PALM_FRAME
from wholebody.robot.state import Robot
from wholebody.robot.touch import TOUCH
from wholebody.tasks.body_tasks import BodyTasks

ITERATION_LIMIT = 200
"""Changes of the working set after which the readable program is asked: a dual method can cycle."""
VIOLATION_MIN = 1e-9
"""Violation from which a row enters the working set [m/s^2, rad/s^2, N, N m]; chosen: a thousandth of what is
accepted."""
EXTRA_ROWS = 24
"""Room for the rows of further tasks, and of further limits, where there are any."""
RESIDUAL_MAX = 1e-6
"""Largest accepted residuals [m/s^2, rad/s^2, N, N m; scaled]; chosen: an order below those of the other solvers."""


@dataclass(frozen=True, kw_only=True)
class BodyInputs:
    """What every compiled program is made of: the readable tasks and limits, whose numbers are copied.

    Attributes:
        robot: The robot.
        feet: Contacts, all with the same number of points, friction and force bounds.
        tasks: By name; further ones are handed over at each tick.
        balance: The support, and how to keep inside.
        joints: Limits, Pinocchio order; the kinematic program has the first three rows only.
        config: Control period and leak; of the safety, the horizon of joint bounds and the share of the torques.
    """

    robot: Robot
    feet: Sequence[FootContact]
    tasks: BodyTasks
    balance: CapturePointLimit
    joints: JointLimits | np.ndarray
    config: ControllerConfig


@dataclass(frozen=True, kw_only=True)
class ProgramInputs(BodyInputs):
    """What the whole-body program is made of besides.

    Attributes:
        pelvis_limit, torso_limit, height_limit, floor, self_collision: The soft limits, with the balance.
        safety: Whether they have rows.
        penalties: Of accelerations, forces and slacks.
        tau_max: Effort limits, shape (n_joints,), [N m].
        extra_rows: Room for rows of further tasks, and of further limits; see `CompiledProgram.set_extra`.
    """

    pelvis_limit: OrientationLimit
    torso_limit: OrientationLimit
    height_limit: HeightLimit
    floor: FloorLimit
    self_collision: SelfCollisionLimit
    safety: bool
    penalties: Regularisation
    tau_max: np.ndarray
    extra_rows: tuple[int, int] = (0, 0)


Shapes = dict[str, Shape]
"""Shape of each field by name."""
StandingShapes = Callable[[Sequence[int]], tuple[Shapes, Shapes]]
"""Fields of reals and of integers whose lengths go with the contacts that stand, by their numbers."""


def body_shapes(p: BodyInputs, blocks: int) -> tuple[Shapes, Shapes]:
    """Fields of reals and of integers that every compiled program has, beside those of `standing_shapes`.

    Args:
        p: What the program is made of.
        blocks: Number of blocks of six rows that objectives have: frames and further ones.

    Raises:
        InputError: If the robot has another number of feet than two.
    """
    model, feet, n_points = p.robot.model, len(p.feet), sum(len(foot.points) for foot in p.feet)
    nv, nj, nb, frames = model.nv, model.nv - 6, model.njoints - 1, len(frame_names(p))
    if feet != PALM_FRAME:
        raise InputError(f"compiled programs need two feet, not {feet}; `controller: {{solver: daqp}}` does without")
    reals = {
        "bodies": (nb, 25), "frame_R_local": (frames, 3, 3), "frame_p_local": (frames, 3),
        "points_local": (n_points, 3), "foot_R_ref": (feet, 3, 3), "foot_p_ref": (feet, 3),
        "hand_kp": (), "hand_kd": (), "hand_feedback_max": (2,), "hand_weight": (2,), "com_kp": (), "com_kd": (),
        "com_feedback_max": (), "com_weight": (3,), "momentum_kd": (), "momentum_weight": (), "pelvis_gain": (4,),
        "torso_gain": (4,), "height_gain": (4,), "posture_kp": (nj,), "posture_kd": (nj,), "posture_weight": (nj,),
        "posture_feedback_max": (), "balance_margin": (), "balance_gain": (), "tolerance": (), "primal_accepted": (),
        "dual_accepted": (), "dt": (), "q": (model.nq,), "v": (nv,), "trust": (2,), "touch": (2, TOUCH), "lean": (2,),
        "tipped": (2,), "braced": (1,), "foot_ref": (feet, 24), "foot_kp_up": (), "foot_kd_up": (), "foot_weight": (2,),
        "foot_feedback_max": (2,), "hand_ref": (2, 24),
        "com_ref": (15,), "pelvis_ref": (15,), "torso_ref": (15,), "height_ref": (3,), "posture_ref": (3, nj),
        "R": (nb, 3, 3), "p": (nb, 3), "S": (nv, 6), "force": (nb, 6), "sums": (22,),
        "frame_R": (frames, 3, 3), "frame_p": (frames, 3), "frame_V": (frames, 6), "frame_A": (frames, 6),
        "J": (6 * blocks, nv), "target": (blocks, 6), "weight": (blocks, 6), "body_target": (6,), "body_weight": (6,),
        "posture_target": (nj,), "points": (n_points, 3), "gram": (6, 6), "K": (6, 6), "W": (6, 6),
        "contact_target": (6 * feet,), "a_dv": (nv,), "six_a": (6,), "six_b": (6,), "scratch": (12,),
    }  # fmt: skip
    ints = {
        "parent": (nb,), "frame_body": (frames,), "n_contacts": (), "n_edges": (), "hands": (), "iterations": (),
        "iteration_limit": (), "n_working": (), "swings": (),
    }  # fmt: skip
    return reals, ints


def standing_shapes(p: BodyInputs, standing: Sequence[int], others: int = 0) -> tuple[Shapes, Shapes]:
    """Fields of reals and of integers whose lengths go with which feet stand.

    Each foot that stands takes six directions from the accelerations: ``y`` has nv - 6 feet entries. A foot that is up
    takes none, and the joints of its leg are free.

    Args:
        p: What the program is made of.
        standing: Numbers of the contacts that stand.
        others: Number of variables of the search beside ``y``.
    """
    nv, m = p.robot.model.nv, 6 * len(standing)
    bound, points = int(contact_moves(p)[list(standing)].any(0).sum()), sum(len(p.feet[c].points) for c in standing)
    ny = nv - m
    nu = ny + others
    reals = {
        "B": (m, bound), "beta": (2, m), "Z": (bound, bound - m), "dv_p": (bound,), "contact_goal": (m,),
        "block_rows": (6, ny), "block_weighted": (6, ny), "H": (ny, ny), "U": (ny, ny), "g": (ny,), "y": (ny,),
        "y_free": (ny,), "reduced_gradient": (ny,),
        # Those of the search of `active_set`.
        "Q": (nu + 1, nu), "T": (nu + 1, nu + 1), "rhs": (nu + 1,), "lam": (nu + 1,), "sides": (nu + 1,),
        "y_dual": (nu + 1,), "lam_boundary": (nu + 1,), "coefficients": (nu + 1,), "m": (nu,), "u": (nu,),
    }  # fmt: skip
    ints = {
        "bound_columns": (bound,), "free_columns": (nv - bound,), "standing": (len(standing),), "loaded": (points,),
        "lifted": (len(p.feet) - len(standing),),
        "rows": (nu + 1,),
    }  # fmt: skip
    return reals, ints


def room(p: BodyInputs, shapes: StandingShapes) -> tuple[Shapes, Shapes]:
    """Fields as long as they get, whichever feet stand."""
    feet = range(len(p.feet))
    reals, ints = zip(*(shapes(chosen) for n in feet for chosen in combinations(feet, n + 1)), strict=True)
    return tuple({name: tuple(map(max, *(one[name] for one in kind))) for name in kind[0]} for kind in (reals, ints))


def row_shapes(rows: int) -> Shapes:
    """Fields of reals that the rows of the search have."""
    return {"lower": (rows,), "upper": (rows,), "value": (rows,), "row_scale": (rows,)}


def fill_body(p: BodyInputs, tick: Packed) -> None:
    """What robot and tasks say and nothing changes."""
    model = p.robot.model
    tick.bodies[:], tick.parent[:] = body_table(model)
    for i, frame in enumerate(frame_names(p)):
        placement = model.frames[p.robot.frame_id(frame)].placement
        tick.frame_R_local[i], tick.frame_p_local[i] = placement.rotation, placement.translation
    tick.frame_body[:] = frame_bodies(p)
    tick.points_local[:] = np.vstack([foot.points for foot in p.feet])
    hand, com, posture = p.tasks.palms[0], p.tasks.com, p.tasks.posture
    tick.hand_kp, tick.hand_kd, tick.com_kp, tick.com_kd = hand.kp, hand.kd, com.kp, com.kd
    tick.hand_feedback_max[:], tick.hand_weight[:] = hand.feedback_max, (hand.weight[0], hand.weight[3])
    tick.com_feedback_max, tick.com_weight[:] = com.feedback_max, com.weight
    foot = p.tasks.feet[0]
    tick.foot_kp_up, tick.foot_kd_up, tick.foot_weight[:] = foot.kp, foot.kd, (foot.weight[0], foot.weight[3])
    tick.foot_feedback_max[:] = foot.feedback_max
    for name in ("pelvis", "torso", "height"):
        gain, task = getattr(tick, f"{name}_gain"), getattr(p.tasks, name)
        gain[:] = task.kp, task.kd, task.feedback_max, task.weight[0]
    tick.posture_kp[:], tick.posture_kd[:], tick.posture_weight[:] = posture.kp, posture.kd, posture.weight
    tick.posture_feedback_max = posture.feedback_max
    tick.balance_margin, tick.balance_gain, tick.dt = p.balance.margin, p.balance.gain, p.config.dt
    tick.tolerance, tick.primal_accepted, tick.dual_accepted = VIOLATION_MIN, RESIDUAL_MAX, RESIDUAL_MAX
    tick.n_contacts, tick.hands, tick.iteration_limit = len(p.feet), 1, ITERATION_LIMIT
    tick.trust[:] = tick.row_scale[:] = 1.0


def stand(p: BodyInputs, tick: Packed, shapes: StandingShapes) -> None:
    """Take over which feet stand and where; the memory takes the lengths that go with it, the working set is lost."""
    standing = [c for c, foot in enumerate(p.feet) if foot.load > 0.0]
    for each in shapes(standing):
        tick.shape(each)
    moves, points = contact_moves(p)[standing].any(0), np.arange(len(tick.points_local)).reshape(len(p.feet), -1)
    tick.standing[:], tick.loaded[:] = standing, points[standing].reshape(-1)
    tick.lifted[:], tick.weight[: len(p.feet)] = [c for c in range(len(p.feet)) if c not in standing], 0.0
    tick.bound_columns[:], tick.free_columns[:] = np.flatnonzero(moves), np.flatnonzero(~moves)
    tick.n_working = 0
    for R, position, foot in zip(tick.foot_R_ref, tick.foot_p_ref, p.feet, strict=True):
        if foot.T_world_ref is not None:
            R[:], position[:] = foot.T_world_ref.rotation, foot.T_world_ref.translation


def frame_names(p: BodyInputs) -> list[str]:
    """Frames in the order of `wholebody.robot.kernels.frames`."""
    return [one.frame for one in (*p.feet, *p.tasks.palms, p.tasks.pelvis, p.tasks.torso)]


def frame_bodies(p: BodyInputs) -> list[int]:
    """Body of each of those frames."""
    model, robot = p.robot.model, p.robot
    return [model.frames[robot.frame_id(frame)].parentJoint - 1 for frame in frame_names(p)]


def contact_moves(p: BodyInputs) -> np.ndarray:
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
