"""The memory of the compiled kinematic tick: fields of `wholebody.qp.program_inputs`, and a few of its own."""

from __future__ import annotations

from functools import partial

from wholebody.backends.kinematic.formulation import FOOT_GAIN, RETREAT, SPEED_PENALTY
from wholebody.jit.packed import Packed
from wholebody.qp.program_inputs import (
    BodyInputs,
    body_shapes,
    fill_body,
    frame_names,
    room,
    row_shapes,
    standing_shapes,
)
from wholebody.robot.kernels.pendulum import GRAVITY


def make_workspace(p: BodyInputs) -> Packed:
    """The memory, with everything in it that does not change."""
    model, feet, n_points = p.robot.model, len(p.feet), sum(len(foot.points) for foot in p.feet)
    nv, nj, nb, frames = model.nv, model.nv - 6, model.njoints - 1, len(frame_names(p))
    rows = nj + n_points
    body_reals, ints = body_shapes(p, frames)
    standing_reals, standing_ints = room(p, partial(standing_shapes, p))
    reals = {
        **body_reals, **standing_reals, **row_shapes(rows), "joint_limits": (3, nj), "edges": (n_points, 3),
        "task_kd": (frames,), "foot_gain": (), "speed_penalty": (), "retreat": (), "gravity": (),
        "q_measured": (model.nq,), "mass_moment": (nb, 4), "com": (6,), "J_com": (3, nv), "dv": (nv,), "tau": (nj,),
        "dual": (rows,), "residuals": (3,),
    }  # fmt: skip
    tick = Packed(reals, {**ints, **standing_ints})
    fill_body(p, tick)
    tick.joint_limits[:] = p.joints
    kd_hand, kd_trunk = p.tasks.palms[0].kd, p.tasks.torso.kd
    tick.task_kd[:feet], tick.task_kd[feet : feet + 2], tick.task_kd[feet + 2 :] = 1.0, kd_hand, kd_trunk
    tick.foot_gain, tick.speed_penalty, tick.retreat, tick.gravity = FOOT_GAIN, SPEED_PENALTY, RETREAT, GRAVITY
    return tick
