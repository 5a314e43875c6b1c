"""The memory of the compiled tick: how large its fields are, and what is in those that do not change."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from wholebody.contacts.friction import pyramid_slope
from wholebody.errors import InputError
from wholebody.jit.packed import Packed, Shape
from wholebody.limits.base import TIME_CONSTANT
from wholebody.qp.kernels.limits import TRUNK_ROWS
from wholebody.qp.program_inputs import (
    ProgramInputs,
    Shapes,
    body_shapes,
    contact_moves,
    fill_body,
    frame_names,
    room,
    row_shapes,
    standing_shapes,
)
from wholebody.qp.proximity_tables import Fields, changing_shapes, no_tables, proximity_tables

TORQUE_SCALE = 0.1
"""Scale of rows of torques, see `_row_scales` [1/(N m)]; chosen, no trial is on record."""
BLOCK = 6
"""Rows of a block of an objective."""


def make_workspace(p: ProgramInputs) -> Packed:
    """The memory, with everything in it that does not change.

    Raises:
        InputError: If the contacts differ in their number of points, or pelvis and torso are one body.
    """
    if len({len(foot.points) for foot in p.feet}) != 1 or p.tasks.torso.frame == p.tasks.pelvis.frame:
        raise InputError(
            "the compiled program needs contacts with the same number of points, and pelvis and torso as two bodies; "
            "the readable program (`controller: {solver: daqp}`) does without"
        )
    tables = proximity_tables(p.robot.spec, p.self_collision.proximity, p.floor.underside) if p.safety else no_tables()
    tick = Packed(*_shapes(p, *tables))
    for fields in tables:
        for name, values in fields.items():
            getattr(tick, name)[:] = values
    fill_body(p, tick)
    _fill_robot(p, tick)
    _fill_limits(p, tick)
    return tick


def _shapes(p: ProgramInputs, real_tables: Fields, int_tables: Fields) -> tuple[dict[str, Shape], dict[str, Shape]]:
    """Fields of reals and of integers; the sizes follow from robot and contacts."""
    model, feet, n_points = p.robot.model, len(p.feet), sum(len(foot.points) for foot in p.feet)
    nv, nj, nb, nf, most = model.nv, model.nv - 6, model.njoints - 1, 3 * n_points, p.self_collision.most
    task_rows, limit_rows = p.extra_rows
    blocks = len(frame_names(p)) + -(-task_rows // BLOCK)
    edges, soft = (n_points, n_points + TRUNK_ROWS + len(p.floor.underside.labels) + most) if p.safety else (0, 0)
    soft += limit_rows
    rows = 2 * nj + 5 * n_points + soft + 2
    body_reals, body_ints = body_shapes(p, blocks)
    standing_reals, standing_ints = room(p, partial(shapes_of, p))
    changing = changing_shapes(len(int_tables["pair_shapes"]), nj, len(real_tables["reach"]), most if p.safety else 0)
    reals = {
        **body_reals, **standing_reals, **row_shapes(rows), **changing[0],
        **{name: values.shape for name, values in real_tables.items()},
        "armature": (nv,), "gravity": (3,), "joint_limits": (5, nj), "tau_max": (nj,), "effort_max": (nj,),
        "foot_kp": (), "foot_kd": (), "slope": (), "force_min": (feet,), "force_max": (feet,), "moves": (feet, nv),
        "edges": (edges, 3), "pelvis_limit": (4,), "torso_limit": (4,), "height_limit": (4,), "collision_brake": (),
        "collision_dt": (), "floor_distance": (), "floor_trigger": (), "floor_brake": (), "floor_dt": (),
        "penalty_acceleration": (), "penalty_force": (), "penalty_slack": (), "penalty_slack_squared": (),
        "horizon": (), "leak": (nj,), "V": (nb, 6), "A": (nb, 6), "inertia": (nb, 10), "momentum": (nb, 6),
        "M": (nv, nv), "F": (nv, 6), "nle": (nv,), "ddq_min": (nj,), "ddq_max": (nj,), "soft_J": (soft, nv),
        "soft_upper": (soft,), "w_p": (6,), "k": (6,), "centre": (3,), "f_0": (6,), "a_f": (nf,),
        "a_slack": (2,), "wrench": (feet, 6), "gradient": (nv,), "gradient_f": (nf,), "gradient_slack": (2,),
        "desired": (2, nj),
        # The answer, copied as a whole.
        "dv": (nv,), "f": (nf,), "slack": (2,), "tau": (nj,), "com": (6,), "command": (3, nj), "residuals": (3,),
        "dual": (rows,),
    }  # fmt: skip
    ints = {
        **body_ints, **standing_ints, **{name: values.shape for name, values in int_tables.items()}, **changing[1],
        "owner": (n_points,), "driven": (len(p.self_collision.prescribed),), "motors": (nj,),
        "fingers": (len(p.self_collision.prescribed),), "trunk": (), "n_balance": (),
    }  # fmt: skip
    return reals, ints


def shapes_of(p: ProgramInputs, standing: Sequence[int]) -> tuple[Shapes, Shapes]:
    """Fields whose lengths go with which contacts stand, by their numbers; all points have forces, if only 0."""
    reals, ints = standing_shapes(p, standing, 3 * sum(len(foot.points) for foot in p.feet) + 2)
    return reals | {"FZ": (6, *reals["y"])}, ints


def _fill_robot(p: ProgramInputs, tick: Packed) -> None:
    model, penalties, points = p.robot.model, p.penalties, len(p.feet[0].points)
    tick.armature[:], tick.gravity[:] = model.armature, model.gravity.linear
    tick.joint_limits[:], tick.effort_max[:], tick.tau_max[:] = (
        p.joints,
        p.tau_max,
        p.config.safety.torque_share * p.tau_max,
    )
    tick.moves[:], tick.owner[:] = contact_moves(p), np.repeat(np.arange(len(p.feet)), points)
    tick.motors[:] = p.robot.pin_to_motor
    tick.leak[:], tick.horizon = p.config.dt / p.config.leak, p.config.safety.joint_horizon
    tick.momentum_kd, tick.momentum_weight = p.tasks.momentum.kd, p.tasks.momentum.weight[0]
    tick.penalty_acceleration, tick.penalty_force = penalties.acceleration, penalties.force
    tick.penalty_slack, tick.penalty_slack_squared = penalties.slack_linear, penalties.slack_quadratic
    tick.row_scale[:] = _row_scales(p, len(tick.row_scale))


def _fill_limits(p: ProgramInputs, tick: Packed) -> None:
    foot, limit, band, floor = p.feet[0], p.self_collision, p.height_limit, p.floor
    tick.foot_kp, tick.foot_kd, tick.slope = foot.kp, foot.kd, pyramid_slope(foot.friction)
    for values, bound in ((tick.pelvis_limit, p.pelvis_limit), (tick.torso_limit, p.torso_limit)):
        values[:] = bound.angle_max, bound.rate_max, bound.brake, TIME_CONSTANT
    tick.height_limit[:] = band.band, band.lowest, band.brake, TIME_CONSTANT
    tick.collision_brake, tick.collision_dt = limit.brake, TIME_CONSTANT
    tick.driven[:], tick.fingers[:] = limit.prescribed, limit.prescribed - 6
    tick.soft_upper[:] = np.inf
    tick.trunk, tick.n_balance = p.safety, len(tick.edges) + TRUNK_ROWS * p.safety + p.extra_rows[1]
    if p.safety:
        limit.proximity.keep_state_in(tick.distance, tick.distance_bound, tick.measured, tick.q_before)
        tick.pair_trigger, tick.n_pairs_least = limit.trigger, limit.least
        tick.floor_distance, tick.floor_trigger = floor.distance, floor.trigger
        tick.floor_brake, tick.floor_dt = floor.brake, TIME_CONSTANT


def _row_scales(p: ProgramInputs, rows: int) -> np.ndarray:
    """About one over the length of each row in the metric of the cost: violations are compared in these units."""
    n, points = p.robot.n_joints, sum(len(foot.points) for foot in p.feet)
    scales = np.ones(rows)
    scales[n : 2 * n] = TORQUE_SCALE
    scales[2 * n : 2 * n + 5 * points] = np.sqrt(p.penalties.force)
    scales[-2:] = np.sqrt(p.penalties.slack_quadratic)
    return scales
